//! The project's own scan logs: JSON lines. The first line describes the laser, each other one
//! scan:
//! `{"waymark_recording":1,"robot_from_laser":[x,y,theta],"first_bearing_rad":..,"bearing_step_rad":..,"max_range_m":..}`
//! `{"t_s":12.5,"odom":[x,y,theta],"ranges_m":[..],"truth":[x,y,theta]}` (`null` in ranges: no
//! return; truth if known).

use super::{entry::LogEntry, text::BadLine};
use map::{laser::Scan, pose2::Pose2};
use serde::Deserialize;

/// The only version so far.
const VERSION: u32 = 1;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    waymark_recording: u32,
    #[serde(default)]
    robot_from_laser: [f64; 3],
    first_bearing_rad: f64,
    bearing_step_rad: f64,
    max_range_m: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    t_s: Option<f64>,
    odom: [f64; 3],
    ranges_m: Vec<Option<f32>>,
    truth: Option<[f64; 3]>,
}

/// A log whose head has been read.
#[derive(Debug)]
pub(super) struct Recording(Head);

/// The JSON of a line; an error names the field.
fn parse<'a, T: Deserialize<'a>>(line: usize, text: &'a str) -> Result<T, BadLine> {
    let mut json = serde_json::Deserializer::from_str(text);
    serde_path_to_error::deserialize(&mut json).map_err(|e| BadLine {
        line,
        field: e.path().to_string(),
        problem: e.inner().to_string(),
    })
}

fn pose(line: usize, field: &str, [x, y, theta]: [f64; 3]) -> Result<Pose2, BadLine> {
    let made = Pose2::new(x, y, theta);
    let bad = |e: map::check::OutOfRange| BadLine { line, field: field.to_owned(), problem: e.to_string() };
    made.check().map_err(bad)?;
    Ok(made)
}

impl Recording {
    /// Reads the first line.
    pub(super) fn head(line: usize, text: &str) -> Result<Self, BadLine> {
        let head: Head = parse(line, text)?;
        if head.waymark_recording != VERSION {
            let problem = format!("version {} is not {VERSION}", head.waymark_recording);
            return Err(BadLine { line, field: "waymark_recording".to_owned(), problem });
        }
        pose(line, "robot_from_laser", head.robot_from_laser)?;
        Ok(Self(head))
    }

    /// Reads the line of a scan.
    pub(super) fn record(&self, line: usize, text: &str) -> Result<LogEntry, BadLine> {
        let read: Line = parse(line, text)?;
        let h = &self.0;
        let mount = pose(line, "robot_from_laser", h.robot_from_laser)?;
        let ranges = read.ranges_m.iter().map(|r| r.unwrap_or(f32::NAN)).collect();
        let scan = Scan::new(mount, h.first_bearing_rad, h.bearing_step_rad, h.max_range_m, ranges)
            .map_err(|e| BadLine { line, field: "ranges_m".to_owned(), problem: e.to_string() })?;
        let truth = read.truth.map(|t| pose(line, "truth", t)).transpose()?;
        Ok(LogEntry { odom: pose(line, "odom", read.odom)?, truth, time_s: read.t_s, scan })
    }
}
