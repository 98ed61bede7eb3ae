//! The limits as straight pieces over direction in one quarter: chords that differ from the curves
//! by at most a fifth of a millimetre.

use super::{
    envelope::{MAX_SLOPE, Piece},
    limits::Limits,
};

/// Largest distance between a curve and its chord, metres.
const MAX_SAGITTA_M: f64 = 2e-4;
/// Directions of a quarter that are always evaluated.
const GRID: u32 = 64;
/// Bisections between two of them: to 1e-8 radians.
const DEPTH: u32 = 20;
/// Bisections for the direction in which a landmark becomes visible.
const EDGE_HALVINGS: u32 = 50;
/// Smaller distances count as this, metres.
pub(super) const MIN_NEAR_M: f64 = 1e-6;

/// The occlusion edges of one quadrant.
#[derive(Default)]
pub(super) struct OcclusionEdges {
    pub far: Vec<Piece>,
    pub near: Vec<Piece>,
    /// The ranges of slope in which the landmark is visible, in order.
    pub open: Vec<(f64, f64)>,
}

/// The allowed range of distances in one direction.
#[derive(Clone, Copy)]
struct Span {
    slope: f64,
    near_m: f64,
    far_m: f64,
}

impl Span {
    /// A point at this distance, as (slope, inverse).
    fn point(&self, distance_m: f64) -> (f64, f64) {
        (self.slope, self.slope.hypot(1.0) / distance_m)
    }
}

struct ContourTracer<'a> {
    limits: &'a Limits,
    /// Direction of the quarter's axis, radians.
    ahead_rad: f64,
    made: OcclusionEdges,
}

/// The occlusion edges of the quadrant about a direction.
pub(super) fn occlusion_edges(limits: &Limits, ahead_rad: f64) -> OcclusionEdges {
    let mut follower = ContourTracer { limits, ahead_rad, made: OcclusionEdges::default() };
    let slope = |i: u32| MAX_SLOPE * (2.0 * f64::from(i) / f64::from(GRID) - 1.0);
    for i in 0..GRID {
        follower.between(slope(i), slope(i + 1), DEPTH);
    }
    follower.made
}

impl ContourTracer<'_> {
    fn span(&self, slope: f64) -> Option<Span> {
        let (near_m, far_m) = self.limits.span_m(self.ahead_rad + slope.atan())?;
        let near_m = near_m.max(MIN_NEAR_M);
        (near_m < far_m).then_some(Span { slope, near_m, far_m })
    }

    fn between(&mut self, from: f64, to: f64, depth: u32) {
        match (self.span(from), self.span(to)) {
            (Some(a), Some(b)) => self.follow(a, b, depth),
            (Some(a), None) => self.follow(a, self.edge(a, to), depth),
            (None, Some(b)) => self.follow(self.edge(b, from), b, depth),
            (None, None) => {}
        }
    }

    /// The last direction with an allowed range, between one with and one without.
    fn edge(&self, mut visible: Span, mut hidden: f64) -> Span {
        for _ in 0..EDGE_HALVINGS {
            let middle = 0.5 * (visible.slope + hidden);
            match self.span(middle) {
                Some(span) => visible = span,
                None => hidden = middle,
            }
        }
        visible
    }

    fn follow(&mut self, a: Span, b: Span, depth: u32) {
        let slope = 0.5 * (a.slope + b.slope);
        let Some(middle) = self.span(slope) else {
            if let Some(less) = depth.checked_sub(1) {
                self.between(a.slope, slope, less);
                self.between(slope, b.slope, less);
            }
            return;
        };
        let leaves = |of: fn(&Span) -> f64| {
            let chord = 0.5 * (a.point(of(&a)).1 + b.point(of(&b)).1);
            (middle.slope.hypot(1.0) / chord - of(&middle)).abs() > MAX_SAGITTA_M
        };
        if depth > 0 && (leaves(|l| l.near_m) || leaves(|l| l.far_m)) {
            self.follow(a, middle, depth - 1);
            self.follow(middle, b, depth - 1);
            return;
        }
        self.made.far.extend(Piece::through(a.point(a.far_m), b.point(b.far_m)));
        self.made.near.extend(Piece::through(a.point(a.near_m), b.point(b.near_m)));
        #[expect(clippy::float_cmp, reason = "the end of one span is the very beginning of the next")]
        match self.made.open.last_mut() {
            Some(last) if last.1 == a.slope => last.1 = b.slope,
            _ => self.made.open.push((a.slope, b.slope)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::visibility::{PanTiltCamera, VisibilityParams, envelope::Envelope, local_frame::Moved};
    use std::f64::consts::FRAC_PI_2;
    use vision::pose::LandmarkSize;

    #[test]
    fn chords_follow_the_limits() {
        let size = LandmarkSize { width_m: 0.9, height_m: 0.7 };
        let viewer = PanTiltCamera { tilt_rad: [-1.2, 1.2], ..PanTiltCamera::default() };
        for tilt_rad in [0.0, 0.5, 1.1, FRAC_PI_2, -0.8] {
            let moved = Moved { height_m: 1.2 + 1.3_f64.copysign(tilt_rad), tilt_rad, size };
            let limits = Limits::new(&moved, &viewer, &VisibilityParams::default()).unwrap();
            let mut visible = 0;
            for quarter in 0..4 {
                let ahead = f64::from(quarter) * FRAC_PI_2;
                let occlusion_edges = occlusion_edges(&limits, ahead);
                let (far, near) =
                    (Envelope::upper(occlusion_edges.far), Envelope::upper(occlusion_edges.near));
                for k in 0..997 {
                    let slope = -1.0 + 2.0 * f64::from(k) / 997.0;
                    let span = limits.span_m(ahead + slope.atan());
                    let open = occlusion_edges.open.iter().any(|(from, to)| (*from..=*to).contains(&slope));
                    assert_eq!(open, span.is_some(), "{tilt_rad} {quarter} {slope}");
                    let Some((nearest, furthest)) = span else { continue };
                    visible += 1;
                    let distance = |e: &Envelope| slope.hypot(1.0) / e.at(slope).unwrap();
                    assert!((distance(&far) - furthest).abs() < 2.0 * MAX_SAGITTA_M, "{tilt_rad} {slope}");
                    assert!((distance(&near) - nearest).abs() < 2.0 * MAX_SAGITTA_M, "{tilt_rad} {slope}");
                }
            }
            assert!(visible > 100, "{tilt_rad}: {visible}");
        }
    }
}
