//! `waymark-lab evaluate pose`: accuracy of poses and consistency of their covariances (method 13.3
//! to 13.6): the table of 13.3, NEES, flips of the planar ambiguity, OpenCV on the same corners,
//! several landmarks, drives, cost.

pub(crate) mod stated_camera;
pub(crate) mod joint;
mod peers;
mod scene;
mod single;

use super::experiment::say;
use joint::{Drives, Joint};
use peers::{Errors, PeerComparison};
use serde::Serialize;
use single::{Cell, Cost, Exact, Row};
use stated_camera::Cameras;
use std::path::PathBuf;

/// `waymark-lab evaluate pose`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Draws in each of the twelve cells of distance, angle and noise.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(10..=100_000))]
    draws: u32,
    /// Simulated drives for the fused pose.
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    drives: u32,
    /// Seed of all noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Leave OpenCV out.
    #[arg(long)]
    no_peers: bool,
    /// The Python that has OpenCV.
    #[arg(long, default_value = "python3")]
    python: PathBuf,
    /// Print one JSON object instead of tables.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Report {
    seed: u64,
    exact: Exact,
    table: Vec<Row>,
    cells: Vec<Cell>,
    cells_inside_95: usize,
    cells_inside_99: usize,
    unflagged_flips: usize,
    opencv: Result<PeerComparison, String>,
    joint: Vec<Joint>,
    fused: Drives,
    /// The same with intrinsics that have the errors of a usual calibration.
    camera: Vec<Joint>,
    camera_fused: Vec<Drives>,
    /// Microseconds.
    cost: Cost,
}

const WRONG: [Cameras; 2] = [Cameras::WithoutSigmas, Cameras::WithSigmas];

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let draws = args.draws as usize;
    let cells = single::cells(draws, args.seed);
    let opencv = if args.no_peers {
        Err("--no-peers".to_owned())
    } else {
        peers::beside(&args.python, draws, args.seed)
    };
    let report = Report {
        seed: args.seed,
        exact: single::exact(args.seed),
        table: single::table(args.seed),
        cells_inside_95: cells.iter().filter(|c| c.inside_95).count(),
        cells_inside_99: cells.iter().filter(|c| c.inside_99).count(),
        unflagged_flips: cells.iter().map(|c| c.flips).sum(),
        cells,
        opencv,
        joint: [1, 2, 3].map(|n| joint::joint(n, draws, Cameras::Exact, args.seed)).to_vec(),
        fused: joint::drives(args.drives as usize, Cameras::Exact, args.seed),
        camera: WRONG
            .into_iter()
            .flat_map(|cameras| [1, 2, 3].map(|n| joint::joint(n, draws, cameras, args.seed)))
            .collect(),
        camera_fused: WRONG.map(|cameras| joint::drives(args.drives as usize, cameras, args.seed)).to_vec(),
        cost: single::cost(args.seed),
    };
    say(args.json, &report, || table(&report))
}

fn table(r: &Report) -> Vec<String> {
    let mut lines = vec![format!("pose: seed {}", r.seed)];
    lines.push(format!(
        "  exact corners, {} poses: worst {:.1e} rad, {:.1e} m",
        r.exact.poses, r.exact.worst_rad, r.exact.worst_m
    ));
    lines.push(
        "  sigma along the normal (m), along the wall (m), of the heading (deg); corners 0.5 px".into(),
    );
    let three = |v: &[f64; 3]| format!("{:.3} {:.3} {:.2}", v[0], v[1], v[2]);
    for row in &r.table {
        lines.push(format!(
            "    {:.0} m {:>2.0} deg  refined {} (method {})  by the covariance {}  linear {} (method {})",
            row.distance_m,
            row.azimuth_deg,
            three(&row.refined),
            three(&row.method_refined),
            three(&row.analytic),
            three(&row.linear),
            three(&row.method_linear)
        ));
    }
    lines.push(
        "  consistency: mean NEES, 6 degrees of freedom, of the draws that are not flagged as ambiguous"
            .into(),
    );
    for c in &r.cells {
        let inside = if c.inside_95 {
            "in the 95 % band"
        } else if c.inside_99 {
            "in the 99 % band"
        } else {
            "OUTSIDE"
        };
        lines.push(format!(
            "    {:.0} m {:>2.0} deg {:.1} px  {:.2} of {} of {} draws, {inside}, {} flips",
            c.distance_m, c.azimuth_deg, c.sigma_px, c.nees, c.unflagged, c.draws, c.flips
        ));
    }
    lines.push(format!(
        "    {} of {} cells in the 95 % band, {} in the 99 % band; {} unflagged flips",
        r.cells_inside_95,
        r.cells.len(),
        r.cells_inside_99,
        r.unflagged_flips
    ));
    lines.extend(opencv(&r.opencv));
    lines.extend(robots(r));
    lines
}

