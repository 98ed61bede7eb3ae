//! The result of a replay, for a person and as JSON.

use super::player::Counts;
use crate::robot::inputs;
use client::{api::RobotInput, protos::Name};
use recordings::compare::{Change, Comparison};
use serde::Serialize;

/// Frames that are listed one by one.
const MAX_LISTED: usize = 20;

/// The result of a replay.
#[derive(Debug, Serialize)]
pub(super) struct ReplayReport {
    /// As which robot it was played.
    pub(super) robot: Name,
    #[serde(flatten)]
    pub(super) counts: Counts,
    /// What the server used and refused of it.
    pub(super) inputs: Vec<RobotInput>,
    /// Absent unless it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) comparison: Option<Comparison>,
}

/// The counts, a line each, and the frames that differ.
pub(super) fn table(report: &ReplayReport) -> String {
    let counts = &report.counts;
    let answered: u64 = counts.answered.values().sum();
    let by_status: Vec<String> = counts.answered.iter().map(|(word, n)| format!("{n} {word}")).collect();
    let mut lines = vec![
        format!("frames       {}, {answered} answered: {}", counts.frames, by_status.join(", ")),
        format!("recognised   {} landmarks", counts.recognised),
        format!("poses        {} by landmarks, {} fused", counts.poses, counts.fused_poses),
        format!("also sent    {} odometry, {} scans", counts.odometry, counts.scans),
    ];
    lines.extend(counts.poses_written.map(|n| match n {
        0 => "written      no pose: the robot's pose on the map was never known".to_owned(),
        n => format!("written      {n} fused poses"),
    }));
    lines.extend(
        counts.cut_off_at.map(|at| format!("cut off      the file ends inside a record at byte {at}")),
    );
    lines.extend(counts.problems.values().map(|(n, first)| format!("{n:6} times  {first}")));
    let refused: Vec<_> = report.inputs.iter().filter(|input| input.refused > 0).cloned().collect();
    lines.extend(inputs::lines(&refused));
    lines.extend(report.comparison.iter().flat_map(comparison_lines));
    lines.join("\n")
}

fn comparison_lines(comparison: &Comparison) -> Vec<String> {
    let mut lines = vec![String::new(), format!("compared     {} frames", comparison.frames)];
    for (change, count) in &comparison.counts {
        lines.push(format!("  {:20} {count}", change.words()));
    }
    let differing = || comparison.changes.iter().filter(|c| c.change != Change::NotAnsweredBefore);
    for change in differing().take(MAX_LISTED) {
        let names = |names: &std::collections::BTreeSet<String>| match names.len() {
            0 => "nothing".to_owned(),
            _ => names.iter().cloned().collect::<Vec<_>>().join(" "),
        };
        let apart = change.distance_m.zip(change.pose_sigmas);
        let apart = apart.map_or(String::new(), |(m, s)| format!(", {m:.3} m or {s:.1} sigma apart"));
        lines.push(format!(
            "  frame {} of {}: {}: {} -> {}{apart}",
            change.frame.seq,
            change.frame.camera,
            change.change.words(),
            names(&change.before),
            names(&change.after)
        ));
    }
    let more = differing().count().saturating_sub(MAX_LISTED);
    if more > 0 {
        lines.push(format!("  and {more} more: --json lists all"));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use client::v1::{Answer, Status};
    use recordings::compare::Play;

    #[test]
    fn the_table_names_the_frames_that_differ() {
        let (robot, camera) = (Name::new("r1").unwrap(), Name::new("front").unwrap());
        let (mut before, now) = (Play::default(), Play::default());
        for seq in 0..MAX_LISTED as u64 + 2 {
            let answer = Answer { seq, status: Status::NoMatch.into(), ..Answer::default() };
            before.add(&robot, &camera, &answer);
        }
        let comparison = Some(before.compare(&now));
        let counts = Counts { frames: 22, cut_off_at: Some(7), poses_written: Some(3), ..Counts::default() };
        let input =
            |input: &str, refused| RobotInput { input: input.into(), refused, ..RobotInput::default() };
        let inputs = vec![input("odometry", 0), input("scan", 12)];
        let text = table(&ReplayReport { robot, counts, inputs, comparison });
        assert!(text.contains("frame 0 of front: not answered now: nothing -> nothing"), "{text}");
        assert!(
            text.contains("not answered now     22\n") && text.ends_with("and 2 more: --json lists all"),
            "{text}"
        );
        assert!(
            text.contains("ends inside a record at byte 7") && text.contains("3 fused poses\n"),
            "{text}"
        );
        assert!(
            text.contains("\nscan         0 used, 12 refused\n") && !text.contains("odometry     0"),
            "{text}"
        );
    }
}
