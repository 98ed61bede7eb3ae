//! The report as one SVG picture: recall over the overlap asked for, recall over the shortest side, corner errors.

use super::{
    report::Report,
    score::{FOUND, LabelScore},
};
use crate::cli::evaluate::{statistics::wilson, truth::QuadState};
use std::fmt::Write as _;

const COLOURS: [&str; 6] = ["#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf"];
/// Size of a panel's axes and the distance from one panel to the next.
const PANEL: [f64; 2] = [300.0, 240.0];
const STEP: f64 = 400.0;
const LEFT: f64 = 60.0;
const TOP: f64 = 40.0;
/// Sides are grouped so that each point stands for as many quads, but at most so many points.
const SIDE_POINTS: usize = 8;
const ERRORS_PX: [f64; 2] = [0.05, 50.0];
const SIDES_PX: [f64; 2] = [10.0, 1000.0];

/// One panel: its place and its two scales.
struct Panel {
    x0: f64,
    title: &'static str,
    x_name: &'static str,
    x: [f64; 2],
    log: bool,
}

impl Panel {
    fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let f = |x: f64| if self.log { x.max(1e-9).log10() } else { x };
        let share = ((f(x) - f(self.x[0])) / (f(self.x[1]) - f(self.x[0]))).clamp(0.0, 1.0);
        (self.x0 + share * PANEL[0], TOP + (1.0 - y.clamp(0.0, 1.0)) * PANEL[1])
    }

    fn axes(&self, svg: &mut String, ticks: &[f64]) {
        let (right, bottom) = (self.x0 + PANEL[0], TOP + PANEL[1]);
        for y in [0.0, 0.2, 0.4, 0.6, 0.8, 1.0] {
            let (_, v) = self.at(self.x[0], y);
            put(svg, &format!(r##"<path d="M{:.1} {v:.1}H{right:.1}" stroke="#ddd"/>"##, self.x0));
            text(svg, (self.x0 - 6.0, v + 4.0), "end", &format!("{y:.1}"));
        }
        for x in ticks {
            let (u, _) = self.at(*x, 0.0);
            put(svg, &format!(r##"<path d="M{u:.1} {TOP}V{bottom:.1}" stroke="#eee"/>"##));
            text(svg, (u, bottom + 16.0), "middle", &format!("{x}"));
        }
        put(
            svg,
            &format!(
                r##"<rect x="{:.1}" y="{TOP}" width="{}" height="{}" fill="none" stroke="#333"/>"##,
                self.x0, PANEL[0], PANEL[1]
            ),
        );
        text(svg, (self.x0 + 0.5 * PANEL[0], TOP - 12.0), "middle", self.title);
        text(svg, (self.x0 + 0.5 * PANEL[0], bottom + 34.0), "middle", self.x_name);
    }

    fn curve(&self, svg: &mut String, points: &[(f64, f64)], colour: &str) {
        let path: Vec<String> = points
            .iter()
            .map(|(x, y)| {
                let (u, v) = self.at(*x, *y);
                format!("{u:.1},{v:.1}")
            })
            .collect();
        put(
            svg,
            &format!(
                r#"<polyline points="{}" fill="none" stroke="{colour}" stroke-width="1.8"/>"#,
                path.join(" ")
            ),
        );
    }
}

fn put(svg: &mut String, element: &str) {
    // Writing to a String cannot fail.
    writeln!(svg, "{element}").ok();
}

fn text(svg: &mut String, (x, y): (f64, f64), anchor: &str, words: &str) {
    let words = words.replace('&', "&amp;").replace('<', "&lt;");
    put(svg, &format!(r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{words}</text>"#));
}

/// All reports in one picture, a colour each.
pub(crate) fn svg(reports: &[Report]) -> String {
    let (width, height) = (3.0 * STEP, TOP + PANEL[1] + 60.0 + 18.0 * reports.len() as f64);
    let mut svg = String::new();
    put(
        &mut svg,
        &format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12">"#
        ),
    );
    put(&mut svg, r#"<rect width="100%" height="100%" fill="white"/>"#);
    let panel = |i: usize, title, x_name, x, log| Panel { x0: LEFT + STEP * i as f64, title, x_name, x, log };
    let overlap = panel(0, "recall", "least IoU", [0.5, 1.0], false);
    let side = panel(1, "recall at IoU 0.7 (bars: 95 %)", "shortest side, px", SIDES_PX, true);
    let error = panel(2, "share of found quads", "corner error below, px", ERRORS_PX, true);
    overlap.axes(&mut svg, &[0.5, 0.6, 0.7, 0.8, 0.9, 1.0]);
    side.axes(&mut svg, &[10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0]);
    error.axes(&mut svg, &[0.05, 0.1, 0.3, 1.0, 3.0, 10.0, 50.0]);
    for (i, report) in reports.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        let labels: Vec<&LabelScore> =
            report.scores.iter().flat_map(|s| &s.labels).filter(|l| l.state == QuadState::Full).collect();
        overlap.curve(&mut svg, &recall_over_iou(&labels), colour);
        sides(&mut svg, &side, &labels, colour);
        error.curve(&mut svg, &errors(&labels), colour);
        let y = TOP + PANEL[1] + 56.0 + 18.0 * i as f64;
        put(
            &mut svg,
            &format!(r#"<rect x="{LEFT}" y="{:.1}" width="24" height="4" fill="{colour}"/>"#, y - 6.0),
        );
        let words = format!(
            "{}, {} parameters: recall {:.3} / {:.3}, {} quads, {} images",
            report.set,
            report.params,
            report.all.recall_70,
            report.all.recall_85,
            report.all.quads,
            report.images.images
        );
        text(&mut svg, (LEFT + 32.0, y), "start", &words);
    }
    put(&mut svg, "</svg>");
    svg
}

fn recall_over_iou(labels: &[&LabelScore]) -> Vec<(f64, f64)> {
    let share =
        |least: f64| labels.iter().filter(|l| l.iou >= least).count() as f64 / (labels.len().max(1)) as f64;
    (0..=100).map(|i| 0.5 + 0.005 * f64::from(i)).map(|iou| (iou, share(iou))).collect()
}

/// Recall of groups of equal numbers of quads, each with its interval.
fn sides(svg: &mut String, panel: &Panel, labels: &[&LabelScore], colour: &str) {
    let mut sorted: Vec<(f64, bool)> = labels.iter().map(|l| (l.min_side_px, l.iou >= FOUND)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut curve = vec![];
    for group in sorted.chunks(sorted.len().div_ceil(SIDE_POINTS).max(1)) {
        let hits = group.iter().filter(|g| g.1).count();
        let (x, interval) = (group[group.len() / 2].0, wilson(hits, group.len()));
        let (u, low) = panel.at(x, interval.0);
        let (_, high) = panel.at(x, interval.1);
        put(
            svg,
            &format!(r#"<path d="M{u:.1} {low:.1}V{high:.1}" stroke="{colour}" stroke-opacity="0.5"/>"#),
        );
        curve.push((x, hits as f64 / group.len() as f64));
    }
    panel.curve(svg, &curve, colour);
}

/// Share of found quads whose corners err by less.
fn errors(labels: &[&LabelScore]) -> Vec<(f64, f64)> {
    let mut sorted: Vec<f64> = labels.iter().filter_map(|l| l.corner_error_px).collect();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    sorted.iter().enumerate().map(|(i, e)| (*e, (i + 1) as f64 / n)).collect()
}

#[cfg(test)]
mod tests {
    use super::{
        super::report::tests::{image, label},
        *,
    };

    #[test]
    fn curves_are_those_of_the_scores() {
        let labels = [label(0.6, 20.0, 0.0), label(0.8, 40.0, 2.0), label(0.9, 80.0, 1.0)];
        let labels: Vec<&LabelScore> = labels.iter().collect();
        let recall = recall_over_iou(&labels);
        let at = |iou: f64| recall.iter().find(|p| (p.0 - iou).abs() < 1e-9).unwrap().1;
        assert!((at(0.5) - 1.0).abs() < 1e-12 && (at(0.7) - 2.0 / 3.0).abs() < 1e-12 && at(0.95) < 1e-12);
        assert_eq!(errors(&labels), [(1.0, 0.5), (2.0, 1.0)]);
    }

    #[test]
    fn one_colour_a_report_and_no_open_element() {
        let report =
            |name: &str| Report::new("a<b", name, vec![image("a", vec![label(0.9, 50.0, 1.0)], &[])], 0, 0);
        let svg = svg(&[report("default"), report("relaxation")]);
        assert_eq!(svg.matches("<polyline").count(), 6);
        assert!(svg.contains("a&lt;b, relaxation parameters") && svg.contains(COLOURS[1]));
        assert!(svg.trim_end().ends_with("</svg>") && !svg.contains("NaN"));
        assert_eq!(svg.matches("<text").count(), svg.matches("</text>").count());
    }
}
