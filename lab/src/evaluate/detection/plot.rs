//! The report as one SVG picture: recall over the overlap required, recall over the shortest side,
//! corner errors.

use super::{
    report::Report,
    score::{FOUND, LabelScore},
};
use crate::evaluate::{
    chart::{COLOURS, Panel, picture},
    statistics::{Interval, wilson},
    truth::QuadState,
};

/// Most points of the curve over sides; each stands for about as many quads.
const SIDE_POINTS: usize = 8;
const ERRORS_PX: [f64; 2] = [0.05, 50.0];
const SIDES_PX: [f64; 2] = [10.0, 1000.0];

/// All reports in one picture, a colour each.
pub(crate) fn svg(reports: &[Report]) -> String {
    let words: Vec<(&str, String)> = reports
        .iter()
        .enumerate()
        .map(|(i, report)| {
            let words = format!(
                "{}, {} parameters: recall {:.3} / {:.3}, {} quads, {} images",
                report.set,
                report.params,
                report.all.recall_70,
                report.all.recall_85,
                report.all.quads,
                report.images.images
            );
            (COLOURS[i % COLOURS.len()], words)
        })
        .collect();
    let overlap = Panel::of_shares(0, "recall", "least IoU", [0.5, 1.0], false);
    let side = Panel::of_shares(1, "recall at IoU 0.7 (bars: 95 %)", "shortest side, px", SIDES_PX, true);
    let error = Panel::of_shares(2, "share of found quads", "corner error below, px", ERRORS_PX, true);
    picture(3, &words, |svg| {
        overlap.axes(svg, &[0.5, 0.6, 0.7, 0.8, 0.9, 1.0]);
        side.axes(svg, &[10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0]);
        error.axes(svg, &[0.05, 0.1, 0.3, 1.0, 3.0, 10.0, 50.0]);
        for (report, (colour, _)) in reports.iter().zip(&words) {
            let labels: Vec<&LabelScore> =
                report.scores.iter().flat_map(|s| &s.labels).filter(|l| l.state == QuadState::Full).collect();
            overlap.curve(svg, &recall_over_iou(&labels), colour);
            sides(svg, &side, &labels, colour);
            error.curve(svg, &errors(&labels), colour);
        }
    })
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
        let (x, Interval(low, high)) = (group[group.len() / 2].0, wilson(hits, group.len()));
        panel.interval(svg, x, [low, high], colour);
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
    fn curves_follow_from_the_scores() {
        let labels = [label(0.6, 20.0, 0.0), label(0.8, 40.0, 2.0), label(0.9, 80.0, 1.0)];
        let labels: Vec<&LabelScore> = labels.iter().collect();
        let recall = recall_over_iou(&labels);
        let at = |iou: f64| recall.iter().find(|p| (p.0 - iou).abs() < 1e-9).unwrap().1;
        assert!((at(0.5) - 1.0).abs() < 1e-12 && (at(0.7) - 2.0 / 3.0).abs() < 1e-12 && at(0.95) < 1e-12);
        assert_eq!(errors(&labels), [(1.0, 0.5), (2.0, 1.0)]);
    }

    #[test]
    fn every_report_has_its_colour_and_every_element_is_closed() {
        let report =
            |name: &str| Report::new("a<b", name, vec![image("a", vec![label(0.9, 50.0, 1.0)], &[])], 0, 0);
        let svg = svg(&[report("default"), report("relaxation")]);
        assert_eq!(svg.matches("<polyline").count(), 6);
        assert!(svg.contains("a&lt;b, relaxation parameters") && svg.contains(COLOURS[1]));
        assert!(svg.trim_end().ends_with("</svg>") && !svg.contains("NaN"));
        assert_eq!(svg.matches("<text").count(), svg.matches("</text>").count());
    }
}
