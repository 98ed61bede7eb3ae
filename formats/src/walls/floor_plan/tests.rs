//! Plans as drawing programs write them.

use super::*;

fn page(attributes: &str, body: &str) -> String {
    format!(
        r#"<?xml version="1.0"?><!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd"><svg xmlns="http://www.w3.org/2000/svg" {attributes}><g stroke="black" fill="none">{body}</g></svg>"#
    )
}

/// Every other wall, ends in whole millimetres.
fn ends(text: &str, scale: Option<f64>) -> Vec<[i64; 4]> {
    let all = walls(text, scale).unwrap();
    let mm = |v: f64| (v * 1000.0).round() as i64;
    for pair in all.chunks(2) {
        assert_eq!((pair[0].a, pair[0].b), (pair[1].b, pair[1].a), "one wall for each side");
    }
    all.iter().step_by(2).map(|w| [mm(w.a[0]), mm(w.a[1]), mm(w.b[0]), mm(w.b[1])]).collect()
}

#[test]
fn every_shape_is_its_walls() {
    let square = [
        [1000, 3000, 3000, 3000],
        [3000, 3000, 3000, 2000],
        [3000, 2000, 1000, 2000],
        [1000, 2000, 1000, 3000],
    ];
    for body in [
        r#"<rect x="10" y="10" width="20" height="10"/>"#,
        r#"<polygon points="10,10 30,10 30,20 10,20"/>"#,
        r#"<polyline points="10,10 30,10 30,20 10,20 10,10"/>"#,
        r#"<path d="M10 10h20v10H10z"/>"#,
        r#"<path d="m 10,10 l 20,0 0,10 -20,0 z"/>"#,
        r#"<rect transform="translate(10 10) scale(2)" width="10" height="5"/>"#,
        r#"<g transform="matrix(0 1 -1 0 30 10)"><path d="M0 20V0H10V20z"/></g>"#,
        r##"<defs><rect id="r" width="20" height="10"/></defs><use href="#r" x="10" y="10"/>"##,
    ] {
        assert_eq!(ends(&page(r#"viewBox="0 0 40 40""#, body), Some(0.1)), square, "{body}");
    }
    let line = r#"<line x1="0" y1="40" x2="40" y2="40"/>"#;
    assert_eq!(ends(&page(r#"viewBox="0 0 40 40""#, line), Some(0.1)), [[0, 0, 4000, 0]]);
    // Half a circle of 1 m: chords within 2 cm of it.
    let arc = page(r#"viewBox="0 0 40 40""#, r#"<path d="M10 20A10 10 0 0 1 30 20"/>"#);
    let chords = walls(&arc, Some(0.1)).unwrap();
    assert!(chords.len() > 8 && chords.len() < 64, "{}", chords.len());
    for wall in chords {
        let middle = [0.5 * (wall.a[0] + wall.b[0]) - 2.0, 0.5 * (wall.a[1] + wall.b[1]) - 2.0];
        assert!((middle[0].hypot(middle[1]) - 1.0).abs() < FLAT_M, "{wall:?}");
    }
}

#[test]
fn the_scale_is_given_or_that_of_the_page() {
    let line = r#"<line x1="0" y1="0" x2="10" y2="0"/>"#;
    let length = |attributes: &str, scale| {
        let [x, _, to, _] = ends(&page(attributes, line), scale)[0];
        to - x
    };
    // A page of 8 m in millimetres, half of them a unit; and drawn at 1:50 as somebody says.
    let sized = r#"width="8000mm" height="4000mm" viewBox="0 0 4000 2000""#;
    assert_eq!(length(sized, None), 20);
    assert_eq!(length(sized, Some(0.05)), 500);
    assert_eq!(length(r#"width="80cm" height="40cm" viewBox="0 0 80 40""#, None), 100);
    // A page without units: pixels have no length.
    for unsized_page in [r#"width="800" height="400""#, r#"viewBox="0 0 9 9""#, r#"width="1in" height="9""#] {
        assert_eq!(walls(&page(unsized_page, line), None).unwrap_err(), PlanError::NoScale);
        assert_eq!(length(unsized_page, Some(0.1)), 1000);
    }
}

#[test]
fn what_is_not_drawn_is_no_wall() {
    let hidden = r#"<g display="none"><rect width="9" height="9"/></g><rect visibility="hidden" width="9" height="9"/>
        <defs><rect width="9" height="9"/></defs><text>9</text><image href="/etc/hostname" width="9" height="9"/>"#;
    let text = page(r#"viewBox="0 0 40 40""#, hidden);
    assert_eq!(walls(&text, Some(1.0)).unwrap_err(), PlanError::NoLines);
}

#[test]
fn plans_are_bounded_and_what_is_wrong_is_named() {
    let bad = |text: &str, scale| walls(text, scale).unwrap_err();
    assert!(matches!(bad("<svg", Some(1.0)), PlanError::Format(_)));
    assert!(matches!(bad("<html/>", Some(1.0)), PlanError::Format(_)));
    for scale in [0.0, -1.0, 1e4, f64::NAN] {
        assert!(matches!(bad("<svg/>", Some(scale)), PlanError::Scale(_)), "{scale}");
    }
    // Two walls for each of n - 1 lines.
    let long = |points: usize| {
        let points = (0..points).map(|i| format!("{i},{}", i % 2)).collect::<Vec<_>>().join(" ");
        page(r#"viewBox="0 0 40 40""#, &format!(r#"<polyline points="{points}"/>"#))
    };
    assert_eq!(walls(&long(MAX_WALLS / 2 + 1), Some(1.0)).unwrap().len(), MAX_WALLS);
    assert_eq!(bad(&long(MAX_WALLS / 2 + 2), Some(1.0)), PlanError::TooMany);
    let deep = |groups: usize| {
        let body = r#"<path d="M0 0H9"/>"#;
        page(r#"viewBox="0 0 9 9""#, &("<g>".repeat(groups) + body + &"</g>".repeat(groups)))
    };
    // The document, the page, its group and the path besides.
    assert_eq!(walls(&deep(MAX_DEPTH - 4), Some(1.0)).unwrap().len(), 2);
    assert_eq!(bad(&deep(MAX_DEPTH - 3), Some(1.0)), PlanError::TooDeep);
}

proptest::proptest! {
    #[test]
    fn no_text_is_a_panic(at in 0..400_usize, byte in 0_u8..128, cut in 0..400_usize) {
        let body = r#"<rect x="1" width="20" height="1e1" transform="rotate(3)"/><path d="M1 2C3 4 5 6 7 8A9 9 0 0 1 3 2z"/>"#;
        let mut bytes = page(r#"width="9mm" height="9mm" viewBox="0 0 9 9""#, body).into_bytes();
        let at = bytes.len() - 1 - at % bytes.len();
        bytes[at] = byte;
        if cut % 3 == 0 {
            bytes.truncate(bytes.len() - cut % bytes.len());
        }
        // An answer, whichever.
        walls(std::str::from_utf8(&bytes).expect("ASCII"), None).ok();
    }
}

#[test]
fn the_page_and_what_nobody_sees_are_no_walls() {
    let room = r#"<rect x="10" y="10" width="20" height="10"/>"#;
    let wanted = ends(&page(r#"viewBox="0 0 40 40""#, room), Some(0.1));
    for around in [
        r#"<rect width="100%" height="100%" fill="white" stroke="none"/>"#,
        r#"<rect width="100%" height="100%" fill="black" stroke="none"/>"#,
        // matplotlib: the figure and its axes; draw.io: two.
        r#"<path d="M0 40H40V0H0z" style="fill:#ffffff;stroke:none"/><path d="M5 35H35V5H5z" style="fill:#fff;stroke:none"/>"#,
        r#"<rect x="2" y="2" width="9" height="9" opacity="0"/>"#,
        r#"<g opacity="0"><rect x="2" y="2" width="9" height="9"/></g>"#,
        r#"<rect x="2" y="2" width="9" height="9" stroke-opacity="0"/>"#,
        r#"<rect x="2" y="2" width="9" height="9" stroke="none" fill="red" fill-opacity="0"/>"#,
        r#"<pattern id="p" width="1" height="1"><path d="M0 0H1"/></pattern>
            <rect width="40" height="40" stroke="none" fill="url(#p)"/>"#,
        r#"<pattern id="p" width="1" height="1" patternUnits="userSpaceOnUse"><path d="M0 0H1"/></pattern>
            <rect x="2" y="2" width="9" height="9" stroke="none" fill="url(#p)"/>"#,
    ] {
        assert_eq!(
            ends(&page(r#"viewBox="0 0 40 40""#, &format!("{around}{room}")), Some(0.1)),
            wanted,
            "{around}"
        );
    }
    // White rooms on a dark building.
    let dark = r#"<path d="M5 5H35V25H5z" stroke="none" fill="black"/><rect x="10" y="10" width="20" height="10" stroke="none" fill="white"/>"#;
    assert_eq!(ends(&page(r#"viewBox="0 0 40 40""#, dark), Some(0.1)).len(), 8);
    // The outline of the page's size is a wall.
    let outline = r#"<rect width="40" height="40" fill="white"/>"#;
    assert_eq!(ends(&page(r#"viewBox="0 0 40 40""#, outline), Some(0.1)).len(), 4);
}

#[test]
fn what_a_clip_path_cuts_off_is_no_wall() {
    let clip = |inside: &str, body: &str| {
        let body = format!(r#"<clipPath id="c">{inside}</clipPath><g clip-path="url(#c)">{body}</g>"#);
        ends(&page(r#"viewBox="0 0 40 40""#, &body), Some(0.1))
    };
    let line = r#"<path d="M0 20H40"/>"#;
    let middle = r#"<rect x="10" y="10" width="20" height="20"/>"#;
    assert_eq!(clip(middle, line), [[1000, 2000, 3000, 2000]]);
    assert_eq!(clip(middle, r#"<path d="M0 35H40"/><path d="M12 20H20"/>"#), [[1200, 2000, 2000, 2000]]);
    let two = r#"<rect x="0" y="10" width="10" height="20"/><rect x="30" y="10" width="10" height="20"/>"#;
    assert_eq!(clip(two, line), [[0, 2000, 1000, 2000], [3000, 2000, 4000, 2000]]);
    let moved = r#"<g transform="translate(10 0)"><path d="M-10 20H30"/></g>"#;
    assert_eq!(clip(middle, moved), [[1000, 2000, 3000, 2000]]);
    let turned = r#"<clipPath id="c"><rect x="10" y="10" width="20" height="20"/></clipPath>
        <g transform="translate(5 0)"><path clip-path="url(#c)" d="M0 20H40"/></g>"#;
    assert_eq!(ends(&page(r#"viewBox="0 0 40 40""#, turned), Some(0.1)), [[1500, 2000, 3500, 2000]]);
}

#[test]
fn a_side_that_is_left_out_follows_from_the_other() {
    let room = r#"<rect x="10" y="10" width="80" height="60"/>"#;
    let whole = ends(&page(r#"width="100mm" height="80mm" viewBox="0 0 100 80""#, room), None);
    for attributes in [
        r#"width="100mm" viewBox="0 0 100 80""#,
        r#"height="80mm" viewBox="0 0 100 80""#,
        r#"width="100mm" height="auto" viewBox="0 0 100 80""#,
    ] {
        assert_eq!(ends(&page(attributes, room), None), whole, "{attributes}");
    }
}
