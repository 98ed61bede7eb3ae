//! The report for people.

use super::{
    bound::CORNER_SIGMA_PX,
    peer::PeerReport,
    report::{Errors, Group, Nees, PositionFigures, Report, WalkFigures},
    sizes::{SizeFigures, SizeReport},
};

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
    let mut lines = vec![
        format!("{} worlds, {} pictures, {} unreadable", r.worlds, r.pictures, r.unreadable),
        format!(
            "  {:<22}{:>6}   shown at IoU    asked at IoU    corners, px    named   answer, px",
            "full views", "views"
        ),
        format!("{:<30}   0.70   0.85    0.70   0.85    med.   90 %           med.   90 %", ""),
    ];
    let sums =
        [("all", &r.all), ("without doors, windows", &r.pictures_and_boards), ("poster and canvas", &r.flat)];
    lines.extend(sums.map(|(name, g)| group(name, g)));
    lines.extend(r.by_kind.iter().map(|(name, g)| group(name, g)));
    lines.extend(r.by_shortest_side.iter().chain(&r.by_view_angle).map(|(name, g)| group(name, g)));
    lines.push(format!(
        "  false quads: {} ({} a picture); asked: {} a picture",
        r.false_quads,
        number(r.false_per_picture, 1.0, 2),
        number(r.asked_per_picture, 1.0, 1)
    ));
    lines.push(format!("  cut or hidden: {} of {} named", r.partial.named, r.partial.views));
    lines.push(format!("  wrong names: {}", r.wrong_names));
    poses(&mut lines, r);
    lines.push(format!("  full views without a name: {}", counts(&r.missed)));
    lines.push(format!("  time a picture: {} ms", number(r.ms_per_picture, 1.0, 1)));
    lines.extend(r.sizes.as_ref().map(sizes).unwrap_or_default());
    lines.extend(r.walk.as_ref().map(walk).unwrap_or_default());
    lines.extend(r.peer.as_ref().map(peer));
    lines.join("\n")
}

fn walk(w: &WalkFigures) -> [String; 5] {
    [
        format!(
            "  a robot from picture to picture: {} of {} pictures corrected its pose",
            w.corrections, w.pictures
        ),
        format!("    position, cm (median / 90 % / worst): {}", errors(&w.position_m, 100.0, 1)),
        format!("    direction, deg: {}", errors(&w.direction_deg, 1.0, 2)),
        format!("    NEES (mean / without the largest 1 % / median): {}", nees(&w.nees)),
        format!("    within their 95 %: {} %", number(w.within_95, 100.0, 1)),
    ]
}

/// Words with how often each was counted.
fn counts<'a>(all: impl IntoIterator<Item = &'a (String, usize)>) -> String {
    let all: Vec<String> = all.into_iter().map(|(word, n)| format!("{word} {n}")).collect();
    if all.is_empty() { "none".to_owned() } else { all.join(", ") }
}

/// Errors of the position beside those that corners can tell at best.
fn position(name: &str, f: &PositionFigures) -> String {
    let of = |e: &Errors| format!("{:>5}  {:>5}", number(e.median, 100.0, 1), number(e.most, 100.0, 1));
    format!(
        "    {name:<16}{:>5}   {}    {}   {}      {}",
        f.position_m.count,
        of(&f.position_m),
        of(&f.stated_m),
        of(&f.bound_m),
        of(&f.bound_of_all_m)
    )
}

fn poses(lines: &mut Vec<String>, r: &Report) {
    let (c, m) = (&r.camera, &r.measurements);
    if c.pictures == 0 {
        lines.push("  no true poses".to_owned());
        return;
    }
    let (given, of) = (c.pictures_with_pose, c.pictures);
    lines.extend([
        format!(
            "  camera poses: {given} of {of} pictures with a full view; no pose: {}",
            counts(&c.refusals)
        ),
        format!("    position, cm (median / 90 % / worst): {}", errors(&c.position_m, 100.0, 1)),
        format!("    direction, deg: {}", errors(&c.direction_deg, 1.0, 2)),
        format!(
            "    NEES of the position (mean / without the largest 1 % / median): {}",
            nees(&c.nees_of_view)
        ),
        format!("    NEES as stated, with the errors of places by hand: {}", nees(&c.nees)),
        format!("    stated standard deviation of the position, cm: {}", errors(&c.stated_m, 100.0, 1)),
        format!(
            "    {:<16}{:>5}   position, cm    stated       corners of {CORNER_SIGMA_PX} px   of all in view",
            "", "poses"
        ),
        format!("    {:<21}   med.   90 %     med.   90 %    med.   90 %       med.   90 %", ""),
    ]);
    lines.extend(c.groups.iter().map(|(name, figures)| position(name, figures)));
    lines.extend([
        format!("  landmarks in the camera frame, {} of them ambiguous", m.ambiguous),
        format!("    position, cm: {}", errors(&m.position_m, 100.0, 1)),
        format!("    direction, deg: {}", errors(&m.direction_deg, 1.0, 2)),
        format!("    NEES of the position: {}", nees(&m.nees_3)),
        format!("    NEES of the pose: {}", nees(&m.nees_6)),
        format!(
            "    reprojection at the answer's corners, px: {}; worse than 3 sigma: {}",
            errors(&m.reprojection_px, 1.0, 2),
            share(m.misfit).trim()
        ),
    ]);
}

/// How often the true size was refused.
fn sizes(s: &SizeReport) -> Vec<String> {
    let of = |name: &str, f: &SizeFigures| {
        format!(
            "    {name:<26}refused {} ({} of good borders) and doubted {} of {}; sides swapped: refused {} of {}",
            f.refused, f.refused_wrongly, f.doubted, f.stated, f.swapped_refused, f.swapped
        )
    };
    vec![
        "  true sizes against the views' ratio of sides".to_owned(),
        of("one view", &s.one_view),
        of("one view, known camera", &s.one_view_of_known_camera),
        of("all views", &s.all_views),
        of("all views, known camera", &s.all_views_of_known_camera),
    ]
}

fn peer(p: &PeerReport) -> String {
    format!(
        "  OpenCV {} SIFT with RANSAC: named {} of {} full views, {} of {} without doors and windows, {} cut or hidden; \
         wrong names {}; {} ms",
        p.version,
        p.named,
        p.full_views,
        p.pictures_and_boards_named,
        p.pictures_and_boards,
        p.partial_named,
        p.wrong_names,
        number(p.ms_per_picture, 1.0, 1)
    )
}
