//! Tells the supervisor of the process how it is: the datagrams of `sd_notify(3)` to the socket
//! that systemd names. In: states and the parts of a server. Out: `READY=1`, `STOPPING=1`, and
//! `WATCHDOG=1` for as long as every part goes on.

use engine::vitals::Vitals;
use std::{
    convert::Infallible,
    ffi::{OsStr, OsString},
    time::Duration,
};

/// Most of the time between two signs of life, if the supervisor asks for none.
const NO_WATCHDOG: Duration = Duration::from_hours(1);

/// Who started this process, if it wants to know.
#[derive(Debug)]
pub(crate) struct Supervisor {
    socket: Option<OsString>,
    /// It ends a process that gives no sign of life for so long.
    watchdog: Option<Duration>,
}

impl Supervisor {
    /// As systemd's variables say. Without them nobody is told anything.
    pub(crate) fn of_environment() -> Self {
        let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
        let is_other = number("WATCHDOG_PID").is_some_and(|pid| pid != u64::from(std::process::id()));
        let watchdog = number("WATCHDOG_USEC").filter(|us| *us > 0 && !is_other);
        Self { socket: std::env::var_os("NOTIFY_SOCKET"), watchdog: watchdog.map(Duration::from_micros) }
    }

    /// Sends a state. A supervisor that cannot be reached is in the log, and changes nothing.
    pub(crate) fn tell(&self, state: &str) {
        let Some(socket) = &self.socket else { return };
        if let Err(error) = send(socket, state) {
            tracing::warn!(%error, state, "supervisor_not_told");
        }
    }

    /// Gives signs of life while every part of the server runs and goes on. They come from the
    /// runtime that serves: one that is stuck gives none.
    pub(crate) async fn keep_alive(&self, vitals: &Vitals) -> Infallible {
        let every = self.watchdog.map_or(NO_WATCHDOG, |limit| limit / 3);
        loop {
            if self.watchdog.is_some() && vitals.failure().is_none() && vitals.stalled().is_none() {
                self.tell("WATCHDOG=1");
            }
            tokio::time::sleep(every).await;
        }
    }
}

#[cfg(target_os = "linux")]
fn send(socket: &OsStr, state: &str) -> std::io::Result<()> {
    use std::os::{
        linux::net::SocketAddrExt as _,
        unix::{
            ffi::OsStrExt as _,
            net::{SocketAddr, UnixDatagram},
        },
    };
    let address = match socket.as_bytes() {
        [b'@', name @ ..] => SocketAddr::from_abstract_name(name)?,
        _ => SocketAddr::from_pathname(socket)?,
    };
    UnixDatagram::unbound()?.send_to_addr(state.as_bytes(), &address).map(drop)
}

#[cfg(not(target_os = "linux"))]
fn send(_socket: &OsStr, _state: &str) -> std::io::Result<()> {
    Ok(())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use engine::heartbeats::STALLED;
    use std::{os::unix::net::UnixDatagram, sync::Arc};

    fn heard(socket: &UnixDatagram) -> Option<String> {
        let mut bytes = [0; 64];
        let length = socket.recv(&mut bytes).ok()?;
        Some(String::from_utf8_lossy(&bytes[..length]).into_owned())
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn signs_of_life_end_with_a_part_that_stands_still() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let socket = UnixDatagram::bind(&path).unwrap();
        socket.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        let watchdog = Some(Duration::from_millis(30));
        let supervisor = Supervisor { socket: Some(path.into()), watchdog };
        supervisor.tell("READY=1");
        assert_eq!(heard(&socket).as_deref(), Some("READY=1"));
        let vitals = Arc::new(Vitals::default());
        let asked = vitals.clone();
        let keeping = tokio::spawn(async move { supervisor.keep_alive(&asked).await });
        assert_eq!(heard(&socket).as_deref(), Some("WATCHDOG=1"));
        let heart = vitals.hearts().begin("a planted part");
        heart.beat();
        for _ in 0..=STALLED.as_secs() + 1 {
            vitals.hearts().tick(Duration::from_secs(1));
        }
        // What was sent before may still be there.
        socket.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
        let after: Vec<_> = std::iter::from_fn(|| heard(&socket)).take(1000).collect();
        assert!(after.len() < 1000, "it goes on");
        keeping.abort();
    }

    #[test]
    fn without_a_supervisor_nothing_is_sent() {
        Supervisor { socket: None, watchdog: None }.tell("READY=1");
        assert!(send(OsStr::new("/nowhere/notify"), "READY=1").is_err());
    }
}
