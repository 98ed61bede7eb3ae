//! Probes of parts that could stand still while they seem to run: the writer, the outbox and the
//! router. In: the parts. Out: a beat of the part's heart for each probe that went through
//! ([`engine::heartbeats`]). Workers need none: they beat by their work.

use crate::{
    bus::{Outbox, Pinger},
    store::Store,
};
use engine::vitals::Vitals;
use std::{sync::Arc, time::Duration};
use tokio::{sync::watch, task::JoinHandle, time::sleep};

/// Time between two probes of a part.
const PROBE_EVERY: Duration = Duration::from_millis(1500);
/// The same after a ping without an answer: one that was lost is soon made up for.
const PING_AGAIN: Duration = Duration::from_millis(200);
/// Longest wait for the link of the pings.
const LINK_OPENS: Duration = Duration::from_secs(20);
/// What answers robots, by its name in `/readyz`.
pub(crate) const ROUTER: &str = "the zenoh router";

/// The tasks; they end when the server stops.
#[derive(Debug)]
pub(crate) struct LiveProbes(Vec<JoinHandle<()>>);

impl LiveProbes {
    /// Begins to probe.
    pub(crate) fn start(
        (store, outbox, pinger): (Store, Outbox, Option<Pinger>),
        vitals: &Arc<Vitals>,
        stopping: &watch::Receiver<bool>,
    ) -> Self {
        let writer = async move {
            store.heart().beat();
            // It beats by what it answers.
            while store.probe().await.is_ok() {
                sleep(PROBE_EVERY).await;
            }
        };
        let sending = async move {
            outbox.heart().beat();
            loop {
                outbox.probe();
                sleep(PROBE_EVERY).await;
            }
        };
        let mut tasks = vec![
            tokio::spawn(until(stopping.clone(), writer)),
            tokio::spawn(until(stopping.clone(), sending)),
        ];
        if let Some(pinger) = pinger {
            let router = vitals.hearts().begin(ROUTER);
            let pings = async move {
                // However long this takes on a busy machine: time counts from here on.
                tokio::time::timeout(LINK_OPENS, pinger.open()).await.ok();
                router.beat();
                loop {
                    let is_answered = pinger.ping().await;
                    if is_answered {
                        router.beat();
                    }
                    sleep(if is_answered { PROBE_EVERY } else { PING_AGAIN }).await;
                }
            };
            tasks.push(tokio::spawn(until(stopping.clone(), pings)));
        }
        Self(tasks)
    }

    /// Returns when no probe is under way.
    pub(crate) async fn close(&mut self) {
        for task in self.0.drain(..) {
            if let Err(error) = task.await {
                tracing::error!(%error, "probe_panicked");
            }
        }
    }
}

/// Probes until the server stops.
async fn until(mut stopping: watch::Receiver<bool>, probing: impl Future<Output = ()> + Send) {
    tokio::select! {
        () = probing => {}
        // An error means that the server is gone altogether.
        _ = stopping.wait_for(|stop| *stop) => {}
    }
}
