//! The server as a process of its own, and what the kernel says of a process: processor time,
//! memory, threads, files.

use anyhow::Context as _;
use std::{
    path::Path,
    process::Stdio,
    time::{Duration, Instant},
};
use tokio::{
    io::{AsyncBufReadExt as _, BufReader},
    process::{Child, Command},
    sync::oneshot,
    task::JoinHandle,
};

/// Time between two looks at the server.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// Longest time for the server to start.
const START: Duration = Duration::from_mins(1);
/// Clock ticks of `/proc/PID/stat` a second (`man 5 proc_pid_stat`): 100 on every Linux of today.
const TICKS_PER_S: f64 = 100.0;

/// `waymark serve` with encryption.
pub(super) struct ServerChild {
    child: Child,
    /// For programs on this machine.
    pub(super) url: String,
    /// Where robots connect.
    pub(super) zenoh: String,
}

impl ServerChild {
    /// Starts it on free ports, and waits until it says that it is ready.
    pub(super) async fn start(
        program: &Path,
        data: &Path,
        settings: &[(&str, String)],
    ) -> anyhow::Result<Self> {
        let mut child = Command::new(program)
            .envs(settings.iter().map(|(name, value)| (*name, value)))
            .args(["serve", "--tls", "--http", "127.0.0.1:0", "--zenoh", "tls/127.0.0.1:0", "--data"])
            .arg(data)
            .stdout(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .with_context(|| {
                format!("{} does not start: build it with `cargo build --release -p cli`", program.display())
            })?;
        let mut lines = BufReader::new(child.stdout.take().context("its output")?).lines();
        let ready = async {
            let (mut url, mut zenoh) = (None, None);
            while let (None, _) | (_, None) = (&url, &zenoh) {
                let line = lines.next_line().await?.context("the server ended before it was ready")?;
                let after = |label: &str| line.strip_prefix(label).map(|rest| rest.trim().to_owned());
                url = url.or(after("pages"));
                zenoh = zenoh.or(after("robots"));
            }
            anyhow::Ok(url.zip(zenoh))
        };
        let (url, zenoh) = tokio::time::timeout(START, ready).await??.context("two addresses")?;
        let port = url.trim_end_matches('/').rsplit(':').next().context("a port")?;
        // The server must not wait for who reads what it says.
        let url = format!("http://127.0.0.1:{port}");
        tokio::spawn(async move { while let Ok(Some(_)) = lines.next_line().await {} });
        Ok(Self { child, url, zenoh })
    }

    pub(super) fn id(&self) -> u32 {
        self.child.id().unwrap_or_default()
    }

    pub(super) async fn stop(mut self) -> anyhow::Result<()> {
        Ok(self.child.kill().await?)
    }
}

/// What a process uses.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Usage {
    /// Since the watch began, s.
    pub(super) at_s: f64,
    /// Processor time, s.
    pub(super) processor_s: f64,
    pub(super) rss_mb: f64,
    pub(super) threads: usize,
    pub(super) files: usize,
}

/// Of the process now. `None`: it has ended, or there is no `/proc`.
pub(super) fn usage(process: u32) -> Option<Usage> {
    let at = |file: &str| std::fs::read_to_string(format!("/proc/{process}/{file}")).ok();
    let (stat, status) = (at("stat")?, at("status")?);
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |index: usize| fields.get(index)?.parse::<f64>().ok();
    let of = |label: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(label))?;
        line.split_whitespace().next()?.parse::<f64>().ok()
    };
    Some(Usage {
        at_s: 0.0,
        processor_s: (ticks(11)? + ticks(12)?) / TICKS_PER_S,
        rss_mb: of("VmRSS:")? / 1024.0,
        threads: of("Threads:")? as usize,
        files: std::fs::read_dir(format!("/proc/{process}/fd")).ok()?.count(),
    })
}

/// Looks at a process once a second.
pub(super) struct Watch {
    ended: oneshot::Sender<()>,
    looks: JoinHandle<Vec<Usage>>,
}

impl Watch {
    pub(super) fn begin(process: u32) -> Self {
        let (ended, mut end) = oneshot::channel();
        let looks = tokio::spawn(async move {
            let started = Instant::now();
            let mut looks = Vec::new();
            loop {
                let at_s = started.elapsed().as_secs_f64();
                looks.extend(usage(process).map(|usage| Usage { at_s, ..usage }));
                tokio::select! {
                    _ = &mut end => return looks,
                    () = tokio::time::sleep(LOOK_EVERY) => {}
                }
            }
        });
        Self { ended, looks }
    }

    pub(super) async fn end(self) -> Vec<Usage> {
        // An error means that it has ended already.
        self.ended.send(()).ok();
        self.looks.await.unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_kernel_tells_what_this_process_uses() {
        let usage = super::usage(std::process::id()).unwrap();
        assert!(usage.rss_mb > 1.0 && usage.threads >= 1 && usage.files >= 3, "{usage:?}");
        assert_eq!(super::usage(u32::MAX), None);
    }
}
