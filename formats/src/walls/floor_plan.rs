//! Walls from a floor plan in SVG: paths, lines, polylines, polygons, rectangles, circles and
//! ellipses, with their transforms, units and styles resolved.
//!
//! In: the text of a file and its scale. Out: walls in metres, the origin at the lower left corner
//! of the page, y up. A plan does not say on which side the floor is, so each line becomes two
//! walls, one for each side. What nobody sees is no wall: the page's background, transparent
//! shapes, and what a clip path cuts off.

mod clip;
mod visible;

use super::map_file::{MAX_WALLS, Wall};
use clip::Clip;
use usvg::{
    Group, ImageHrefResolver, Node, Options, Tree, roxmltree,
    tiny_skia_path::{PathSegment, Point},
};
use visible::Drawn;

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
        "the plan has no scale: say how many metres one of its units is, or give its width and height in mm, cm, in or pt"
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

/// The walls of a file's text. `metres_per_unit` is the length of one user unit (that of the
/// `viewBox`); without it the document's own physical size counts, as drawn at 1:1.
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
    let mut drawn = Drawn::on(tree.size());
    let mut walls = Vec::new();
    page.add_group(&mut walls, tree.root(), &[], &mut drawn)?;
    if walls.is_empty() { Err(PlanError::NoLines) } else { Ok(walls) }
}

fn scale(root: roxmltree::Node, tree: &Tree, metres_per_unit: Option<f64>) -> Result<f64, PlanError> {
    let Some(metres) = metres_per_unit else {
        // A side that is left out follows from the other by the `viewBox`.
        let is_given = |name: &str| root.attribute(name).is_some_and(|value| value.trim() != "auto");
        let is_physical = |name: &str| {
            let value = root.attribute(name).unwrap_or_default().trim();
            PHYSICAL.iter().any(|unit| value.ends_with(unit))
        };
        let sides = ["width", "height"];
        let is_sized = sides.iter().any(|side| is_physical(side))
            && sides.iter().all(|side| is_physical(side) || !is_given(side));
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
    fn add_group(
        &self,
        walls: &mut Vec<Wall>,
        group: &Group,
        clips: &[Clip],
        drawn: &mut Drawn,
    ) -> Result<(), PlanError> {
        if group.opacity().get() <= 0.0 {
            return Ok(());
        }
        let own = group.clip_path().filter(|_| drawn.may_clip());
        let own = own.map(|clip| Clip::of(clip, group.abs_transform(), self));
        let Some(own) = own else { return self.add_children(walls, group, clips, drawn) };
        drawn.count_clip(own.len());
        self.add_children(walls, group, &[clips, &[own]].concat(), drawn)
    }

    fn add_children(
        &self,
        walls: &mut Vec<Wall>,
        group: &Group,
        clips: &[Clip],
        drawn: &mut Drawn,
    ) -> Result<(), PlanError> {
        for node in group.children() {
            match node {
                Node::Group(inner) => self.add_group(walls, inner, clips, drawn)?,
                Node::Path(path) if drawn.is_seen(path) => {
                    // None where the transform makes nothing of it.
                    if let Some(shape) = path.data().clone().transform(path.abs_transform()) {
                        for [a, b] in self.chords(shape.segments()) {
                            add_line(walls, a, b, clips)?;
                        }
                    }
                }
                Node::Path(_) | Node::Image(_) | Node::Text(_) => {}
            }
        }
        Ok(())
    }

    /// The chords of a path, metres.
    fn chords(&self, segments: impl Iterator<Item = PathSegment>) -> Vec<[[f64; 2]; 2]> {
        let mut chords = Vec::new();
        let (mut start, mut at) = ([0.0; 2], [0.0; 2]);
        for segment in segments {
            match segment {
                PathSegment::MoveTo(p) => {
                    start = self.point(p);
                    at = start;
                }
                PathSegment::LineTo(p) => add_curve(&mut chords, &mut at, &[self.point(p)]),
                PathSegment::QuadTo(p, q) => {
                    add_curve(&mut chords, &mut at, &[self.point(p), self.point(q)]);
                }
                PathSegment::CubicTo(p, q, r) => {
                    add_curve(&mut chords, &mut at, &[self.point(p), self.point(q), self.point(r)]);
                }
                PathSegment::Close => add_curve(&mut chords, &mut at, &[start]),
            }
        }
        chords
    }

    fn point(&self, p: Point) -> [f64; 2] {
        [f64::from(p.x) * self.metres_per_px, (self.height_px - f64::from(p.y)) * self.metres_per_px]
    }
}

/// Adds the chords of a Bezier curve from `at` through its other control points.
fn add_curve(chords: &mut Vec<[[f64; 2]; 2]>, at: &mut [f64; 2], others: &[[f64; 2]]) {
    let mut controls = vec![*at];
    controls.extend(others);
    // Second differences bound how far n chords lie from the curve: degree (degree - 1) / 8 n^2
    // times the largest.
    let degree = others.len() as f64;
    let bend = controls
        .windows(3)
        .map(|p| [0, 1].map(|k| p[0][k] - 2.0 * p[1][k] + p[2][k]))
        .map(|d| d[0].hypot(d[1]))
        .fold(0.0, f64::max);
    let count = (degree * (degree - 1.0) / 8.0 * bend / FLAT_M).sqrt().ceil().clamp(1.0, MAX_CHORDS);
    for k in 1..=count as usize {
        let to = bezier(&controls, k as f64 / count);
        if (to[0] - at[0]).hypot(to[1] - at[1]) < map::segments::MIN_SEGMENT_M {
            continue;
        }
        chords.push([*at, to]);
        *at = to;
    }
}

/// Adds the walls of the parts of a line that the clip paths leave.
fn add_line(walls: &mut Vec<Wall>, a: [f64; 2], b: [f64; 2], clips: &[Clip]) -> Result<(), PlanError> {
    let mut parts = vec![[a, b]];
    for clip in clips {
        parts = parts.iter().flat_map(|part| clip.inside(part)).collect();
    }
    for [a, b] in parts {
        if (b[0] - a[0]).hypot(b[1] - a[1]) < map::segments::MIN_SEGMENT_M {
            continue;
        }
        if walls.len() + 2 > MAX_WALLS {
            return Err(PlanError::TooMany);
        }
        walls.extend([Wall::between(a, b), Wall::between(b, a)]);
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
mod tests;
