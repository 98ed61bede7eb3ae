//! The report for people.

use super::report::{Errors, Group, Nees, Report};
use std::fmt::Write as _;

/// A share, or a line where nothing was counted.
fn share(value: Option<f64>) -> String {
    value.map_or_else(|| "    -".to_owned(), |v| format!("{v:5.3}"))
}

fn number(value: Option<f64>, factor: f64, decimals: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |v| format!("{:.decimals$}", v * factor))
}

/// Median, 90 % quantile and worst.
fn errors(e: &Errors, factor: f64, decimals: usize) -> String {
    let of = |value| number(value, factor, decimals);
    format!("{} / {} / {} (of {})", of(e.median), of(e.most), of(e.worst), e.count)
}

fn nees(n: &Nees) -> String {
    format!(
        "{} / {} / {}, {} expected",
        number(n.mean, 1.0, 2),
        number(n.mean_without_largest, 1.0, 2),
        number(n.median, 1.0, 2),
        n.expected
    )
}

fn group(name: &str, g: &Group) -> String {
    format!(
        "  {name:<22}{:>6}   {}  {}   {}  {}   {:>5}  {:>5}   {}   {:>5}  {:>5}",
        g.full_views,
        share(g.shown),
        share(g.shown_well),
        share(g.asked),
        share(g.asked_well),
        number(g.corner_error_px.median, 1.0, 2),
        number(g.corner_error_px.most, 1.0, 2),
        share(g.named),
        number(g.answer_error_px.median, 1.0, 2),
        number(g.answer_error_px.most, 1.0, 2),
    )
}

pub(super) fn table(r: &Report) -> String {
    let mut out = format!("{} worlds, {} pictures, {} unreadable\n", r.worlds, r.pictures, r.unreadable);
    let _ = writeln!(
        out,
        "  {:<22}{:>6}   shown at IoU    asked at IoU    corners, px    named   answer, px\n  {:<22}{:>6}   0.70   0.85    0.70   0.85    med.   90 %           med.   90 %",
        "full views", "views", "", ""
    );
    let named =
        [("all", &r.all), ("without doors, windows", &r.pictures_and_boards), ("poster and canvas", &r.flat)];
    for (name, g) in named {
        let _ = writeln!(out, "{}", group(name, g));
    }
    let by = r.by_kind.iter().map(|(n, g)| (n, g));
    for (name, g) in by.chain(r.by_shortest_side.iter().chain(&r.by_view_angle).map(|(n, g)| (n, g))) {
        let _ = writeln!(out, "{}", group(name, g));
    }
    let _ = writeln!(
        out,
        "  false quads: {} ({} a picture); asked: {} a picture\n  cut or hidden: {} of {} named\n  wrong names: {}",
        r.false_quads,
        number(r.false_per_picture, 1.0, 2),
        number(r.asked_per_picture, 1.0, 1),
        r.partial.named,
        r.partial.views,
        r.wrong_names
    );
    poses(&mut out, r);
    let missed: Vec<String> = r.missed.iter().map(|(reason, n)| format!("{reason} {n}")).collect();
    let _ = write!(
        out,
        "  full views without a name: {}\n  time a picture: {} ms",
        missed.join(", "),
        number(r.ms_per_picture, 1.0, 1)
    );
    if let Some(p) = &r.peer {
        let _ = write!(
            out,
            "\n  OpenCV {} SIFT with RANSAC: named {} of {} full views, {} of {} without doors and windows, {} cut or hidden; \
             wrong names {}; {} ms",
            p.version,
            p.named,
            p.full_views,
            p.pictures_and_boards_named,
            p.pictures_and_boards,
            p.partial_named,
            p.wrong_names,
            number(p.ms_per_picture, 1.0, 1)
        );
    }
    out
}

fn poses(out: &mut String, r: &Report) {
    let (c, m) = (&r.camera, &r.measurements);
    if c.pictures == 0 {
        let _ = writeln!(out, "  no true poses");
        return;
    }
    let refusals: Vec<String> = c.refusals.iter().map(|(word, n)| format!("{word} {n}")).collect();
    let _ = writeln!(
        out,
        "  camera poses: {} of {} pictures with a full view; none: {}\n\
         \x20   position, cm (median / 90 % / worst): {}\n    direction, deg: {}\n\
         \x20   NEES of the position (mean / without the largest 1 % / median): {}; with places of 1 cm by hand: {}\n\
         \x20   stated standard deviation of the position, cm: {}",
        c.pictures_with_pose,
        c.pictures,
        refusals.join(", "),
        errors(&c.position_m, 100.0, 1),
        errors(&c.direction_deg, 1.0, 2),
        nees(&c.nees_of_view),
        nees(&c.nees),
        errors(&c.stated_m, 100.0, 1)
    );
    let _ = writeln!(
        out,
        "  landmarks in the camera frame, {} of them ambiguous\n    position, cm: {}\n    direction, deg: {}\n\
         \x20   NEES of the position: {}\n    NEES of the pose: {}\n\
         \x20   reprojection of the pose at the answer's corners, px: {}\n    worse than 3 sigma: {}",
        m.ambiguous,
        errors(&m.position_m, 100.0, 1),
        errors(&m.direction_deg, 1.0, 2),
        nees(&m.nees_3),
        nees(&m.nees_6),
        errors(&m.reprojection_px, 1.0, 2),
        share(m.misfit)
    );
}
