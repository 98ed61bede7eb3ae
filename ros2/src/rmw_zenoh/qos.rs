//! Quality of service as liveliness tokens write it. It never keeps data from being delivered.
//!
//! `reliability:durability:history,depth:deadline s,ns:lifespan s,ns:liveliness,lease s,ns`; what
//! equals the default is left empty. Source: `liveliness_utils.cpp` (`qos_to_keyexpr`), `qos.cpp`
//! (defaults); numbers of `ros2/rmw include/rmw/types.h`. Before Humble 0.1.2, Jazzy 0.2.3 and
//! Rolling 0.5.0 an empty durability meant transient local (`ros2/rmw_zenoh` issue 263).

use std::fmt;

/// Why a text is no quality of service.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` of the quality of service is malformed")]
pub struct QosError(pub &'static str);

macro_rules! policy {
    ($(#[$doc:meta])* $name:ident = $default:ident { $($(#[$value_doc:meta])* $value:ident = $number:literal),* }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum $name {
            /// Left to the middleware.
            SystemDefault = 0,
            $($(#[$value_doc])* $value = $number),*
        }

        impl Default for $name {
            fn default() -> Self {
                Self::$default
            }
        }

        impl $name {
            fn parse(text: &str, field: &'static str) -> Result<Self, QosError> {
                match number(text, u64::from(Self::default() as u8), field)? {
                    0 => Ok(Self::SystemDefault),
                    $($number => Ok(Self::$value),)*
                    _ => Err(QosError(field)),
                }
            }
        }
    };
}

policy! {
    /// Whether lost samples are sent again.
    Reliability = Reliable {
        /// They are.
        Reliable = 1,
        /// They are not.
        BestEffort = 2,
        /// Not known.
        Unknown = 3,
        /// That of the other side.
        BestAvailable = 4
    }
}

policy! {
    /// Whether late subscribers get earlier samples.
    Durability = Volatile {
        /// They do, as many as the history is deep.
        TransientLocal = 1,
        /// They do not.
        Volatile = 2,
        /// Not known.
        Unknown = 3,
        /// That of the other side.
        BestAvailable = 4
    }
}

policy! {
    /// How many samples wait.
    History = KeepLast {
        /// As many as the depth says.
        KeepLast = 1,
        /// All.
        KeepAll = 2,
        /// Not known.
        Unknown = 3
    }
}

policy! {
    /// What shows that a publisher lives.
    Liveliness = Automatic {
        /// The middleware.
        Automatic = 1,
        /// The publisher, for its node.
        ManualByNode = 2,
        /// The publisher.
        ManualByTopic = 3,
        /// Not known.
        Unknown = 4,
        /// That of the other side.
        BestAvailable = 5
    }
}

/// A length of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct QosDuration {
    /// Seconds.
    pub sec: u64,
    /// Nanoseconds.
    pub nsec: u64,
}

impl QosDuration {
    /// `RMW_DURATION_INFINITE`: 2^63 - 1 nanoseconds.
    pub const INFINITE: Self = Self { sec: 9_223_372_036, nsec: 854_775_807 };
}

impl Default for QosDuration {
    fn default() -> Self {
        Self::INFINITE
    }
}

/// The quality of service of a publisher or subscription.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Qos {
    /// Whether lost samples are sent again.
    pub reliability: Reliability,
    /// Whether late subscribers get earlier samples.
    pub durability: Durability,
    /// How many samples wait.
    pub history: History,
    /// Depth of the history.
    pub depth: u64,
    /// Longest time between samples.
    pub deadline: QosDuration,
    /// Longest life of a sample.
    pub lifespan: QosDuration,
    /// What shows that a publisher lives.
    pub liveliness: Liveliness,
    /// Longest time without that.
    pub lease: QosDuration,
}

impl Default for Qos {
    fn default() -> Self {
        Self {
            reliability: Reliability::default(),
            durability: Durability::default(),
            history: History::default(),
            depth: 42,
            deadline: QosDuration::INFINITE,
            lifespan: QosDuration::INFINITE,
            liveliness: Liveliness::default(),
            lease: QosDuration::INFINITE,
        }
    }
}

impl Qos {
    /// `rmw_qos_profile_sensor_data`: images, scans, odometry of many robots.
    pub fn sensor_data() -> Self {
        Self { reliability: Reliability::BestEffort, depth: 5, ..Self::default() }
    }

    /// Reliable, volatile, the newest `depth`: 10 by default in ROS, 100 for `/tf`.
    pub fn reliable(depth: u64) -> Self {
        Self { depth, ..Self::default() }
    }

    /// Reliable and transient local: `/tf_static`, with depth 1 for its publisher and 100 for its
    /// listener.
    pub fn latched(depth: u64) -> Self {
        Self { durability: Durability::TransientLocal, depth, ..Self::default() }
    }

    /// Reads the last part but the backends of a token. Parts after the sixth are passed over.
    pub fn parse(text: &str) -> Result<Self, QosError> {
        let default = Self::default();
        let mut parts = text.split(':');
        let mut part = |field| parts.next().ok_or(QosError(field));
        let reliability = Reliability::parse(part("reliability")?, "reliability")?;
        let durability = Durability::parse(part("durability")?, "durability")?;
        let (history, depth) = part("history")?.split_once(',').ok_or(QosError("history"))?;
        let deadline = duration(part("deadline")?, "deadline")?;
        let lifespan = duration(part("lifespan")?, "lifespan")?;
        let (liveliness, lease) = part("liveliness")?.split_once(',').ok_or(QosError("liveliness"))?;
        Ok(Self {
            reliability,
            durability,
            history: History::parse(history, "history")?,
            depth: number(depth, default.depth, "depth")?,
            deadline,
            lifespan,
            liveliness: Liveliness::parse(liveliness, "liveliness")?,
            lease: duration(lease, "lease")?,
        })
    }
}

impl fmt::Display for Qos {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let default = Self::default();
        let [reliability, durability, history, liveliness] = [
            unless(self.reliability as u64, default.reliability as u64),
            unless(self.durability as u64, default.durability as u64),
            unless(self.history as u64, default.history as u64),
            unless(self.liveliness as u64, default.liveliness as u64),
        ];
        let depth = unless(self.depth, default.depth);
        let time = |d: QosDuration| {
            let infinite = QosDuration::INFINITE;
            format!("{},{}", unless(d.sec, infinite.sec), unless(d.nsec, infinite.nsec))
        };
        let (deadline, lifespan, lease) = (time(self.deadline), time(self.lifespan), time(self.lease));
        write!(f, "{reliability}:{durability}:{history},{depth}:{deadline}:{lifespan}:{liveliness},{lease}")
    }
}

/// Nothing for the default.
fn unless(number: u64, default: u64) -> String {
    if number == default { String::new() } else { number.to_string() }
}

fn number(text: &str, default: u64, field: &'static str) -> Result<u64, QosError> {
    match text {
        "" => Ok(default),
        digits if digits.bytes().all(|b| b.is_ascii_digit()) => digits.parse().or(Err(QosError(field))),
        _ => Err(QosError(field)),
    }
}

fn duration(text: &str, field: &'static str) -> Result<QosDuration, QosError> {
    let (sec, nsec) = text.split_once(',').ok_or(QosError(field))?;
    let infinite = QosDuration::INFINITE;
    Ok(QosDuration { sec: number(sec, infinite.sec, field)?, nsec: number(nsec, infinite.nsec, field)? })
}
