//! The clock of a drive that is played again. In: capture times of the recording and the present
//! time. Out: capture times as if the robot drove now.
//!
//! The newest capture time of the recording is now; those before are interpolated between the
//! moments at which their neighbours were now. So order and interpolation among the robot's
//! messages stay what they were, at any speed.

use std::collections::VecDeque;

/// Moments that are remembered: the oldest is forgotten first.
pub const MAX_MOMENTS: usize = 4096;

/// The clock of a replay.
#[derive(Debug, Default)]
pub struct Restamp {
    /// Recorded and present time, ns; both strictly rising.
    moments: VecDeque<[i64; 2]>,
}

impl Restamp {
    /// The present time for a recorded capture time, at `now_ns`. All ns since the Unix epoch.
    pub fn stamp(&mut self, recorded_ns: i64, now_ns: i64) -> i64 {
        let Some(&[last_ns, last_now_ns]) = self.moments.back() else {
            self.moments.push_back([recorded_ns, now_ns]);
            return now_ns;
        };
        if recorded_ns > last_ns {
            let now_ns = now_ns.max(last_now_ns + 1);
            if self.moments.len() == MAX_MOMENTS {
                self.moments.pop_front();
            }
            self.moments.push_back([recorded_ns, now_ns]);
            return now_ns;
        }
        self.between(recorded_ns)
    }

    /// The recorded time of a present one that [`Self::stamp`] gave, or of one between; `None`
    /// before anything was stamped.
    pub fn recorded(&self, now_ns: i64) -> Option<i64> {
        let after = self.moments.partition_point(|[_, now]| *now < now_ns);
        let Some(&[b, b_now]) = self.moments.get(after) else {
            let &[last, last_now] = self.moments.back()?;
            return Some(last.saturating_add(now_ns.saturating_sub(last_now)));
        };
        let Some([a, a_now]) = after.checked_sub(1).map(|i| self.moments[i]) else {
            return Some(b.saturating_sub(b_now.saturating_sub(now_ns)));
        };
        let share = (now_ns - a_now) as f64 / (b_now - a_now) as f64;
        Some(a + ((b - a) as f64 * share).round() as i64)
    }

    fn between(&self, recorded_ns: i64) -> i64 {
        let after = self.moments.partition_point(|[recorded, _]| *recorded < recorded_ns);
        let [b, b_now] = self.moments[after];
        let Some([a, a_now]) = after.checked_sub(1).map(|i| self.moments[i]) else {
            // Before all that is remembered: as much earlier as it was.
            return b_now.saturating_sub(b.saturating_sub(recorded_ns));
        };
        let share = (recorded_ns - a) as f64 / (b - a) as f64;
        a_now + ((b_now - a_now) as f64 * share).round() as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_is_now_and_older_ones_lie_between() {
        let mut clock = Restamp::default();
        assert_eq!(clock.stamp(1_000, 50), 50);
        assert_eq!(clock.stamp(2_000, 60), 60);
        assert_eq!(clock.stamp(1_500, 70), 55, "a frame that was captured between two odometry readings");
        assert_eq!(clock.stamp(2_000, 70), 60, "the same time gives the same time");
        assert_eq!(clock.stamp(900, 70), -50, "before the first, as much earlier");
        assert_eq!(clock.stamp(3_000, 60), 61, "never twice the same");
    }

    #[test]
    fn the_recorded_time_of_what_was_stamped_comes_back() {
        let mut clock = Restamp::default();
        assert_eq!(clock.recorded(5), None);
        for (recorded, now) in [(1_000, 50), (2_000, 60), (4_000, 61), (5_000, 90)] {
            clock.stamp(recorded, now);
        }
        for recorded in [900, 1_000, 2_000, 4_000, 5_000] {
            let now = clock.stamp(recorded, 99);
            assert_eq!(clock.recorded(now), Some(recorded));
        }
        assert_eq!(clock.recorded(55), Some(1_500));
        assert_eq!(clock.recorded(100), Some(5_010), "after the last, as much later");
    }

    #[test]
    fn what_is_remembered_is_bounded() {
        let mut clock = Restamp::default();
        for i in 0..2 * MAX_MOMENTS as i64 {
            clock.stamp(i, 10 * i);
        }
        assert_eq!(clock.moments.len(), MAX_MOMENTS);
        assert_eq!(clock.stamp(2 * MAX_MOMENTS as i64 - 3, 0), 10 * (2 * MAX_MOMENTS as i64 - 3));
    }
}
