//! CARMEN logs: `FLASER` and `ROBOTLASER1` lines; all others, and scans of no beam, are ignored.
//! In: lines. Out: scans with the laser's pose (by odometry, or corrected), which is also taken as
//! the robot's.

use super::{
    entry::{LaserDefaults, LogEntry},
    text::{BadLine, LineTokens},
};
use map::{
    laser::{MAX_BEAMS, Scan},
    pose2::Pose2,
};

/// The scan of a line, if it has one.
pub(super) fn record(line: usize, text: &str, laser: &LaserDefaults) -> Result<Option<LogEntry>, BadLine> {
    let mut words = LineTokens::new(line, text);
    match words.word("message")? {
        "FLASER" => flaser(&mut words, laser),
        "ROBOTLASER1" => robotlaser(&mut words),
        _ => Ok(None),
    }
}

/// `FLASER n ranges.. x y theta odom_x odom_y odom_theta time host logger_time`.
fn flaser(words: &mut LineTokens<'_>, laser: &LaserDefaults) -> Result<Option<LogEntry>, BadLine> {
    let n = words.count("number of readings", MAX_BEAMS)?;
    if n == 0 {
        return Ok(None);
    }
    let ranges = words.ranges(n)?;
    let pose = words.pose("laser pose")?;
    words.pose("odometry pose")?;
    let time_s = words.number("time").ok();
    let field = laser.field_deg.to_radians();
    // An odd number of beams reaches both ends of the fan, an even one leaves the last step out.
    let steps = if n % 2 == 1 { n.saturating_sub(1) } else { n };
    let step = field / steps.max(1) as f64;
    let scan = Scan::new(Pose2::default(), -0.5 * field, step, laser.max_range_m, ranges)
        .map_err(|e| words.bad("scan", e.to_string()))?;
    Ok(Some(LogEntry { odom: pose, truth: Some(pose), time_s, scan }))
}

/// `ROBOTLASER1 type start fan step max accuracy mode n ranges.. m remissions.. laser(x y theta) robot(x y theta) ..`.
fn robotlaser(words: &mut LineTokens<'_>) -> Result<Option<LogEntry>, BadLine> {
    words.number("laser type")?;
    let start = words.number("start angle")?;
    words.number("field of view")?;
    let step = words.number("angular resolution")?;
    let max = words.number("maximum range")?;
    words.number("accuracy")?;
    words.number("remission mode")?;
    let n = words.count("number of readings", MAX_BEAMS)?;
    if n == 0 {
        return Ok(None);
    }
    let ranges = words.ranges(n)?;
    let m = words.count("number of remissions", MAX_BEAMS)?;
    words.ranges(m)?;
    let pose = words.pose("laser pose")?;
    words.pose("robot pose")?;
    for field in ["tv", "rv", "forward safety", "side safety", "turn axis"] {
        words.number(field)?;
    }
    let time_s = words.number("time").ok();
    let scan = Scan::new(Pose2::default(), start, step, max, ranges)
        .map_err(|e| words.bad("scan", e.to_string()))?;
    Ok(Some(LogEntry { odom: pose, truth: Some(pose), time_s, scan }))
}
