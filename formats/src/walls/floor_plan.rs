//! Walls from a floor plan in SVG: paths, lines, polylines, polygons, rectangles, circles and ellipses, with their
//! transforms, units and styles resolved.
//!
//! In: the text of a file and its scale. Out: walls in metres, the origin at the lower left corner of the page, y up. A
//! plan does not say on which side the floor is, so each line becomes two walls, one for each side.

use super::map_file::{MAX_WALLS, Wall};
use usvg::{
    Group, ImageHrefResolver, Node, Options, Tree, roxmltree,
    tiny_skia_path::{PathSegment, Point},
};

/// Largest file.
pub(super) const MAX_BYTES: u64 = 32 << 20;
/// Most elements of a file.
const MAX_ELEMENTS: u32 = 1 << 20;
/// Most elements in one another.
const MAX_DEPTH: usize = 128;
/// Metres of a user unit.
const SCALE_M: std::ops::RangeInclusive<f64> = 1e-6..=1e3;
/// A curve may leave its chords by this much, metres.
const FLAT_M: f64 = 0.02;
/// Most chords of a curve.
const MAX_CHORDS: f64 = 64.0;
/// Pixels of an inch, by CSS.
const DPI: f32 = 96.0;
const INCH_M: f64 = 0.0254;
/// Units of CSS with a length outside of the screen.
const PHYSICAL: [&str; 4] = ["mm", "cm", "in", "pt"];

/// Why a plan has no walls.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum PlanError {
    /// Not XML, or not SVG.
    #[error("not SVG: {0}")]
    Format(String),
    /// Elements in elements.
    #[error("elements more than {MAX_DEPTH} deep")]
    TooDeep,
    /// Nobody said how large it is.
    #[error(
        "the plan has no scale: say how many metres one of its units is, or give its width in mm, cm or in"
    )]
    NoScale,
    /// A scale that cannot be.
    #[error("{0} metres per unit: 0.000001 to 1000")]
    Scale(f64),
    /// Nothing drawn.
    #[error("the plan has no lines; text and pictures are passed over")]
    NoLines,
    /// Too many.
    #[error("more than {MAX_WALLS} segments")]
    TooMany,
}

/// The walls of a file's text. `metres_per_unit` is the length of one user unit (that of the `viewBox`); without it the
/// document's own physical size counts, as drawn at 1:1.
pub(super) fn walls(text: &str, metres_per_unit: Option<f64>) -> Result<Vec<Wall>, PlanError> {
    if let Some(scale) = metres_per_unit.filter(|s| !SCALE_M.contains(s)) {
        return Err(PlanError::Scale(scale));
    }
    // Drawing programs declare the document type.
    let options =
        roxmltree::ParsingOptions { allow_dtd: true, nodes_limit: MAX_ELEMENTS, ..Default::default() };
    let document = roxmltree::Document::parse_with_options(text, options)
        .map_err(|e| PlanError::Format(e.to_string()))?;
    if document.descendants().any(|node| node.ancestors().nth(MAX_DEPTH).is_some()) {
        return Err(PlanError::TooDeep);
    }
    // Pictures are not looked for: a plan opens no other file.
    let nothing =
        ImageHrefResolver { resolve_data: Box::new(|_, _, _| None), resolve_string: Box::new(|_, _| None) };
    let options = Options { dpi: DPI, image_href_resolver: nothing, ..Options::default() };
    let tree = Tree::from_xmltree(&document, &options).map_err(|e| PlanError::Format(e.to_string()))?;
    let metres_per_px = scale(document.root_element(), &tree, metres_per_unit)?;
    let page = Page { metres_per_px, height_px: f64::from(tree.size().height()) };
    let mut walls = Vec::new();
    page.add_group(&mut walls, tree.root())?;
    if walls.is_empty() { Err(PlanError::NoLines) } else { Ok(walls) }
}

