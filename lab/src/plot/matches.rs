//! Tentative matches of a patch with the taught points, those that agree on a homography, and what
//! every other taught point says where the homography puts it.

use super::{
    landmark::{Landmark, oblique},
    panels::{GAP_PX, column, explained, gray, on, ring, row, titled},
};
use anyhow::Context as _;
use cli::drawing::{Colour, GREEN, Picture, RED, WHITE, YELLOW};
use sim::exhibit::{Conditions, Exhibit};
use vision::{
    params::Params,
    points::{
        agreement::Check,
        patch::{Patch, inner_px},
        point::{Point, SeenPatch},
        verify::{Hypothesis, MAX_PATCH_POINTS, Target, global_hypothesis, verified},
    },
};

/// Both patches are enlarged to about this side.
const SIDE_PX: usize = 440;
/// Points that say nothing.
const SILENT: Colour = [140, 140, 140];

pub(crate) fn draw(landmark: &Landmark) -> anyhow::Result<Picture> {
    let taught = landmark.taught(&Params::default())?;
    // Something stands before it, so that some points find no counterpart.
    let seen = landmark.seen(&Conditions { cover: 0.1, cover_grey: 60.0, ..oblique() })?;
    let (frame, photograph) = (patch(&seen)?, patch(&taught.photograph)?);
    let target = Target::new(&taught.model.points);
    let found = global_hypothesis(&frame.points, 0, &target).context("no homography was found")?;
    let checks = found.checks(&frame, &target);
    let evidence = verified(&frame, &found, &target).context("the homography puts the corners nowhere")?;

    let side_by_side = SideBySide::new(&frame, &photograph);
    let top = side_by_side.matches(&found, &frame.points, target.points());
    let bottom = side_by_side.checks(&found, &checks, target.points());
    let outliers = found.matches.len() - found.consensus.inliers.len();
    let lines = [
        format!("matches that agree on a homography: {}", found.consensus.inliers.len()),
        format!("that do not: {outliers}"),
        format!("places that were not used: {}, of these {} agree", evidence.checked, evidence.agreeing),
        format!("log10 of the false alarms: {:.0}", evidence.log10_nfa),
    ];
    Ok(explained(
        column(&[
            titled(&top, "matches of the frame (left) with the taught photograph (right)", WHITE),
            titled(&bottom, "taught points where the homography puts them in the frame", WHITE),
        ]),
        &[
            (&lines[0], GREEN),
            (&lines[1], RED),
            ("below: looks as taught", GREEN),
            ("like something else", RED),
            ("undecided", SILENT),
            (&lines[2], YELLOW),
            (&lines[3], YELLOW),
        ],
    ))
}

fn patch(seen: &Exhibit) -> anyhow::Result<SeenPatch> {
    let patch = Patch::new(&seen.image, &seen.corners, inner_px(&seen.corners));
    patch.map(|patch| SeenPatch::new(patch, MAX_PATCH_POINTS)).context("the margin reaches the horizon")
}

/// Two patches beside each other.
struct SideBySide<'a> {
    patches: [&'a Patch; 2],
    factors: [usize; 2],
}

impl<'a> SideBySide<'a> {
    fn new(left: &'a SeenPatch, right: &'a SeenPatch) -> Self {
        let patches = [&left.patch, &right.patch];
        Self { patches, factors: patches.map(|p| (SIDE_PX / p.side).max(1)) }
    }

    fn picture(&self) -> Picture {
        let [left, right] = [0, 1].map(|i| {
            let patch = self.patches[i];
            Picture::of(&gray(patch.side, &patch.pixels), 0.7).enlarged(self.factors[i])
        });
        row(&[left, right])
    }

    /// A place on the landmark, in the left or the right patch.
    fn at(&self, i: usize, at: [f64; 2]) -> [f64; 2] {
        let [x, y] = on(self.patches[i].to_patch(at), self.factors[i]);
        [x + (i * (self.patches[0].side * self.factors[0] + GAP_PX)) as f64, y]
    }

    fn matches(&self, found: &Hypothesis, seen: &[Point], taught: &[Point]) -> Picture {
        let mut picture = self.picture();
        let is_inlier = |i: &usize| found.consensus.inliers.contains(i);
        let (inliers, outliers): (Vec<usize>, Vec<usize>) = (0..found.matches.len()).partition(is_inlier);
        for (indices, colour) in [(outliers, RED), (inliers, GREEN)] {
            for m in indices.into_iter().map(|i| found.matches[i]) {
                let from = self.at(0, seen[m.seen].at.map(f64::from));
                let to = self.at(1, taught[m.taught].at.map(f64::from));
                picture.line(from, to, 0.9, colour);
                picture.disc(from, 2.5, colour);
                picture.disc(to, 2.5, colour);
            }
        }
        picture
    }

    fn checks(&self, found: &Hypothesis, checks: &[Check], taught: &[Point]) -> Picture {
        let mut picture = self.picture();
        for check in checks {
            let at = taught[check.taught].at.map(f64::from);
            let colour = match check {
                c if c.agrees() => GREEN,
                c if c.disagrees() => RED,
                _ => SILENT,
            };
            let here = found.consensus.seen_from_taught.apply(&at.into());
            ring(&mut picture, self.at(0, here.into()), [5.0, 5.0], 1.8, colour);
            ring(&mut picture, self.at(1, at), [5.0, 5.0], 1.8, colour);
        }
        picture
    }
}
