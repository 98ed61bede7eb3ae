//! Drawing of a laser map, as SVG: scan points, walls, path, odometry alone, loop closures, and the
//! truth if the log has it.

use crate::{
    scan_log::LogEntry,
    svg::{put, text},
    walls::MapFile,
};
use map::pose2::Pose2;
use std::fmt::Write as _;

/// Size of the longer side.
const SIDE_PX: f64 = 1400.0;
/// Border on each side.
const BORDER_PX: f64 = 20.0;
/// Most scans whose points are drawn.
const MAX_SCANS: usize = 400;
/// Points farther than this from the robot are left out.
const MAX_POINT_M: f64 = 15.0;

/// Map metres to picture.
struct MapView {
    left_m: f64,
    top_m: f64,
    scale: f64,
}

impl MapView {
    fn at(&self, x: f64, y: f64) -> (f64, f64) {
        (BORDER_PX + (x - self.left_m) * self.scale, BORDER_PX + (self.top_m - y) * self.scale)
    }

    fn line(&self, svg: &mut String, poses: impl Iterator<Item = [f64; 2]>, colour: &str, width: f64) {
        let mut points = String::new();
        for [x, y] in poses {
            let (u, v) = self.at(x, y);
            // Writing to a String cannot fail.
            write!(points, "{u:.1},{v:.1} ").ok();
        }
        put(
            svg,
            &format!(r#"<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{width}"/>"#),
        );
    }
}

/// The picture as SVG text; `records` (the scans and poses of a log) may be empty.
pub fn draw(map: &MapFile, records: &[LogEntry]) -> String {
    let ends = map.segments.iter().flat_map(|s| [s.a, s.b]);
    let all: Vec<[f64; 2]> = ends.chain(map.path.iter().map(|p| [p[0], p[1]])).collect();
    let bound = |k: usize, f: fn(f64, f64) -> f64, start: f64| all.iter().map(|p| p[k]).fold(start, f);
    let (low, high) = (
        [bound(0, f64::min, f64::INFINITY), bound(1, f64::min, f64::INFINITY)],
        [bound(0, f64::max, f64::NEG_INFINITY), bound(1, f64::max, f64::NEG_INFINITY)],
    );
    let (low, high) = if all.is_empty() { ([0.0; 2], [1.0; 2]) } else { (low, high) };
    let size = [(high[0] - low[0]).max(1.0), (high[1] - low[1]).max(1.0)];
    let view = MapView { left_m: low[0], top_m: high[1], scale: SIDE_PX / size[0].max(size[1]) };
    let (width, height) =
        (size[0] * view.scale + 2.0 * BORDER_PX, size[1] * view.scale + 2.0 * BORDER_PX + 24.0);
    let mut svg = String::new();
    put(
        &mut svg,
        &format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0}" height="{height:.0}" font-family="sans-serif" font-size="14">"#
        ),
    );
    put(&mut svg, r#"<rect width="100%" height="100%" fill="white"/>"#);
    points(&mut svg, &view, map, records);
    for s in &map.segments {
        let ((a, b), (c, d)) = (view.at(s.a[0], s.a[1]), view.at(s.b[0], s.b[1]));
        put(
            &mut svg,
            &format!(r#"<path d="M{a:.1} {b:.1}L{c:.1} {d:.1}" stroke="black" stroke-width="1.6"/>"#),
        );
    }
    for [old, new] in &map.loops {
        if let (Some(p), Some(q)) = (map.path.get(*old), map.path.get(*new)) {
            view.line(&mut svg, [[p[0], p[1]], [q[0], q[1]]].into_iter(), "#d62728", 0.8);
        }
    }
    truth(&mut svg, &view, map, records);
    view.line(&mut svg, map.path.iter().map(|p| [p[0], p[1]]), "#1f77b4", 1.2);
    legend(&mut svg, &view, height);
    put(&mut svg, "</svg>");
    svg
}

fn points(svg: &mut String, view: &MapView, map: &MapFile, records: &[LogEntry]) {
    let stride = records.len().div_ceil(MAX_SCANS).max(1);
    for (record, at) in records.iter().zip(&map.path).step_by(stride) {
        let pose = Pose2::new(at[0], at[1], at[2]).compose(record.scan.robot_from_laser());
        let mut path = String::new();
        for i in (0..record.scan.ranges_m().len()).step_by(2) {
            let Some(p) = record.scan.point(i).filter(|p| p.coords.norm() < MAX_POINT_M) else { continue };
            let q = pose.apply(&p);
            let (u, v) = view.at(q.x, q.y);
            write!(path, "M{u:.1} {v:.1}h1").ok();
        }
        put(svg, &format!(r##"<path d="{path}" stroke="#bbb" stroke-width="1"/>"##));
    }
}

/// The truth, moved so that its first pose is that of the path.
fn truth(svg: &mut String, view: &MapView, map: &MapFile, records: &[LogEntry]) {
    let mut known = records.iter().zip(&map.path).filter_map(|(r, p)| Some((r.truth?, p))).peekable();
    let Some((first, at)) = known.peek() else { return };
    let map_from_truth = Pose2::new(at[0], at[1], at[2]).compose(&first.inverse());
    let aligned = known.map(|(t, _)| map_from_truth.compose(&t)).map(|p| [p.x_m, p.y_m]);
    view.line(svg, aligned, "#2ca02c", 1.0);
}

fn legend(svg: &mut String, view: &MapView, height: f64) {
    let metres = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 1000.0];
    let bar = metres.into_iter().find(|m| m * view.scale > 80.0).unwrap_or(1e4);
    let v = height - 12.0;
    let end = BORDER_PX + bar * view.scale;
    put(svg, &format!(r#"<path d="M{BORDER_PX} {v}H{end:.1}" stroke="black" stroke-width="3"/>"#));
    let words = [
        ("black", format!("{bar} m; walls")),
        ("#1f77b4", "path".into()),
        ("#d62728", "loop closures".into()),
    ];
    let mut u = end + 10.0;
    for (colour, word) in words.into_iter().chain([("#2ca02c", "the log's own poses, if any".to_owned())]) {
        put(svg, &format!(r#"<rect x="{u:.1}" y="{:.1}" width="16" height="4" fill="{colour}"/>"#, v - 4.0));
        text(svg, (u + 20.0, v + 2.0), "start", &word);
        u += 40.0 + 8.0 * word.len() as f64;
    }
}
