//! What one robot may send: messages of each kind a second, and bytes a second over all of them.
//! In: robot, kind, size and time of receipt. Out: nothing, or a refusal that names the limit and
//! how long to wait. Token buckets: a robot may send what it saved within [`BURST`]. Time is passed
//! in.

use crate::limits::MAX_ROBOTS;
use protos::{Code, Name, Rejection};
use std::{
    collections::BTreeMap,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

/// A robot that was silent so long may send as much at once as in this time at its rate.
pub const BURST: Duration = Duration::from_secs(2);

/// Kinds of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Frames and quads of all cameras.
    Frame,
    /// Odometry.
    Odometry,
    /// Laser scans.
    Scan,
}

impl Kind {
    /// The message in refusals, and the setting that bounds it.
    fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Frame => ("frame", "limits.robot_frames_per_s"),
            Self::Odometry => ("odometry", "limits.robot_odometry_per_s"),
            Self::Scan => ("scan", "limits.robot_scans_per_s"),
        }
    }
}

/// Rates of one robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rates {
    /// Frames and quads a second, over all cameras.
    pub frames_per_s: u32,
    /// Odometry messages a second.
    pub odometry_per_s: u32,
    /// Scans a second.
    pub scans_per_s: u32,
    /// Bytes a second, over all messages.
    pub bytes_per_s: usize,
}

/// A bucket that is full after [`BURST`].
#[derive(Debug, Clone, Copy)]
pub struct Bucket {
    level: f64,
    filled: Instant,
}

impl Bucket {
    /// A full one.
    pub fn new(rate_per_s: f64, now: Instant) -> Self {
        Self { level: rate_per_s * BURST.as_secs_f64(), filled: now }
    }

    /// Fills it up to now, and says how long to wait until `amount` can be taken. More than the
    /// whole bucket can be taken from a full one: the debt is waited for afterwards.
    pub fn wait(&mut self, amount: f64, rate_per_s: f64, now: Instant) -> Result<(), Duration> {
        let whole = rate_per_s * BURST.as_secs_f64();
        let passed = now.saturating_duration_since(self.filled);
        self.level = (self.level + passed.as_secs_f64() * rate_per_s).min(whole);
        self.filled = self.filled.max(now);
        let lacking = amount.min(whole) - self.level;
        // Rounding must not refuse who has waited as long as it was told.
        if lacking <= 1e-6 * whole { Ok(()) } else { Err(Duration::from_secs_f64(lacking / rate_per_s)) }
    }

    /// Takes what [`Bucket::wait`] has allowed.
    pub fn take(&mut self, amount: f64) {
        self.level -= amount;
    }
}

#[derive(Debug)]
struct Robot {
    messages: [Bucket; 3],
    bytes: Bucket,
}

/// The buckets of all robots.
#[derive(Debug, Default)]
pub struct Quotas {
    /// `None`: nothing is refused.
    rates: Option<Rates>,
    robots: Mutex<BTreeMap<Name, Robot>>,
}

impl Quotas {
    /// The same rates for every robot.
    pub fn new(rates: Rates) -> Self {
        Self { rates: Some(rates), robots: Mutex::default() }
    }

    /// Counts a message of a registered robot, or refuses it with [`Code::RateLimited`]; a refused
    /// one costs nothing.
    pub fn take(&self, robot: &Name, kind: Kind, bytes: usize, now: Instant) -> Result<(), Rejection> {
        let Some(rates) = self.rates else { return Ok(()) };
        let of_kind = [rates.frames_per_s, rates.odometry_per_s, rates.scans_per_s].map(f64::from);
        let of_bytes = rates.bytes_per_s as f64;
        let mut robots = self.robots.lock().unwrap_or_else(PoisonError::into_inner);
        if robots.len() >= MAX_ROBOTS && !robots.contains_key(robot) {
            // A full bucket is as good as none.
            robots.retain(|_, robot| now.saturating_duration_since(robot.bytes.filled) < BURST);
            if robots.len() >= MAX_ROBOTS {
                let detail = format!("more than {MAX_ROBOTS} robots send at a time");
                return Err(Rejection::new(Code::TooMany, "robot", detail));
            }
        }
        let buckets = robots.entry(robot.clone()).or_insert_with(|| Robot {
            messages: of_kind.map(|rate| Bucket::new(rate, now)),
            bytes: Bucket::new(of_bytes, now),
        });
        let (field, setting) = kind.names();
        let (index, amount) = (kind as usize, bytes as f64);
        if let Err(wait) = buckets.messages[index].wait(1.0, of_kind[index], now) {
            let what = format!("more than {} messages of this kind a second ({setting})", of_kind[index]);
            return Err(limited(field, &what, wait));
        }
        if let Err(wait) = buckets.bytes.wait(amount, of_bytes, now) {
            let what = format!("more than {of_bytes} bytes a second (limits.robot_bytes_per_s)");
            return Err(limited(field, &what, wait));
        }
        buckets.messages[index].take(1.0);
        buckets.bytes.take(amount);
        Ok(())
    }
}

