//! Threads by what they work for. In: a class and work. Out: a thread whose priority is that of its
//! class, so that the processor goes to robots first.
//!
//! 1. [`Class::Answers`]: frames, scans and what is sent to robots.
//! 2. [`Class::Requests`]: what a person or a robot asked for without a deadline.
//! 3. [`Class::Background`]: lessons, mapping, gathering and what is derived from maps.
//!
//! On Linux the niceness of a thread is its own (`man 2 setpriority`, "C library/kernel
//! differences"), and a thread may always lower its priority. It cannot raise it again, so such
//! work never runs on threads that others take over, like those of the runtime. A thread inherits
//! the niceness of the one that starts it: [`wait_for`] gives asynchronous work back to the
//! runtime, so that no thread of a pool is begun by a thread of low priority. Elsewhere than on
//! Linux all classes have one priority.

use std::{
    any::Any,
    io,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        LazyLock,
        atomic::{AtomicU64, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};
use tokio::{runtime::Handle, sync::oneshot};

/// Robots are being served while a frame was answered so recently.
pub const SERVING: Duration = Duration::from_secs(2);

/// Whom a thread works for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// Robots that wait for an answer.
    Answers,
    /// People, and robots that ask without a deadline.
    Requests,
    /// Nobody who waits.
    Background,
}

impl Class {
    /// What is added to the niceness of the process. A step of 5 is a third of the processor time
    /// where both have work; 10 leaves background work a tenth, so that it comes to an end beside
    /// other programs, too.
    pub const fn niceness(self) -> i32 {
        match self {
            Self::Answers => 0,
            Self::Requests => 5,
            Self::Background => 10,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Answers => "answers",
            Self::Requests => "request",
            Self::Background => "background",
        }
    }
}

/// Why work on a thread of its own gave nothing.
#[derive(Debug)]
pub enum Lost {
    /// It panicked.
    Panicked(Box<dyn Any + Send>),
    /// The system gives no thread.
    NoThread(io::Error),
}

impl std::fmt::Display for Lost {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Panicked(cause) => write!(f, "it panicked: {}", panic_text(cause.as_ref())),
            Self::NoThread(error) => write!(f, "no thread for it: {error}"),
        }
    }
}

impl std::error::Error for Lost {}

/// The message of a panic.
pub(crate) fn panic_text(cause: &(dyn Any + Send)) -> &str {
    let literal = cause.downcast_ref::<&'static str>().copied();
    literal.or_else(|| cause.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}

/// Starts a thread of a class.
pub fn spawn<T: Send + 'static>(
    class: Class,
    name: impl Into<String>,
    work: impl FnOnce() -> T + Send + 'static,
) -> io::Result<JoinHandle<T>> {
    std::thread::Builder::new().name(name.into()).spawn(move || {
        lower(class);
        work()
    })
}

/// Runs work on a thread of its own, and waits for it without holding up the runtime. The work goes
/// on where nobody waits any more.
pub async fn run<T: Send + 'static>(
    class: Class,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Lost> {
    let (done, result) = oneshot::channel();
    let runtime = Handle::try_current().ok();
    let thread = move || {
        let _context = runtime.as_ref().map(Handle::enter);
        // An error means that nobody waits any more.
        drop(done.send(catch_unwind(AssertUnwindSafe(work))));
    };
    spawn(class, class.name(), thread).map_err(Lost::NoThread)?;
    match result.await {
        Ok(done) => done.map_err(Lost::Panicked),
        Err(closed) => Err(Lost::NoThread(io::Error::other(closed))),
    }
}

/// Waits on a thread of [`run`] for asynchronous work, which is done by the runtime's own threads.
/// `None`: it panicked, or the runtime has ended.
pub fn wait_for<T: Send + 'static>(
    runtime: &Handle,
    work: impl Future<Output = T> + Send + 'static,
) -> Option<T> {
    let (done, result) = oneshot::channel();
    runtime.spawn(async move { drop(done.send(work.await)) });
    result.blocking_recv().ok()
}

