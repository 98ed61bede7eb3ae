//! The final fit: every keyframe is matched to others of the same place, and all poses are fitted
//! to the results, in a few rounds. In: keyframes that are nearly right. Out: better poses, and the
//! constraints that determine them.

use crate::{
    pose2::Pose2,
    slam::{
        graph::{self, GraphError, PoseConstraint},
        icp::align,
        keyframe::Keyframe,
        loop_closure::LoopCloser,
        params::SlamParams,
        surface_index::SurfaceIndex,
    },
};

/// Moves the keyframes; gives all constraints of the last fit.
pub(super) fn refine(
    keys: &mut [Keyframe],
    path: &[PoseConstraint],
    closures: &mut LoopCloser,
    p: &SlamParams,
) -> Result<Vec<PoseConstraint>, GraphError> {
    let base = |closures: &LoopCloser| -> Vec<PoseConstraint> {
        path.iter().chain(closures.edges()).copied().collect()
    };
    let mut edges = base(closures);
    let mut poses: Vec<Pose2> = keys.iter().map(|k| k.pose).collect();
    for _ in 0..p.refine.rounds {
        let found = pairs(keys, p);
        edges = base(closures);
        edges.extend(found);
        graph::optimise(&mut poses, &edges)?;
        if closures.prune(&poses, &p.loops) {
            edges.retain(|e| e.doubt_chi2 != Some(p.loops.doubt_chi2) || closures.edges().contains(e));
            graph::optimise(&mut poses, &edges)?;
        }
        for (key, pose) in keys.iter_mut().zip(&poses) {
            key.pose = *pose;
        }
    }
    Ok(edges)
}

/// Matches of keyframes with their nearest partners.
fn pairs(keys: &[Keyframe], p: &SlamParams) -> Vec<PoseConstraint> {
    let r = &p.refine;
    let mut edges = Vec::new();
    for (i, key) in keys.iter().enumerate() {
        let reference =
            SurfaceIndex::new(std::iter::once((Pose2::default(), &key.cloud)), p.align.start_radius_m);
        let mut near: Vec<(usize, f64)> = keys[i + 1..]
            .iter()
            .enumerate()
            .map(|(k, other)| {
                let between = key.pose.between(&other.pose);
                // A turn changes the visible walls as much as a distance.
                (i + 1 + k, between.position().norm() + between.theta_rad.abs())
            })
            .filter(|(_, d)| *d <= r.near_m)
            .collect();
        near.sort_by(|a, b| a.1.total_cmp(&b.1));
        // Half of the partners from the same passage, half from others.
        let later = |k: usize| keys[k].path_m - key.path_m > p.loops.min_way_m;
        let same = near.iter().filter(|(k, _)| !later(*k)).take(r.partners.div_ceil(2));
        let other = near.iter().filter(|(k, _)| later(*k)).take(r.partners.div_ceil(2));
        for (k, _) in same.chain(other) {
            let guess = key.pose.between(&keys[*k].pose);
            let Some(a) = align(&reference, &keys[*k].cloud, &guess, None, &p.align) else { continue };
            let d = a.pose.minus(&guess);
            if a.matched < r.min_matched || d.xy().norm() > r.max_move_m || d.z.abs() > 0.2 {
                continue;
            }
            edges.push(PoseConstraint {
                from: i,
                to: *k,
                measured: a.pose,
                information: a.information,
                doubt_chi2: Some(r.doubt_chi2),
            });
        }
    }
    edges
}
