//! Processor time of this thread, which other programs on the machine do not lengthen. On systems
//! without such a clock, wall time.

/// Seconds from one moment to a later one on the same thread.
#[derive(Debug, Clone, Copy)]
pub struct Clock(f64);

impl Clock {
    /// Starts now.
    pub fn start() -> Self {
        Self(now_s())
    }

    /// Milliseconds of work since the start.
    pub fn ms(self) -> f64 {
        (now_s() - self.0) * 1e3
    }
}

#[cfg(unix)]
fn now_s() -> f64 {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

#[cfg(not(unix))]
fn now_s() -> f64 {
    use std::{sync::LazyLock, time::Instant};
    static FIRST: LazyLock<Instant> = LazyLock::new(Instant::now);
    FIRST.elapsed().as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, Instant};

    #[test]
    fn work_counts_and_sleep_does_not() {
        let (clock, wall) = (Clock::start(), Instant::now());
        std::thread::sleep(Duration::from_millis(120));
        let asleep_ms = clock.ms();
        assert!(cfg!(not(unix)) || asleep_ms < 60.0, "{asleep_ms}");
        let mut sum = 0_u64;
        while wall.elapsed() < Duration::from_secs(2) && clock.ms() - asleep_ms < 20.0 {
            sum = (0..10_000).fold(sum, |s: u64, i| s.wrapping_mul(31).wrapping_add(i));
        }
        assert!(clock.ms() - asleep_ms >= 20.0, "{sum}");
    }
}
