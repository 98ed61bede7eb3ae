//! Fused poses of a replay as a file of a trajectory. In: poses with times of the recording. Out: a
//! text file of the TUM benchmark, as `evo` and others read it.

use super::new_file;
use client::v1::RobotPose;
use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufWriter, Write as _},
    path::Path,
};

/// What the columns are.
const HEAD: &str = "# Fused poses of the robot in the map frame, z = 0: stamp (s, the recording's clock), x y z (m), quaternion.\n\
    # timestamp tx ty tz qx qy qz qw";

/// A file of poses that is being gathered.
#[derive(Debug)]
pub(super) struct PosesFile {
    out: BufWriter<File>,
    /// By capture time, ns: x and y in metres, heading in radians, and the map. Of two poses of one
    /// time the later one counts: a landmark has corrected it.
    poses: BTreeMap<i64, ([f64; 3], String)>,
}

impl PosesFile {
    /// Makes the file, which must not exist.
    pub(super) fn create(path: &Path) -> anyhow::Result<Self> {
        Ok(Self { out: BufWriter::new(new_file(path)?), poses: BTreeMap::new() })
    }

    /// Takes a pose that was captured at `recorded_ns` of the recording's clock.
    pub(super) fn take(&mut self, recorded_ns: i64, pose: &RobotPose) {
        if let Some(at) = pose.map_from_robot.as_ref().and_then(|known| known.pose.as_ref()) {
            self.poses.insert(recorded_ns, ([at.x_m, at.y_m, at.theta_rad], pose.map.clone()));
        }
    }

    /// Writes all in the order of time; how many they are.
    pub(super) fn finish(mut self) -> std::io::Result<u64> {
        writeln!(self.out, "{HEAD}")?;
        let mut on = None;
        for (recorded_ns, ([x_m, y_m, theta_rad], map)) in &self.poses {
            if on != Some(map) {
                writeln!(self.out, "# map {map}")?;
                on = Some(map);
            }
            let (seconds, ns) =
                (recorded_ns.div_euclid(1_000_000_000), recorded_ns.rem_euclid(1_000_000_000));
            let (qz, qw) = (0.5 * theta_rad).sin_cos();
            writeln!(self.out, "{seconds}.{ns:09} {x_m:.6} {y_m:.6} 0 0 0 {qz:.9} {qw:.9}")?;
        }
        self.out.flush()?;
        Ok(self.poses.len() as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use client::v1::{Pose2, Pose2Covariance};

    #[test]
    fn poses_are_lines_in_the_order_of_time_and_the_last_of_a_time_counts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.tum");
        let mut file = PosesFile::create(&path).unwrap();
        let pose = |map: &str, x_m, theta_rad| RobotPose {
            map: map.to_owned(),
            map_from_robot: Some(Pose2Covariance {
                pose: Some(Pose2 { x_m, y_m: -2.0, theta_rad }),
                ..Pose2Covariance::default()
            }),
            ..RobotPose::default()
        };
        file.take(1_700_000_000_500_000_000, &pose("hall", 7.0, 0.0));
        file.take(1_700_000_000_250_000_001, &pose("hall", 1.0, std::f64::consts::PI));
        file.take(1_700_000_000_500_000_000, &pose("attic", 3.0, 0.0));
        file.take(5, &RobotPose::default());
        assert_eq!(file.finish().unwrap(), 2);
        let text = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.iter().filter(|line| line.starts_with('#')).count(), 4);
        assert_eq!(lines[3], "1700000000.250000001 1.000000 -2.000000 0 0 0 1.000000000 0.000000000");
        assert_eq!(lines[5], "1700000000.500000000 3.000000 -2.000000 0 0 0 0.000000000 1.000000000");
        assert_eq!((lines[2], lines[4]), ("# map hall", "# map attic"));
        assert!(PosesFile::create(&path).is_err(), "no file is overwritten");
    }
}
