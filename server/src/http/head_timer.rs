//! The deadlines for the heads of requests on one connection. hyper begins one before each request and ends it when the request
//! has come, mostly within a millisecond; so this timer sleeps once for many of them, and looks again when it wakes.

use hyper::rt::{Sleep, Timer};
use std::{
    pin::Pin,
    sync::{Arc, Mutex, PoisonError},
    task::{Context, Poll},
    time::{Duration, Instant},
};
use tokio::time;

/// Makes the deadlines of one connection, of which one at a time is waited for.
#[derive(Debug, Default)]
pub(super) struct HeadTimer {
    /// The one timer of tokio, set for the deadline that is waited for or for an earlier one.
    shared: Arc<Mutex<Option<Pin<Box<time::Sleep>>>>>,
}

impl Timer for HeadTimer {
    fn sleep(&self, duration: Duration) -> Pin<Box<dyn Sleep>> {
        self.sleep_until(Instant::now() + duration)
    }

    fn sleep_until(&self, deadline: Instant) -> Pin<Box<dyn Sleep>> {
        Box::pin(HeadSleep { shared: self.shared.clone(), deadline: deadline.into() })
    }

    fn now(&self) -> Instant {
        time::Instant::now().into()
    }
}

#[derive(Debug)]
struct HeadSleep {
    shared: Arc<Mutex<Option<Pin<Box<time::Sleep>>>>>,
    deadline: time::Instant,
}

impl Future for HeadSleep {
    type Output = ();

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
        let mut shared = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        let sleep = shared.get_or_insert_with(|| Box::pin(time::sleep_until(self.deadline)));
        if sleep.deadline() > self.deadline {
            sleep.as_mut().reset(self.deadline);
        }
        while sleep.as_mut().poll(context).is_ready() {
            if sleep.deadline() == self.deadline {
                *shared = None;
                return Poll::Ready(());
            }
            // It was still set for the head of an earlier request, which has come.
            sleep.as_mut().reset(self.deadline);
        }
        Poll::Pending
    }
}

impl Sleep for HeadSleep {}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn each_deadline_is_kept_whatever_was_waited_for_before() {
        let timer = HeadTimer::default();
        // What was waited for until the head had come, and the next deadline.
        for (earlier_ms, due_ms) in [(5, 30), (3_600_000, 20), (20, 20), (3_600_000, 1)] {
            let [earlier, due] = [earlier_ms, due_ms].map(Duration::from_millis);
            let head = time::timeout(Duration::from_millis(1), timer.sleep_until(Instant::now() + earlier));
            assert!(head.await.is_err());
            let asked = Instant::now();
            let waited = time::timeout(Duration::from_secs(20), timer.sleep_until(asked + due)).await;
            assert!(waited.is_ok(), "{due:?} after {earlier:?} never came");
            assert!(asked.elapsed() >= due, "{due:?} after {earlier:?} came early");
        }
    }
}
