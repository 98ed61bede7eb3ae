//! How fast a connection may send. In: what each batch costs. Out: a wait, after which the rate
//! holds; the robot's own queue fills meanwhile, and nothing is lost here.

use super::inspection::Cost;
use std::time::Duration;
use tokio::time::Instant;

/// What passes at once, and what passes in each second after that.
#[derive(Debug, Clone, Copy)]
struct Rate {
    at_once: f64,
    per_s: f64,
}

/// A router of ROS 2 declares some hundreds as it connects.
const DECLARATIONS: Rate = Rate { at_once: 1024.0, per_s: 200.0 };
/// Frames, odometry and scans of several robots behind one router.
const MESSAGES: Rate = Rate { at_once: 10_000.0, per_s: 5_000.0 };
/// Colour frames that are not compressed, and more than a link of a gigabit.
const BYTES: Rate = Rate { at_once: 256e6, per_s: 200e6 };

/// Longest wait before one batch: the router takes a link that is silent for two seconds for dead.
const LONGEST: Duration = Duration::from_secs(1);

/// What may pass now, in the order of the rates above.
#[derive(Debug)]
pub(super) struct Pace {
    left: [f64; 3],
    at: Instant,
}

const RATES: [Rate; 3] = [DECLARATIONS, MESSAGES, BYTES];

impl Pace {
    pub(super) fn new() -> Self {
        Self { left: RATES.map(|rate| rate.at_once), at: Instant::now() }
    }

    /// Waits until a batch of `bytes` may pass.
    pub(super) async fn keep(&mut self, cost: Cost, bytes: usize) {
        let wait = self.wait(cost, bytes, Instant::now());
        if !wait.is_zero() {
            tokio::time::sleep(wait).await;
        }
    }

    fn wait(&mut self, cost: Cost, bytes: usize, now: Instant) -> Duration {
        let passed = now.saturating_duration_since(self.at).as_secs_f64();
        self.at = now;
        let spent = [cost.declarations as f64, cost.messages as f64, bytes as f64];
        let mut longest = 0.0_f64;
        for ((left, rate), spent) in self.left.iter_mut().zip(RATES).zip(spent) {
            *left = (*left + passed * rate.per_s).min(rate.at_once) - spent;
            longest = longest.max(-*left / rate.per_s);
        }
        Duration::from_secs_f64(longest).min(LONGEST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_passes_and_what_follows_waits_for_its_rate() {
        let mut pace = Pace::new();
        let start = pace.at;
        let declarations = |n| Cost { declarations: n, messages: 0 };
        assert!(pace.wait(declarations(1024), 0, start).is_zero());
        assert_eq!(pace.wait(declarations(100), 0, start), Duration::from_millis(500));
        // What was waited for has come back, and no more than that.
        let later = start + Duration::from_millis(500);
        assert_eq!(pace.wait(declarations(100), 0, later), Duration::from_millis(500));
        let rested = later + Duration::from_hours(1);
        assert!(pace.wait(declarations(1024), 0, rested).is_zero());
        assert!(!pace.wait(declarations(1), 0, rested).is_zero());
        assert_eq!(pace.wait(declarations(5000), 0, rested), LONGEST);
        // Each has a rate of its own.
        let other = Cost { declarations: 0, messages: 10_000 };
        assert!(Pace::new().wait(other, 200_000_000, Instant::now()).is_zero());
    }
}