/// Poses of robots, and the time of a pose.
fn robots(r: &Report) -> Vec<String> {
    let mut lines: Vec<String> = r.joint.iter().map(joint_line).collect();
    lines.push(drives_line(&r.fused));
    for (cameras, words) in WRONG.into_iter().zip([
        "none stated (focal length 0.5 %, principal point 0.3 % of it)",
        "stated by their sigmas, the server's default for cameras",
    ]) {
        lines.push(format!("  intrinsics have the errors of a usual calibration, {words}"));
        lines.extend(r.camera.iter().filter(|j| j.cameras == cameras).map(joint_line));
        lines.extend(r.camera_fused.iter().filter(|f| f.cameras == cameras).map(drives_line));
    }
    lines.push(format!(
        "  a pose with covariance and second solution: median {:.1} us, least {:.1}, 95 % {:.1}",
        r.cost.median, r.cost.least, r.cost.p95
    ));
    lines
}

fn joint_line(j: &Joint) -> String {
    format!(
        "  robot on the floor by {} landmarks: {} of {} frames fixed, rms {:.3} m {:.2} deg, NEES {:.2} of 3{}, median {:.0} us",
        j.landmarks,
        j.fixed,
        j.frames,
        j.rms_m,
        j.rms_deg,
        j.nees,
        if j.inside_99 { " (in the 99 % band)" } else { " (outside the 99 % band)" },
        j.cost.median
    )
}

fn drives_line(f: &Drives) -> String {
    format!(
        "  fused over {} drives: NEES {:.2} of 3 ({}), rms along the corridor {:.3} m, {} corrections",
        f.count,
        f.nees,
        if f.inside_95 {
            "in the 95 % band"
        } else if f.inside_99 {
            "in the 99 % band"
        } else {
            "OUTSIDE"
        },
        f.rms_along_m,
        f.corrections
    )
}

fn opencv(beside: &Result<PeerComparison, String>) -> Vec<String> {
    let b = match beside {
        Ok(b) => b,
        Err(why) => return vec![format!("  without OpenCV: {why}")],
    };
    let line = |who: &str, e: &Errors| {
        format!(
            "    {who:<34} position rms {:.4} m, median {:.4}; direction rms {:.2} deg, median {:.2}; {} nearer to the mirror image",
            e.rms_m, e.median_m, e.rms_deg, e.median_deg, e.flips
        )
    };
    vec![
        format!(
            "  beside OpenCV {} (IPPE + refineLM), same {} corners, {} flagged by Waymark",
            b.version, b.draws, b.flagged
        ),
        line("all draws, Waymark", &b.ours),
        line("all draws, OpenCV", &b.theirs),
        line("draws that we do not flag, Waymark", &b.ours_unflagged),
        line("draws that we do not flag, OpenCV", &b.theirs_unflagged),
        format!(
            "    the same solution: at most {:.1e} m apart; OpenCV through Python {:.0} us a pose",
            b.apart_m, b.their_us
        ),
    ]
}
