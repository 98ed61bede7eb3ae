//! `sensor_msgs/msg/LaserScan`.

use super::{Header, Message};
use crate::{
    cdr::{CdrError, Reader, Value, Writer},
    type_name::TypeName,
};

/// One turn of a planar laser. Ray i has the angle `angle_min + i * angle_increment`,
/// counter-clockwise from the laser's x axis, and the time `stamp + i * time_increment`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LaserScan<'a> {
    /// Time of the first ray, and the laser's frame.
    pub header: Header<'a>,
    /// Angle of the first ray, radians.
    pub angle_min: f32,
    /// Angle of the last ray, radians.
    pub angle_max: f32,
    /// Angle from one ray to the next, radians, signed.
    pub angle_increment: f32,
    /// Time from one ray to the next, seconds.
    pub time_increment: f32,
    /// Time from one scan to the next, seconds.
    pub scan_time: f32,
    /// Ranges below are invalid, metres.
    pub range_min: f32,
    /// Ranges above are invalid, metres.
    pub range_max: f32,
    /// Ranges, metres; some are not finite.
    pub ranges: Vec<f32>,
    /// Strengths in units of the device, as many as ranges or none.
    pub intensities: Vec<f32>,
}

impl<'a> Value<'a> for LaserScan<'a> {
    const MIN_BYTES: usize = Header::MIN_BYTES + 7 * 4 + 4 + 4;

    fn read(reader: &mut Reader<'a>) -> Result<Self, CdrError> {
        Ok(Self {
            header: reader.value("header")?,
            angle_min: reader.scalar("angle_min")?,
            angle_max: reader.scalar("angle_max")?,
            angle_increment: reader.scalar("angle_increment")?,
            time_increment: reader.scalar("time_increment")?,
            scan_time: reader.scalar("scan_time")?,
            range_min: reader.scalar("range_min")?,
            range_max: reader.scalar("range_max")?,
            ranges: reader.numbers("ranges")?,
            intensities: reader.numbers("intensities")?,
        })
    }

    fn write(&self, writer: &mut Writer) {
        self.header.write(writer);
        let angles = [self.angle_min, self.angle_max, self.angle_increment];
        let times = [self.time_increment, self.scan_time];
        for number in angles.into_iter().chain(times).chain([self.range_min, self.range_max]) {
            writer.scalar(number);
        }
        writer.numbers(&self.ranges);
        writer.numbers(&self.intensities);
    }
}

impl<'a> Message<'a> for LaserScan<'a> {
    const NAME: TypeName<'static> = TypeName::known("sensor_msgs", "LaserScan");
    const HASH: &'static str = "RIHS01_64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828";
}
