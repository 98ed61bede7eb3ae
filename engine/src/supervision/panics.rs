//! Caught panics, counted by the edge that caught them. An edge is where work of one kind begins: a
//! frame, a write, a message, a request. A panic ends that piece of work; the process and all other
//! work go on.

use super::threads::{Lost, panic_text};
use std::{
    any::Any,
    fmt::Display,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::atomic::{AtomicU64, Ordering},
};
use tokio::task::JoinError;

/// Where a panic was caught.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(usize)]
pub enum Edge {
    /// A write inside its transaction.
    Write,
    /// A snapshot made after a commit or at the start.
    Publication,
    /// A frame on a worker thread.
    Frame,
    /// A scan on the laser's thread.
    Scan,
    /// A mapping.
    Mapping,
    /// A message or a query of a robot, on zenoh's thread.
    Message,
    /// A message to a robot, on the thread that sends.
    Delivery,
    /// A request over HTTP, or vision work asked for by one.
    Request,
    /// A job.
    Job,
    /// A frame of a robot that gathers views.
    Gathering,
}

impl Edge {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Write,
        Self::Publication,
        Self::Frame,
        Self::Scan,
        Self::Mapping,
        Self::Message,
        Self::Delivery,
        Self::Request,
        Self::Job,
        Self::Gathering,
    ];

    /// Its name in logs and answers.
    pub fn name(self) -> &'static str {
        match self {
            Self::Write => "write",
            Self::Publication => "publication",
            Self::Frame => "frame",
            Self::Scan => "scan",
            Self::Mapping => "mapping",
            Self::Message => "message",
            Self::Delivery => "delivery",
            Self::Request => "request",
            Self::Job => "job",
            Self::Gathering => "gathering",
        }
    }
}

/// Counters of all edges; each must stay 0.
#[derive(Debug, Default)]
pub struct Panics([AtomicU64; Edge::ALL.len()]);

impl Panics {
    /// Counts and logs a caught panic. `what` names the work, `follows` says what becomes of it.
    pub fn caught(&self, edge: Edge, cause: &(dyn Any + Send), what: impl Display, follows: &str) {
        self.0[edge as usize].fetch_add(1, Ordering::Relaxed);
        tracing::error!(edge = edge.name(), panic = panic_text(cause), %what, follows, "panic_caught");
    }

    /// Runs `work`. After a panic, which is counted and logged, the result is `None`.
    pub fn catch<T>(
        &self,
        edge: Edge,
        what: impl Display,
        follows: &str,
        work: impl FnOnce() -> T,
    ) -> Option<T> {
        // Unwind safety: shared state behind an edge is changed in single steps under a lock, or
        // replaced as a whole.
        catch_unwind(AssertUnwindSafe(work))
            .inspect_err(|cause| self.caught(edge, cause.as_ref(), what, follows))
            .ok()
    }

    /// The result of a task that ran elsewhere. A panic is counted and logged, and is the error.
    pub fn joined<T>(
        &self,
        edge: Edge,
        what: impl Display,
        follows: &str,
        joined: Result<T, JoinError>,
    ) -> Result<T, Ended> {
        joined.map_err(|error| match error.try_into_panic() {
            Ok(cause) => {
                self.caught(edge, cause.as_ref(), what, follows);
                Ended("it panicked; see the server's log")
            }
            Err(_cancelled) => Ended("it was given up: the server stops"),
        })
    }

    /// The same of work on a thread of its own.
    pub fn ended<T>(
        &self,
        edge: Edge,
        what: impl Display,
        follows: &str,
        done: Result<T, Lost>,
    ) -> Result<T, Ended> {
        done.map_err(|lost| match lost {
            Lost::Panicked(cause) => {
                self.caught(edge, cause.as_ref(), what, follows);
                Ended("it panicked; see the server's log")
            }
            Lost::NoThread(error) => {
                tracing::error!(edge = edge.name(), %error, %what, follows, "no_thread");
                Ended("the system gave no thread for it")
            }
        })
    }

    /// Panics caught at one edge.
    pub fn at(&self, edge: Edge) -> u64 {
        self.0[edge as usize].load(Ordering::Relaxed)
    }

    /// Panics caught at all edges.
    pub fn total(&self) -> u64 {
        Edge::ALL.into_iter().map(|edge| self.at(edge)).sum()
    }
}

/// Why a task has no result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Ended(&'static str);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panics_are_counted_by_edge() {
        let panics = Panics::default();
        let (zero, message) = (0, String::from("planted"));
        let divided = panics.catch(Edge::Scan, "a scan", "it is dropped", || 7 / std::hint::black_box(zero));
        assert_eq!(divided, None);
        assert_eq!(panics.catch(Edge::Write, "a write", "nothing", || panic!("{message}")), None::<()>);
        assert_eq!(panics.catch(Edge::Write, "a write", "nothing", || 3), Some(3));
        assert_eq!((panics.at(Edge::Scan), panics.at(Edge::Write), panics.total()), (1, 1, 2));
        for (index, edge) in Edge::ALL.into_iter().enumerate() {
            assert_eq!(edge as usize, index, "{}", edge.name());
        }
    }
}
