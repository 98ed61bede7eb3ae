//! The router that robots on other machines meet behind the front: it knows each by its name, and
//! has access control. Behind it is the server's own router, over a socket of this process.
//!
//! Access control is read when a session opens. So when robots or their maps change what robots
//! may, the gate closes and opens again: robots connect again by themselves, and the server's own
//! router, its subscriptions and its other robots stay. A certificate that is revoked or expires
//! changes nothing here: the front ends that robot's connections ([`super::front::Admission`]).

use super::{
    BusError,
    access::Policy,
    front::Admission,
    router::{self, RouterSettings, RouterTls},
};
use crate::{
    config::Ros2Robot,
    identity::certificates::{CertificateRegistry, Certificates, LinkCertificates, ServerCertificate},
};
use engine::{snapshot::Snapshots, vitals::Pulse};
use protos::{Key, Keys, Name};
use std::{
    net::{Ipv4Addr, SocketAddr, UdpSocket},
    sync::Arc,
    time::Duration,
};
use tokio::{sync::watch, task::JoinHandle, time::Instant};

/// Changes so close together are one.
const GATHER: Duration = Duration::from_millis(20);
/// How often it is looked whether messages still pass to the server's own router.
const LOOK_EVERY: Duration = Duration::from_secs(10);
/// Time between closing a gate and opening the next. zenoh computes its trees of routers at most
/// every 100 ms, and tells what is declared to routers whose index in them is new. A gate that
/// joined earlier would take the index of the closed one, and be told of no subscription.
const BEFORE_REOPENING: Duration = Duration::from_millis(250);
/// Wait of the first attempt until the two routers know of each other. While the server runs, each
/// further attempt waits twice as long, at most [`LONGEST_JOIN`]; the second and last one of a
/// start waits that long.
const FIRST_JOIN: Duration = Duration::from_secs(2);
/// Longest wait until the two routers know of each other.
const LONGEST_JOIN: Duration = Duration::from_secs(10);
/// Between two questions whether they do.
const ASK_EVERY: Duration = Duration::from_millis(20);
/// Who asks that: no robot's certificate is needed.
const ASKS: &str = "gate";

/// What a gate rests on.
pub(super) struct GateSettings {
    /// Where the server's own router listens for it.
    pub(super) inner: String,
    pub(super) link: Arc<LinkCertificates>,
    pub(super) keys: Keys,
    pub(super) certificates: Arc<Certificates>,
    pub(super) registry: Arc<CertificateRegistry>,
    pub(super) admission: Arc<Admission>,
    pub(super) snapshots: Arc<Snapshots>,
    pub(super) ros2: Vec<Ros2Robot>,
    pub(super) robots: usize,
    pub(super) frame_bytes: usize,
    /// Told where the gate listens, or that it does not now.
    pub(super) listens: watch::Sender<Option<SocketAddr>>,
}

/// What tells the gate that robots may do something else, and that the server shows another
/// certificate.
type ChangeSignals = (watch::Receiver<u64>, watch::Receiver<Arc<ServerCertificate>>);

/// The gate at work.
pub(super) struct Gate {
    task: JoinHandle<()>,
    stop: watch::Sender<bool>,
}

impl GateSettings {
    fn policy(&self) -> Policy {
        let by_name = !self.certificates.enrols_robots();
        Policy::new(&self.registry.holders(), &self.snapshots, &self.ros2, by_name)
    }

    async fn open(&self, policy: &Policy, join: Duration) -> Result<zenoh::Session, BusError> {
        let at = free_port().map_err(|e| BusError::Listen {
            endpoint: format!("quic/{}:0", Ipv4Addr::LOCALHOST),
            detail: e.to_string(),
        })?;
        let settings = RouterSettings {
            listen: vec![format!("quic/{at}")],
            connect: Some(&self.inner),
            tls: Some(RouterTls {
                authorities: self.link.authority_pem(),
                listener: (&self.link.listener.0, &self.link.listener.1),
            }),
            access: Some(policy.access_control_of_gate(&self.keys)),
            robots: self.robots,
            frame_bytes: self.frame_bytes,
        };
        let session = router::open(&settings).await?;
        if self.join(&session, join).await {
            self.listens.send_replace(Some(at));
            return Ok(session);
        }
        // Robots would be linked, and never heard.
        close(&session).await;
        let detail = "the router of robots and the server's own do not reach each other".to_owned();
        Err(BusError::Listen { endpoint: self.inner.clone(), detail })
    }

    /// Waits until messages pass to the server's own router: earlier ones would be lost. False if
    /// they do not.
    async fn join(&self, session: &zenoh::Session, within: Duration) -> bool {
        let Ok(robot) = Name::new(ASKS) else { return false };
        let (key, until) = (self.keys.build(&Key::Hello(robot)), Instant::now() + within);
        while Instant::now() < until {
            if let Ok(replies) = session.get(&key).timeout(ASK_EVERY * 10).await
                && replies.recv_async().await.is_ok_and(|reply| reply.result().is_ok())
            {
                return true;
            }
            tokio::time::sleep(ASK_EVERY).await;
        }
        false
    }
}

/// A free port of UDP on loopback: zenoh does not say which one it took.
fn free_port() -> std::io::Result<SocketAddr> {
    UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()
}

