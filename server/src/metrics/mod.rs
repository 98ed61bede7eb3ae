//! Metrics for Prometheus: what the counters of the server say at one time. In: the parts of the
//! server. Out: the text of `GET /metrics`. Nothing is counted here but requests; names begin with
//! `waymark_`, those of the process as exporters of Prometheus name them.

mod exposition;
pub(crate) mod http_times;
pub(crate) mod process;
mod robots;

use crate::{
    http::App,
    store::{StoreError, jobs, now_ms},
};
use engine::panics::Edge;
use exposition::Exposition;
pub(crate) use prometheus_client::encoding::prometheus_text::CONTENT_TYPE;
use prometheus_client::{
    collector::Collector,
    encoding::{DescriptorEncoder, prometheus_text},
    registry::Registry,
};
use std::{fmt, sync::Arc, time::Instant};

/// States of jobs that are not over.
const JOB_STATES: [&str; 2] = ["queued", "running"];

/// The metrics of a server. Errors: the database does not answer.
pub(crate) async fn text(app: &Arc<App>) -> Result<String, StoreError> {
    let mut open_jobs = Vec::with_capacity(JOB_STATES.len());
    for state in JOB_STATES {
        let filter = jobs::JobFilter { state: Some(state), ..jobs::JobFilter::default() };
        open_jobs.push((state, jobs::count(app.store.reads(), &filter).await?));
    }
    let scrape = Scrape { app: app.clone(), open_jobs };
    // What the system says of the process is read from files: off the runtime.
    let written = tokio::task::spawn_blocking(move || {
        let (mut registry, mut text) = (Registry::default(), String::new());
        registry.register_collector(Box::new(scrape));
        prometheus_text::encode(&mut text, &registry).ok();
        text
    });
    match written.await.map_err(tokio::task::JoinError::try_into_panic) {
        Ok(text) => Ok(text),
        Err(Ok(panic)) => std::panic::resume_unwind(panic),
        // The server stops.
        Err(Err(_cancelled)) => Ok(String::new()),
    }
}

/// What is written when it is asked for.
#[derive(Debug)]
struct Scrape {
    app: Arc<App>,
    open_jobs: Vec<(&'static str, u64)>,
}

impl Collector for Scrape {
    fn encode(&self, encoder: DescriptorEncoder<'_>) -> fmt::Result {
        let (all, app, now) = (&mut Exposition(encoder), &*self.app, Instant::now());
        let build =
            [("version", env!("CARGO_PKG_VERSION")), ("protocol", protos::keys::PROTOCOL), ("api", "v1")];
        all.gauge("waymark_build_info", "What runs here.").value(&build, 1_u32);
        robots::write_frames(all, app, now);
        robots::write_messages(all, app);
        robots::write_robots(all, app, now);
        robots::write_maps(all, app);
        write_parts(all, app);
        let mut jobs = all.gauge("waymark_jobs", "Jobs that wait and run.");
        for (state, count) in &self.open_jobs {
            jobs.value(&[("state", state)], *count);
        }
        write_backups(all, app);
        write_requests(all, app);
        process::write(all, &app.config.data);
        Ok(())
    }
}

fn write_parts(all: &mut Exposition<'_>, app: &App) {
    let vitals = app.store.vitals();
    let is_ready = vitals.failure().is_none() && vitals.stalled().is_none();
    all.gauge("waymark_ready", "1 while every part of the server runs and goes on.")
        .value(&[], u32::from(is_ready));
    let mut still = all.gauge(
        "waymark_part_still_seconds",
        "Time for which a part that has work, or is probed, has not gone on.",
    );
    for heart in vitals.hearts().all() {
        still.value(&[("part", heart.part())], heart.still().as_secs_f64());
    }
    let mut panics = all.counter("waymark_panics_total", "Caught faults of the program, by where.");
    for edge in Edge::ALL {
        panics.value(&[("edge", edge.name())], vitals.panics().at(edge));
    }
    let check = app.store.last_check().get();
    let faults = check.ended_ms().map(|_| check.faults().len());
    all.gauge(
        "waymark_database_faults",
        "Faults that the check of the database after the start found, at most 20; absent while it runs.",
    )
    .known(&[], faults);
    let queue = app.store.queue();
    all.gauge("waymark_writes_waiting", "Writes that wait for the writer.").value(&[], queue.waiting);
    all.gauge("waymark_write_wait_seconds", "Time that the last probe of the writer waited in its queue.")
        .value(&[], queue.last_wait.as_secs_f64());
    all.counter("waymark_commits_total", "Committed transactions.").value(&[], app.store.commits());
    let outbox = app.publisher.as_ref().map(|publisher| publisher.outbox());
    all.counter(
        "waymark_messages_dropped_total",
        "Messages to robots that were dropped: their queue was full.",
    )
    .known(&[], outbox.map(crate::bus::Outbox::dropped));
    all.gauge("waymark_messages_waiting", "Messages to robots that wait to be sent.")
        .known(&[], outbox.map(crate::bus::Outbox::waiting));
}

fn write_backups(all: &mut Exposition<'_>, app: &App) {
    let health = app.backups.health();
    let age = health.newest_ms.map(|made| (now_ms() - made).max(0) as f64 / 1e3);
    all.gauge("waymark_backup_age_seconds", "Age of the newest complete backup; absent without one.")
        .known(&[], age);
    all.gauge("waymark_backup_interval_seconds", "Time between scheduled backups; 0: none is scheduled.")
        .value(&[], u64::from(health.every_hours) * 3600);
    all.gauge("waymark_backup_failed", "1 if the last backup failed.")
        .value(&[], u32::from(health.failed.is_some()));
}

fn write_requests(all: &mut Exposition<'_>, app: &App) {
    let mut counts = all.counter("waymark_http_requests_total", "Requests by method, route and status.");
    for ((method, route, status), count) in app.http_times.counts() {
        let status = status.to_string();
        counts.value(&[("method", method), ("route", &route), ("status", &status)], count);
    }
    let mut times = all.histogram("waymark_http_request_duration_seconds", "Time of requests by route.");
    for (route, copy) in app.http_times.times() {
        times.times(&[("route", &route)], &copy);
    }
}