fn scale(root: roxmltree::Node, tree: &Tree, metres_per_unit: Option<f64>) -> Result<f64, PlanError> {
    let Some(metres) = metres_per_unit else {
        let is_physical = |name| {
            let value = root.attribute(name).unwrap_or_default().trim();
            PHYSICAL.iter().any(|unit| value.ends_with(unit))
        };
        let is_sized = is_physical("width") && is_physical("height");
        return is_sized.then(|| INCH_M / f64::from(DPI)).ok_or(PlanError::NoScale);
    };
    let view_box = root.attribute("viewBox").unwrap_or_default();
    let tokens = view_box.split(|c: char| c == ',' || c.is_whitespace()).filter(|t| !t.is_empty());
    let numbers: Vec<f64> = tokens.filter_map(|t| t.parse().ok()).collect();
    let [_, _, width, height] = numbers[..] else { return Ok(metres) };
    // The smaller one: the drawing is fitted into the page, not stretched.
    let (across, along) = (f64::from(tree.size().width()) / width, f64::from(tree.size().height()) / height);
    let px_per_unit = across.min(along);
    if px_per_unit > 0.0 && px_per_unit.is_finite() {
        Ok(metres / px_per_unit)
    } else {
        Err(PlanError::NoScale)
    }
}

/// How the page lies in the map.
struct Page {
    metres_per_px: f64,
    height_px: f64,
}

impl Page {
    fn add_group(&self, walls: &mut Vec<Wall>, group: &Group) -> Result<(), PlanError> {
        for node in group.children() {
            match node {
                Node::Group(inner) => self.add_group(walls, inner)?,
                Node::Path(path) if path.is_visible() => {
                    // None where the transform makes nothing of it.
                    if let Some(shape) = path.data().clone().transform(path.abs_transform()) {
                        self.add_path(walls, shape.segments())?;
                    }
                }
                Node::Path(_) | Node::Image(_) | Node::Text(_) => {}
            }
        }
        Ok(())
    }

    fn add_path(
        &self,
        walls: &mut Vec<Wall>,
        segments: impl Iterator<Item = PathSegment>,
    ) -> Result<(), PlanError> {
        let (mut start, mut at) = ([0.0; 2], [0.0; 2]);
        for segment in segments {
            match segment {
                PathSegment::MoveTo(p) => {
                    start = self.point(p);
                    at = start;
                }
                PathSegment::LineTo(p) => add_curve(walls, &mut at, &[self.point(p)])?,
                PathSegment::QuadTo(p, q) => {
                    add_curve(walls, &mut at, &[self.point(p), self.point(q)])?;
                }
                PathSegment::CubicTo(p, q, r) => {
                    add_curve(walls, &mut at, &[self.point(p), self.point(q), self.point(r)])?;
                }
                PathSegment::Close => add_curve(walls, &mut at, &[start])?,
            }
        }
        Ok(())
    }

    fn point(&self, p: Point) -> [f64; 2] {
        [f64::from(p.x) * self.metres_per_px, (self.height_px - f64::from(p.y)) * self.metres_per_px]
    }
}

/// Adds the chords of a Bezier curve from `at` through its other control points.
fn add_curve(walls: &mut Vec<Wall>, at: &mut [f64; 2], others: &[[f64; 2]]) -> Result<(), PlanError> {
    let mut controls = vec![*at];
    controls.extend(others);
    // Second differences bound how far n chords lie from the curve: degree (degree - 1) / 8 n^2 times the largest.
    let degree = others.len() as f64;
    let bend = controls
        .windows(3)
        .map(|p| [0, 1].map(|k| p[0][k] - 2.0 * p[1][k] + p[2][k]))
        .map(|d| d[0].hypot(d[1]))
        .fold(0.0, f64::max);
    let chords = (degree * (degree - 1.0) / 8.0 * bend / FLAT_M).sqrt().ceil().clamp(1.0, MAX_CHORDS);
    for k in 1..=chords as usize {
        let to = bezier(&controls, k as f64 / chords);
        if (to[0] - at[0]).hypot(to[1] - at[1]) < map::segments::MIN_SEGMENT_M {
            continue;
        }
        if walls.len() + 2 > MAX_WALLS {
            return Err(PlanError::TooMany);
        }
        walls.extend([Wall::between(*at, to), Wall::between(to, *at)]);
        *at = to;
    }
    Ok(())
}

/// The point of a Bezier curve at `s` (0 to 1), by de Casteljau.
fn bezier(controls: &[[f64; 2]], s: f64) -> [f64; 2] {
    let mut points = controls.to_vec();
    while points.len() > 1 {
        points = points.windows(2).map(|p| [0, 1].map(|k| p[0][k] + s * (p[1][k] - p[0][k]))).collect();
    }
    points[0]
}

#[cfg(test)]
mod tests {
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
        for unsized_page in
            [r#"width="800" height="400""#, r#"viewBox="0 0 9 9""#, r#"width="1in" height="9""#]
        {
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
}