impl Gate {
    /// Opens the gate, and keeps it after what robots may.
    pub(super) async fn open(settings: GateSettings, pulse: Pulse) -> Result<Self, BusError> {
        // Before anything is read: a change after that is seen, however late the task begins.
        let mut news = (settings.registry.changes(), settings.certificates.current());
        let change = *news.0.borrow_and_update();
        let policy = settings.policy();
        let session = match settings.open(&policy, FIRST_JOIN).await {
            Ok(session) => session,
            Err(error) => {
                tracing::warn!(%error, follows = "it is tried once more", "gate_not_open");
                tokio::time::sleep(BEFORE_REOPENING).await;
                settings.open(&policy, LONGEST_JOIN).await?
            }
        };
        settings.registry.set_applied(change);
        let (stop, stopping) = watch::channel(false);
        let task = tokio::spawn(keep(settings, policy, session, news, stopping, pulse));
        Ok(Self { task, stop })
    }

    pub(super) async fn close(self) {
        self.stop.send_replace(true);
        if let Err(error) = self.task.await {
            tracing::error!(%error, "gate_panicked");
        }
    }
}

/// Why a gate looks at what it rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ReopenReason {
    /// Robots may do something else.
    Rights,
    /// The server shows another certificate.
    Certificate,
    /// Time has passed.
    Interval,
}

async fn keep(
    settings: GateSettings,
    mut policy: Policy,
    mut session: zenoh::Session,
    (mut changes, mut shown): ChangeSignals,
    mut stopping: watch::Receiver<bool>,
    pulse: Pulse,
) {
    loop {
        let why = tokio::select! {
            _ = stopping.wait_for(|stop| *stop) => break,
            Ok(()) = changes.changed() => ReopenReason::Rights,
            Ok(()) = shown.changed() => ReopenReason::Certificate,
            () = tokio::time::sleep(LOOK_EVERY) => ReopenReason::Interval,
        };
        tokio::time::sleep(GATHER).await;
        if why == ReopenReason::Certificate {
            settings.admission.renew();
        }
        // A robot would be linked, and told that it is not admitted.
        let is_cut_off = why == ReopenReason::Interval
            && tokio::select! {
                _ = stopping.wait_for(|stop| *stop) => break,
                is_joined = settings.join(&session, LONGEST_JOIN) => !is_joined,
            };
        if is_cut_off {
            tracing::error!(follows = "it opens again", "gate_cut_off");
        }
        let change = *changes.borrow_and_update();
        let wanted = settings.policy();
        if wanted == policy && !is_cut_off {
            settings.registry.set_applied(change);
            continue;
        }
        settings.listens.send_replace(None);
        close(&session).await;
        let opened = tokio::select! {
            _ = stopping.wait_for(|stop| *stop) => break,
            opened = reopened(&settings, &wanted) => opened,
        };
        (session, policy) = (opened, wanted);
        settings.registry.set_applied(change);
        tracing::info!(follows = "robots connect again", "access_changed");
    }
    close(&session).await;
    pulse.end();
}

/// Tries until it is open, after another was closed.
async fn reopened(settings: &GateSettings, policy: &Policy) -> zenoh::Session {
    let mut join = FIRST_JOIN;
    loop {
        tokio::time::sleep(BEFORE_REOPENING).await;
        match settings.open(policy, join).await {
            Ok(session) => return session,
            Err(error) => tracing::error!(%error, follows = "it is tried again", "gate_not_open"),
        }
        join = LONGEST_JOIN.min(join * 2);
    }
}

async fn close(session: &zenoh::Session) {
    if let Err(error) = session.close().await {
        tracing::warn!(%error, "zenoh_close_failed");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A router as the gate is, but for its certificates.
    async fn joined(listen: &str, connect: Option<&str>) -> zenoh::Session {
        let listen = vec![listen.to_owned()];
        let settings =
            RouterSettings { listen, connect, tls: None, access: None, robots: 4, frame_bytes: 1000 };
        router::open(&settings).await.expect("a router")
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_gate_that_follows_a_closed_one_is_told_what_the_server_declares() {
        let folder = tempfile::tempdir().unwrap();
        let endpoint = |name: &str| format!("unixsock-stream/{}", folder.path().join(name).display());
        let (inner, gate) = (endpoint("inner"), endpoint("gate"));
        let server = joined(&inner, None).await;
        let answer = |query: zenoh::query::Query| {
            zenoh::Wait::wait(query.reply(query.key_expr().clone(), "")).unwrap();
        };
        let _answers = server.declare_queryable("gate/hello").callback(answer).await.unwrap();
        for opened in 0..6 {
            let session = joined(&gate, Some(&inner)).await;
            let until = Instant::now() + LONGEST_JOIN;
            let is_answered = async || {
                let replies = session.get("gate/hello").timeout(ASK_EVERY * 10).await.unwrap();
                replies.recv_async().await.is_ok_and(|reply| reply.result().is_ok())
            };
            while !is_answered().await {
                assert!(Instant::now() < until, "gate {opened} reaches no queryable");
                tokio::time::sleep(ASK_EVERY).await;
            }
            close(&session).await;
            tokio::time::sleep(BEFORE_REOPENING).await;
        }
    }
}
