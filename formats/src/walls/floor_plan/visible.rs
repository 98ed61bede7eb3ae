//! Which shapes of a plan are seen, and are not its page.

use usvg::{Paint, Path, Rect, Size};

/// A shape that covers so much of the page's sides, without an outline, is its background.
const PAGE_SHARE: f32 = 0.98;
/// Channels of a colour from this on are white.
const WHITE: u8 = 250;
/// Most filled shapes that are remembered.
const MAX_FILLED: usize = 1000;
/// Most edges of clip paths of a plan; later ones cut nothing off.
const MAX_CLIP_EDGES: usize = 1 << 20;

/// What was drawn so far.
#[derive(Debug)]
pub(super) struct Drawn {
    page: Size,
    /// Boxes of filled shapes that are not white.
    filled: Vec<Rect>,
    clip_edges: usize,
}

impl Drawn {
    pub(super) fn on(page: Size) -> Self {
        Self { page, filled: Vec::new(), clip_edges: 0 }
    }

    pub(super) fn may_clip(&self) -> bool {
        self.clip_edges < MAX_CLIP_EDGES
    }

    pub(super) fn count_clip(&mut self, edges: usize) {
        self.clip_edges += edges;
    }

    /// Whether the next shape is seen: it has an outline, or a fill that is neither the page nor
    /// white on white.
    pub(super) fn is_seen(&mut self, path: &Path) -> bool {
        let fill = path.fill().filter(|fill| fill.opacity().get() > 0.0);
        let is_white = fill.is_some_and(|fill| is_white(fill.paint()));
        let bounds = path.abs_bounding_box();
        let is_page = bounds.width() >= PAGE_SHARE * self.page.width()
            && bounds.height() >= PAGE_SHARE * self.page.height();
        let is_outlined = path.stroke().is_some_and(|stroke| stroke.opacity().get() > 0.0);
        let is_inside = |of: &Rect| {
            of.left() <= bounds.left()
                && of.top() <= bounds.top()
                && of.right() >= bounds.right()
                && of.bottom() >= bounds.bottom()
        };
        // White rooms on dark ground are seen.
        let is_on_dark = is_white && self.filled.iter().any(is_inside);
        if path.is_visible() && fill.is_some() && !is_white && self.filled.len() < MAX_FILLED {
            self.filled.push(bounds);
        }
        // A pattern is a grid or a hatching, not what bounds it.
        let is_pattern = fill.is_some_and(|fill| matches!(fill.paint(), Paint::Pattern(_)));
        let is_filled = fill.is_some() && !is_pattern && !is_page && (!is_white || is_on_dark);
        path.is_visible() && (is_outlined || is_filled)
    }
}

fn is_white(paint: &Paint) -> bool {
    matches!(paint, Paint::Color(colour) if [colour.red, colour.green, colour.blue].iter().all(|c| *c >= WHITE))
}
