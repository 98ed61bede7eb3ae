//! Clip paths: what of a line lies inside of them.

use super::Page;
use usvg::{ClipPath, Group, Node, Transform};

/// Most edges of a clip path; one with more cuts nothing off. Most are rectangles.
const MAX_EDGES: usize = 256;

/// The region of a clip path, metres.
#[derive(Debug, Clone)]
pub(super) struct Clip {
    /// Directed edges of its shapes.
    edges: Vec<[[f64; 2]; 2]>,
    /// The clip path of the clip path.
    outer: Option<Box<Clip>>,
}

impl Clip {
    /// `transform` is that of the group that is clipped.
    pub(super) fn of(clip: &ClipPath, transform: Transform, page: &Page) -> Self {
        let transform = transform.pre_concat(clip.transform());
        let mut edges = Vec::new();
        add_edges(&mut edges, clip.root(), transform, page);
        let outer = clip.clip_path().map(|outer| Box::new(Self::of(outer, transform, page)));
        Self { edges, outer }
    }

    /// Edges of it and of its own clip paths.
    pub(super) fn len(&self) -> usize {
        self.edges.len() + self.outer.as_ref().map_or(0, |outer| outer.len())
    }

    /// The parts of a line inside.
    pub(super) fn inside(&self, line: &[[f64; 2]; 2]) -> Vec<[[f64; 2]; 2]> {
        let own = if self.edges.len() > MAX_EDGES { vec![*line] } else { self.own(line) };
        match &self.outer {
            Some(outer) => own.iter().flat_map(|part| outer.inside(part)).collect(),
            None => own,
        }
    }

    fn own(&self, [a, b]: &[[f64; 2]; 2]) -> Vec<[[f64; 2]; 2]> {
        let mut cuts: Vec<f64> = self.edges.iter().filter_map(|edge| crossing([*a, *b], *edge)).collect();
        cuts.extend([0.0, 1.0]);
        cuts.sort_by(f64::total_cmp);
        let at = |s: f64| [0, 1].map(|k| a[k] + s * (b[k] - a[k]));
        let mut parts: Vec<[f64; 2]> = Vec::new();
        for pair in cuts.windows(2) {
            if !self.holds(at(0.5 * (pair[0] + pair[1]))) {
                continue;
            }
            match parts.last_mut() {
                Some(last) if last[1] >= pair[0] => last[1] = pair[1],
                _ => parts.push([pair[0], pair[1]]),
            }
        }
        parts.iter().map(|[from, to]| [at(*from), at(*to)]).collect()
    }

    /// Whether a point lies inside: its edges wind about it.
    fn holds(&self, p: [f64; 2]) -> bool {
        let turn = |[a, b]: &[[f64; 2]; 2]| {
            let is_left = (b[0] - a[0]) * (p[1] - a[1]) - (p[0] - a[0]) * (b[1] - a[1]);
            match (a[1] <= p[1], b[1] <= p[1]) {
                (true, false) if is_left > 0.0 => 1,
                (false, true) if is_left < 0.0 => -1,
                _ => 0,
            }
        };
        self.edges.iter().map(turn).sum::<i32>() != 0
    }
}

fn add_edges(edges: &mut Vec<[[f64; 2]; 2]>, group: &Group, transform: Transform, page: &Page) {
    for node in group.children() {
        match node {
            Node::Group(inner) => add_edges(edges, inner, transform, page),
            Node::Path(path) => {
                let whole = transform.pre_concat(path.abs_transform());
                if let Some(shape) = path.data().clone().transform(whole) {
                    edges.extend(page.chords(shape.segments()));
                }
            }
            Node::Image(_) | Node::Text(_) => {}
        }
    }
}

/// Where on the line, 0 to 1, an edge crosses it.
fn crossing([a, b]: [[f64; 2]; 2], [c, d]: [[f64; 2]; 2]) -> Option<f64> {
    let cross = |u: [f64; 2], v: [f64; 2]| u[0] * v[1] - u[1] * v[0];
    let (line, edge) = ([b[0] - a[0], b[1] - a[1]], [d[0] - c[0], d[1] - c[1]]);
    let between = [c[0] - a[0], c[1] - a[1]];
    let area = cross(line, edge);
    let (on_line, on_edge) = (cross(between, edge) / area, cross(between, line) / area);
    ((0.0..=1.0).contains(&on_line) && (0.0..=1.0).contains(&on_edge)).then_some(on_line)
}