fn limited(field: &str, what: &str, wait: Duration) -> Rejection {
    let ms = wait.as_millis() + 1;
    Rejection::new(Code::RateLimited, field, format!("{what}: wait {ms} ms before the next one"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const RATES: Rates = Rates { frames_per_s: 10, odometry_per_s: 50, scans_per_s: 20, bytes_per_s: 10_000 };

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    #[test]
    fn a_robot_at_the_bounds_is_told_which_and_how_long_to_wait() {
        let (quotas, now, r1) = (Quotas::new(RATES), Instant::now(), name("r1"));
        for (kind, burst, setting) in [
            (Kind::Frame, 20, "limits.robot_frames_per_s"),
            (Kind::Odometry, 100, "limits.robot_odometry_per_s"),
            (Kind::Scan, 40, "limits.robot_scans_per_s"),
        ] {
            assert!((0..burst).all(|_| quotas.take(&r1, kind, 1, now).is_ok()), "{kind:?}");
            let refused = quotas.take(&r1, kind, 1, now).unwrap_err();
            assert_eq!((refused.code, refused.field.as_str()), (Code::RateLimited, kind.names().0));
            let wait = 2_000 / burst + 1;
            assert!(refused.detail.contains(setting) && refused.detail.contains(&format!(" {wait} ms")));
        }
        assert!(quotas.take(&name("r2"), Kind::Frame, 1, now).is_ok(), "each robot has its own");
        let heavy = name("heavy");
        assert!(quotas.take(&heavy, Kind::Frame, 20_000, now).is_ok());
        let refused = quotas.take(&heavy, Kind::Scan, 5_000, now).unwrap_err();
        assert!(refused.detail.contains("limits.robot_bytes_per_s") && refused.detail.contains(" 501 ms"));
        assert!(quotas.take(&heavy, Kind::Scan, 5_000, now + Duration::from_millis(501)).is_ok());
        // One that is larger than the bucket passes when it is full.
        let large = name("large");
        assert!(quotas.take(&large, Kind::Frame, 50_000, now).is_ok());
        assert!(quotas.take(&large, Kind::Frame, 1, now + Duration::from_secs(2)).is_err());
        assert!(quotas.take(&large, Kind::Frame, 1, now + Duration::from_secs(6)).is_ok());
        let without = Quotas::default();
        assert!((0..10_000).all(|_| without.take(&r1, Kind::Frame, 1 << 20, now).is_ok()));
    }

    #[test]
    fn robots_that_are_silent_are_forgotten_at_the_bound() {
        let (quotas, now) = (Quotas::new(RATES), Instant::now());
        for i in 0..MAX_ROBOTS {
            quotas.take(&name(&format!("r{i}")), Kind::Scan, 1, now).unwrap();
        }
        let more = |now| quotas.take(&name("more"), Kind::Scan, 1, now).map_err(|r| r.code);
        assert_eq!(more(now), Err(Code::TooMany));
        assert_eq!(more(now + BURST), Ok(()));
        assert_eq!(quotas.robots.lock().unwrap().len(), 1);
    }

    proptest! {
        /// Whatever a robot sends: in no window more is admitted than a full bucket and the rate,
        /// and who waits as long as told is admitted.
        #[test]
        fn no_window_has_more_than_burst_and_rate(gaps_ms in prop::collection::vec(0_u64..300, 1..200)) {
            let (quotas, start, robot) = (Quotas::new(RATES), Instant::now(), name("r1"));
            let (mut at, mut admitted) = (Duration::ZERO, Vec::new());
            for gap in gaps_ms {
                at += Duration::from_millis(gap);
                match quotas.take(&robot, Kind::Frame, 1, start + at) {
                    Ok(()) => admitted.push(at),
                    Err(refused) => {
                        let wait: u64 = refused.detail.rsplit(" wait ").next().unwrap()
                            .split(' ').next().unwrap().parse().unwrap();
                        at += Duration::from_millis(wait);
                        prop_assert!(quotas.take(&robot, Kind::Frame, 1, start + at).is_ok());
                        admitted.push(at);
                    }
                }
            }
            for (i, from) in admitted.iter().enumerate() {
                for (j, to) in admitted.iter().enumerate().skip(i) {
                    let most = 10.0 * (BURST + to.saturating_sub(*from)).as_secs_f64();
                    prop_assert!((j - i + 1) as f64 <= most + 0.01);
                }
            }
        }
    }
}
