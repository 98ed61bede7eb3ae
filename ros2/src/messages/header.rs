//! `builtin_interfaces/msg/Time` and `std_msgs/msg/Header`.

use crate::cdr::{CdrError, Reader, Value, Writer};

const NS_PER_S: i64 = 1_000_000_000;

/// A point in time by the robot's clock, which under simulation is not that of the day.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Time {
    /// Whole seconds since the epoch of the clock.
    pub sec: i32,
    /// Nanoseconds in the second.
    pub nanosec: u32,
}

/// A count of nanoseconds is outside what `Time` can say: 1901 to 2038.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{0} ns is outside of builtin_interfaces/msg/Time")]
pub struct TimeError(pub i64);

impl Time {
    /// The nearest earlier time of this type, exact.
    pub fn from_ns(ns: i64) -> Result<Self, TimeError> {
        let nanosec = ns.rem_euclid(NS_PER_S) as u32;
        i32::try_from(ns.div_euclid(NS_PER_S)).map(|sec| Self { sec, nanosec }).or(Err(TimeError(ns)))
    }

    /// Nanoseconds since the epoch of the clock. More than a second of nanoseconds counts as it
    /// stands.
    pub fn to_ns(self) -> i64 {
        i64::from(self.sec) * NS_PER_S + i64::from(self.nanosec)
    }

    /// Whether nothing has been written into it, as drivers without a clock leave it.
    pub fn is_zero(self) -> bool {
        self == Self::default()
    }
}

impl Value<'_> for Time {
    const MIN_BYTES: usize = 8;

    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        Ok(Self { sec: reader.scalar("sec")?, nanosec: reader.scalar("nanosec")? })
    }

    fn write(&self, writer: &mut Writer) {
        writer.scalar(self.sec);
        writer.scalar(self.nanosec);
    }
}

/// When and in which coordinate frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Header<'a> {
    /// Time of acquisition.
    pub stamp: Time,
    /// Name of the coordinate frame.
    pub frame_id: &'a str,
}

impl<'a> Value<'a> for Header<'a> {
    const MIN_BYTES: usize = Time::MIN_BYTES + 4;

    fn read(reader: &mut Reader<'a>) -> Result<Self, CdrError> {
        Ok(Self { stamp: reader.value("stamp")?, frame_id: reader.text("frame_id")? })
    }

    fn write(&self, writer: &mut Writer) {
        self.stamp.write(writer);
        writer.text(self.frame_id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nanoseconds_come_back() {
        for ns in [0, -1, 1_700_000_000_123_456_789, i64::from(i32::MIN) * NS_PER_S] {
            assert_eq!(Time::from_ns(ns).unwrap().to_ns(), ns);
        }
        assert_eq!(Time::from_ns(-1).unwrap(), Time { sec: -1, nanosec: 999_999_999 });
        let past_2038 = (i64::from(i32::MAX) + 1) * NS_PER_S;
        assert_eq!(Time::from_ns(past_2038), Err(TimeError(past_2038)));
        assert!(Time::from_ns(past_2038 - 1).is_ok());
        // The largest value of the type does not overflow.
        assert!(Time { sec: i32::MAX, nanosec: u32::MAX }.to_ns() > past_2038);
    }
}
