//! The report as text for people.

use super::{
    easy::{MIN_CONTRAST, MIN_SIDE_PX},
    report::{AHEAD_DEG, Group, ImageFigures, Report},
};
use crate::evaluate::statistics::Interval;

/// Width of the column of names.
const NAMES: usize = 38;

/// Several lines, no line feed at the end.
pub(crate) fn table(r: &Report) -> String {
    let mut lines = vec![
        format!(
            "{} with {} parameters: {} images, {} quads fully in view",
            r.set, r.params, r.images.images, r.all.quads
        ),
        format!(
            "  {:<NAMES$} {:>5}  {:<22} {:<22} {}",
            "", "quads", "recall at IoU 0.7", "at 0.85", "corner error, px (90 % below)"
        ),
        row("all", &r.all),
    ];
    let easy = format!("easy: sides {MIN_SIDE_PX} px, contrast {MIN_CONTRAST} on each");
    lines.extend(r.easy.iter().map(|group| row(&easy, group)));
    let mut add = |title: &str, groups: &mut dyn Iterator<Item = (&String, &Group)>| {
        let groups: Vec<(&String, &Group)> = groups.collect();
        // A single group repeats the line of all.
        if groups.len() > 1 {
            lines.push(format!("  {title}"));
            lines.extend(groups.into_iter().map(|(name, group)| row(&format!("  {name}"), group)));
        }
    };
    add("by class", &mut r.by_class.iter());
    add(&format!("by class, at most {AHEAD_DEG} deg from the normal"), &mut r.by_class_ahead.iter());
    add("by stratum", &mut r.by_stratum.iter());
    add("by shortest side", &mut r.by_shortest_side.iter().map(|(n, g)| (n, g)));
    add("by angle of view", &mut r.by_view_angle.iter().map(|(n, g)| (n, g)));
    add("by visible part", &mut r.by_state.iter());
    if r.all.missed_but_alternate > 0 {
        let easy = r.easy.as_ref().map_or(0, |easy| easy.missed_but_alternate);
        let all = r.all.missed_but_alternate;
        lines.push(format!("  missed, but among the alternates of a quad: {all}, of the easy ones {easy}"));
    }
    lines.extend(images(&r.images));
    if r.images_by_stratum.len() > 1 && r.images.false_quads > r.images.reviewed_quads {
        let stratum = |(name, i): (&String, &ImageFigures)| {
            Some(format!("    {name}: {:.2}, {:.1} ms", i.false_per_image_reviewed?, i.ms_per_image))
        };
        lines.extend(r.images_by_stratum.iter().filter_map(stratum));
    }
    if r.unreadable > 0 {
        lines.push(format!("  could not be read: {} images", r.unreadable));
    }
    lines.push(
        "  In brackets: 95 % confidence, of recall by Wilson, of the others from 1000 resamplings of the images".into(),
    );
    for w in &r.worst {
        let error = w.corner_error_px.map_or(String::new(), |e| format!(", corners off by up to {e:.1} px"));
        lines.push(format!(
            "  worst: {} {} missed, {} loose, {} false{error}",
            w.file, w.missed, w.loose, w.false_quads
        ));
    }
    lines.join("\n")
}

fn row(name: &str, g: &Group) -> String {
    let recall = |share: f64, i: &Interval| format!("{share:.3} ({:.3}-{:.3})", i.0, i.1);
    let error = match (g.corner_error_px, g.corner_error_90_px) {
        (Some(middle), Some(most)) => {
            let interval =
                g.corner_error_interval.map_or(String::new(), |i| format!(" ({:.2}-{:.2})", i.0, i.1));
            format!("{middle:.2}{interval}, {most:.2}")
        }
        _ => "-".to_owned(),
    };
    format!(
        "  {name:<NAMES$} {:>5}  {:<22} {:<22} {error}",
        g.quads,
        recall(g.recall_70, &g.recall_70_interval),
        recall(g.recall_85, &g.recall_85_interval)
    )
}

fn images(i: &ImageFigures) -> Vec<String> {
    let figure = |value: Option<f64>, interval: Option<Interval>| {
        let value = value.map_or("not labelled".to_owned(), |v| format!("{v:.3}"));
        value + &interval.map_or(String::new(), |i| format!(" ({:.3}-{:.3})", i.0, i.1))
    };
    let count = if i.false_quads > 0 {
        format!(": {} in {} images", i.false_quads, i.images_complete)
    } else {
        String::new()
    };
    let all = figure(i.false_per_image, i.false_per_image_interval);
    let mut lines = vec![format!("  false quads an image       {all}{count}")];
    if i.reviewed_quads > 0 {
        lines.push(format!(
            "    without reviewed quads  {}: {} are on them",
            figure(i.false_per_image_reviewed, i.false_per_image_reviewed_interval),
            i.reviewed_quads
        ));
    }
    let [found, astray] = i.three_sided;
    if found > 0 {
        lines.push(format!("  sets of three sides        {found}, {astray} of them on no labelled quad"));
    }
    let interval = i.ms_per_image_interval.map_or(String::new(), |i| format!(" ({:.1}-{:.1})", i.0, i.1));
    lines.push(format!(
        "  time                       {:.1} ms{interval} an image, 90 % below {:.1} ms, one thread",
        i.ms_per_image, i.ms_per_image_90
    ));
    lines
}

#[cfg(test)]
mod tests {
    use super::{
        super::report::tests::{image, label},
        *,
    };

    #[test]
    fn every_figure_is_in_the_table() {
        let scores = vec![
            image("bad.png", vec![label(0.9, 25.0, 1.25), label(0.1, 60.0, 0.0)], &[None, Some("switch")]),
            image("good.png", vec![label(0.9, 25.0, 1.25)], &[]),
        ];
        let text = table(&Report::new("corridor", "default", scores, 2, 1));
        for part in [
            "corridor with default parameters: 2 images, 3 quads",
            "0.667 (0.208-0.939)",
            "1.25",
            "20 to 30 px",
            "1.000 (0.000-2.000): 2 in 2 images",
            "without reviewed quads  0.500",
            "sets of three sides        6, 4 of them on no labelled quad",
            "could not be read: 2",
            "worst: bad.png 1 missed, 0 loose, 1 false, corners off by up to 1.2 px",
        ] {
            assert!(text.contains(part), "{part} not in\n{text}");
        }
    }
}
