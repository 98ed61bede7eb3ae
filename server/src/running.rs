//! A server that runs: where it is, whether its parts run, and its stop in the opposite order of
//! the start.

use crate::{
    bus::Bus,
    identity::{Sessions, TokenId, local_token::LocalToken},
    publication::CatalogueTasks,
    ros2::Ros2,
    serving::Serving,
};
use engine::{
    intake::FrameJob,
    live::LiveHub,
    slots::Slots,
    snapshot::Snapshots,
    vitals::{Failure, Vitals},
    workers::Workers,
};
use protos::Name;
use std::{
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr},
    path::Path,
    sync::Arc,
    time::Instant,
};
use tokio::{sync::watch, task::JoinHandle};

/// A server at work. Dropping it leaves it running; call [`RunningServer::stop`].
#[derive(Debug)]
pub struct RunningServer {
    /// Where HTTP listens, with the real port.
    pub http_addr: SocketAddr,
    /// Where metrics are served without a token, if anywhere, with the real port.
    pub metrics_addr: Option<SocketAddr>,
    /// Where robots connect, with the real port.
    pub zenoh_endpoint: String,
    /// The server's name among those of a router.
    pub server: Name,
    /// Maps and robots as the workers see them.
    pub snapshots: Arc<Snapshots>,
    /// What robots are doing now.
    pub live: Arc<LiveHub>,
    /// Frames that wait, and the counters of all frames.
    pub slots: Arc<Slots<FrameJob>>,
    /// Robots of ROS 2.
    pub ros2: Arc<Ros2>,
    pub(crate) sessions: Arc<Sessions>,
    pub(crate) local_token: Arc<LocalToken>,
    /// The first name of the certificate, or else the address; `None` without TLS.
    pub(crate) tls_name: Option<String>,
    pub(crate) stop: watch::Sender<bool>,
    pub(crate) vitals: Arc<Vitals>,
    pub(crate) tasks: Tasks,
}

/// What must end, in this order.
#[derive(Debug)]
pub(crate) struct Tasks {
    pub(crate) workers: Workers,
    pub(crate) bus: Bus,
    pub(crate) serving: Serving,
    pub(crate) jobs: JoinHandle<()>,
    /// Of findings, stored answers and events.
    pub(crate) recorders: [JoinHandle<()>; 3],
    pub(crate) gather: JoinHandle<()>,
    /// Of the pictures and of the database.
    pub(crate) checks: [JoinHandle<()>; 2],
    pub(crate) disk: JoinHandle<()>,
    pub(crate) backups: JoinHandle<()>,
    pub(crate) writer: CatalogueTasks,
}

impl RunningServer {
    /// Which parts run.
    pub fn vitals(&self) -> &Arc<Vitals> {
        &self.vitals
    }

    /// File with an administrator's token for programs of this user on this machine, absolute.
    pub fn local_token_file(&self) -> &Path {
        self.local_token.path()
    }

    /// A link that opens the page as an administrator, once, within ten minutes. It is a secret.
    /// `None` if the system has no randomness for it.
    pub fn page_link(&self) -> Option<String> {
        let code = self.sessions.code(TokenId::Local, Instant::now()).ok()?;
        Some(format!("{}/open?code={code}", self.local_url()))
    }

    /// Address of the pages and of the HTTP interface for other machines; for this one where no
    /// other can reach it.
    pub fn url(&self) -> String {
        let Some(name) = &self.tls_name else { return self.local_url() };
        let name = if name.parse::<Ipv6Addr>().is_ok() { format!("[{name}]") } else { name.clone() };
        format!("https://{name}:{}", self.http_addr.port())
    }

    /// The same for this machine. With TLS, plain text is answered on loopback alone.
    fn local_url(&self) -> String {
        let mut at = self.http_addr;
        if at.ip().is_unspecified() {
            at.set_ip(IpAddr::V4(Ipv4Addr::LOCALHOST));
        }
        let is_plain = self.tls_name.is_none() || at.ip().to_canonical().is_loopback();
        format!("{}://{at}", if is_plain { "http" } else { "https" })
    }

    /// Returns when a part of the server has ended untold, with its name and the reason: stop, and
    /// start again from disk.
    pub async fn failed(&self) -> Failure {
        self.vitals.failed().await
    }

    /// Answers what is in work, then closes everything.
    pub async fn stop(self) {
        self.vitals.stop();
        self.local_token.remove();
        self.stop.send_replace(true);
        let Tasks { workers, bus, mut serving, jobs, recorders, gather, writer, .. } = self.tasks;
        let Tasks { checks, disk, backups, .. } = self.tasks;
        serving.unwatch().await;
        // Workers first: what they have in work is still answered over the open bus.
        let workers = tokio::task::spawn_blocking(move || workers.stop());
        if let Err(error) = workers.await {
            tracing::error!(%error, "worker_stop_failed");
        }
        self.ros2.close().await;
        bus.close().await;
        let ([findings, answers, events], [pictures, database]) = (recorders, checks);
        let others = [
            ("jobs", jobs),
            ("findings", findings),
            ("stored answers", answers),
            ("events", events),
            ("gathering", gather),
            ("the check of the pictures", pictures),
            ("the check of the database", database),
            ("the look at the disk", disk),
            ("the timetable of backups", backups),
        ];
        for (what, task) in serving.tasks().chain(others) {
            if let Err(error) = task.await {
                tracing::error!(%error, what, "task_panicked");
            }
        }
        writer.close().await;
    }
}