/// Gives the calling thread the priority of a class for good.
fn lower(class: Class) {
    if class.niceness() == 0 {
        return;
    }
    #[cfg(target_os = "linux")]
    {
        // Of the calling thread alone: who = 0.
        let set = rustix::process::getpriority_process(None).and_then(|of_process| {
            rustix::process::setpriority_process(None, (of_process + class.niceness()).min(19))
        });
        if let Err(error) = set {
            tracing::warn!(%error, ?class, follows = "its work competes with frames", "priority_not_set");
        }
    }
}

/// Milliseconds from the start of the process to the last frame that was answered, plus 1; 0 before
/// the first.
static LAST_FRAME_MS: AtomicU64 = AtomicU64::new(0);
static STARTED: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Notes that a frame was answered.
pub(crate) fn note_frame(now: Instant) {
    let ms = now.saturating_duration_since(*STARTED).as_millis() as u64;
    LAST_FRAME_MS.fetch_max(ms + 1, Ordering::Relaxed);
}

/// Whether a frame was answered within [`SERVING`]. While that is so, lessons leave half of the
/// threads that they may have to robots.
pub fn robots_are_served(now: Instant) -> bool {
    let ms = now.saturating_duration_since(*STARTED).as_millis() as u64;
    match LAST_FRAME_MS.load(Ordering::Relaxed) {
        0 => false,
        last => ms < last + SERVING.as_millis() as u64,
    }
}

/// How many of `threads` background work uses while robots are served.
pub fn beside_robots(threads: usize) -> usize {
    threads.div_ceil(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Niceness of the calling thread, as the kernel says (`man 5 proc_pid_stat`, field 19).
    #[cfg(target_os = "linux")]
    fn niceness() -> i32 {
        let stat = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
        let after_name = stat.rsplit_once(')').unwrap().1;
        after_name.split_whitespace().nth(16).unwrap().parse().unwrap()
    }

    #[cfg(target_os = "linux")]
    #[tokio::test]
    async fn each_class_has_its_own_priority_and_changes_no_other_thread() {
        let own = niceness();
        for class in [Class::Background, Class::Answers, Class::Requests] {
            let expected = (own + class.niceness()).min(19);
            assert_eq!(run(class, niceness).await.unwrap(), expected, "{class:?}");
            assert_eq!(spawn(class, "test", niceness).unwrap().join().unwrap(), expected, "{class:?}");
            assert_eq!(niceness(), own, "the thread that started it");
            assert_eq!(tokio::task::spawn_blocking(niceness).await.unwrap(), own, "a thread of the pool");
        }
        assert!(Class::Requests.niceness() > Class::Answers.niceness());
        assert!(Class::Background.niceness() > Class::Requests.niceness());
    }

    #[cfg(target_os = "linux")]
    #[tokio::test(flavor = "multi_thread")]
    async fn asynchronous_work_of_a_background_thread_starts_no_slow_thread() {
        let own = niceness();
        let runtime = Handle::current();
        let read = run(Class::Background, move || {
            wait_for(&runtime, async { tokio::task::spawn_blocking(niceness).await.unwrap() })
        });
        assert_eq!(read.await.unwrap(), Some(own));
    }

    #[tokio::test]
    async fn a_panic_is_given_to_who_waits() {
        let lost = run(Class::Requests, || panic!("planted")).await.map(|(): ()| ());
        assert!(lost.unwrap_err().to_string().contains("planted"));
    }

    #[test]
    fn robots_are_served_for_a_while_after_a_frame() {
        let now = Instant::now() + Duration::from_hours(1);
        note_frame(now);
        assert!(robots_are_served(now) && robots_are_served(now + SERVING / 2));
        assert!(!robots_are_served(now + SERVING + Duration::from_millis(1)));
        assert_eq!([1, 2, 3, 8].map(beside_robots), [1, 1, 2, 4]);
    }
}
