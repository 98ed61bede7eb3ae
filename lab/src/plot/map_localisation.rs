//! The robot's pose by the landmarks of one frame: one landmark, two landmarks, and the ambiguity of a plane seen from
//! afar (method 13.4 to 13.6).

use super::{
    map_plan::{ESTIMATE, FAINT, LANDMARK, Plan, Sign, TRUTH, WALL, legend, page, title},
    map_scene::{SIGMA_PX, aimed, around, centre, fixes, look, poster, the_fix},
};
use crate::evaluate::{
    chart::COLOURS,
    pose::joint::{drawn, mounting_error, with_error},
};
use anyhow::Context as _;
use formats::svg::text;
use map::{
    localise::{AmbiguityResolvedBy, Fix, LandmarkObservation},
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Point2, Point3, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};
use vision::{model::LandmarkId, pose::LandmarkPose, random::Random};

/// Distance (m) and azimuth from the normal (degrees) of the robots.
const SPOTS: [(f64, f64); 5] = [(2.2, 0.0), (4.4, 0.0), (3.4, 38.0), (3.8, -25.0), (4.3, -50.0)];
/// Frames of each robot beside the one whose ellipse is drawn.
const FRAMES: usize = 30;
/// Factor on errors of fixes in the picture.
const ENLARGED: f64 = 2.0;
const SEED: u64 = 7;
/// Distance of the second poster from the first, metres.
const BESIDE_M: f64 = 1.1;
const PRIOR: &str = COLOURS[3];
const SECOND: &str = COLOURS[4];

/// A robot that looks at a place from `d_m` and `psi_deg`.
fn robot(place: &LandmarkPlace, (d_m, psi_deg): (f64, f64)) -> Pose2 {
    let a = place.theta_rad + psi_deg.to_radians();
    Pose2::new(place.x_m + d_m * a.cos(), place.y_m + d_m * a.sin(), a + PI)
}

/// A fix by `places` from a robot, with everything that is uncertain drawn anew.
fn drawn_fix(robot: &Pose2, places: &[LandmarkPlace], random: &mut Random) -> anyhow::Result<Option<Fix>> {
    let mean = places.iter().map(|p| centre(p).coords).sum::<Vector3<f64>>() / places.len() as f64;
    let mounting = aimed(robot, &Point3::from(mean))?;
    let real = with_error(&mounting, &mounting_error(&mounting.covariance, random));
    let seen: Option<Vec<LandmarkPose>> =
        places.iter().map(|p| look(robot, &real, &drawn(p, random), SIGMA_PX, random)).collect();
    let seen = seen.context("in the image")?;
    let observations: Vec<LandmarkObservation<'_>> = seen
        .iter()
        .zip(places)
        .enumerate()
        .map(|(i, (seen, place))| LandmarkObservation { landmark: LandmarkId(i as u64), seen, place })
        .collect();
    let mut found = fixes(&observations, &mounting, None)?;
    Ok((found.len() == 1).then(|| found.swap_remove(0)))
}

/// The picture.
pub(super) fn svg() -> anyhow::Result<String> {
    let first = poster(0.0, 0.0, -FRAC_PI_2)?;
    let second = poster(BESIDE_M, 0.0, -FRAC_PI_2)?;
    let others =
        format!("fixes of {FRAMES} other frames, all errors drawn anew, twice as far from the truth");
    page([1200.0, 480.0], |svg| {
        title(svg, (20.0, 26.0), "One landmark");
        spots(svg, 20.0, &[first])?;
        title(svg, (420.0, 26.0), "Two landmarks in the same frame");
        spots(svg, 420.0, &[first, second])?;
        title(svg, (820.0, 26.0), "One landmark from afar: two poses fit");
        ambiguity(svg, &first)?;
        legend(
            svg,
            (20.0, 405.0),
            &[
                (Sign::Landmark, LANDMARK, "landmark on its wall"),
                (Sign::Cross, TRUTH, "true pose of a robot"),
                (
                    Sign::Ellipse,
                    ESTIMATE,
                    "95 % ellipse of one fix, twice as large; words: its standard deviations",
                ),
                (Sign::Dot, ESTIMATE, &others),
            ],
        );
        legend(
            svg,
            (820.0, 405.0),
            &[
                (Sign::Ellipse, ESTIMATE, "the two solutions, best first:"),
                (Sign::Ellipse, SECOND, "without a prior neither is used"),
                (Sign::Ellipse, PRIOR, "prior pose that decides between them"),
                (Sign::Cross, TRUTH, "true pose"),
            ],
        );
        Ok(())
    })
}

fn floor(left_px: f64) -> Plan {
    Plan::new((left_px, 44.0), [[-4.3, -5.6], [3.4, 0.3]], 47.0)
}

fn wall(svg: &mut String, plan: &Plan, places: &[LandmarkPlace]) {
    let ends = [Point2::new(-4.3, 0.0), Point2::new(3.4, 0.0)];
    plan.line(svg, ends, &format!(r#"stroke="{WALL}" stroke-width="2.5""#));
    for place in places {
        plan.landmark(svg, place, LANDMARK);
    }
    plan.scale_bar(svg, 1.0);
}

fn spots(svg: &mut String, left_px: f64, places: &[LandmarkPlace]) -> anyhow::Result<()> {
    let plan = floor(left_px);
    wall(svg, &plan, places);
    let mut random = Random::new(SEED);
    for spot in SPOTS {
        let truth = robot(&places[0], spot);
        let fix = std::iter::repeat_with(|| drawn_fix(&truth, places, &mut random))
            .take(FRAMES)
            .find_map(Result::transpose)
            .context("no frame gave one pose")??;
        let others: Vec<Fix> = (0..FRAMES)
            .filter_map(|_| drawn_fix(&truth, places, &mut random).transpose())
            .collect::<anyhow::Result<_>>()?;
        let enlarged = |pose: &Pose2| truth.plus(&(pose.minus(&truth) * ENLARGED));
        let drawn = Pose2Covariance {
            pose: enlarged(&fix.pose.pose),
            covariance: fix.pose.covariance * ENLARGED * ENLARGED,
        };
        plan.pose_ellipse(svg, &drawn, ESTIMATE);
        plan.dots(svg, others.iter().map(|f| enlarged(&f.pose.pose).position().into()), (1.2, ESTIMATE));
        plan.cross(svg, &truth.position().into(), TRUTH);
        let sigma = |k: usize| fix.pose.covariance[(k, k)];
        let (position_m, heading) = ((sigma(0) + sigma(1)).sqrt(), sigma(2).sqrt().to_degrees());
        let words = format!("{position_m:.2} m, {heading:.1} deg");
        plan.label(svg, &truth.position().into(), ("middle", [0.0, 30.0]), &words);
    }
    Ok(())
}

/// The first frame of a poster from afar that two poses fit, and what a prior makes of it.
fn ambiguity(svg: &mut String, place: &LandmarkPlace) -> anyhow::Result<()> {
    let plan = floor(820.0);
    wall(svg, &plan, std::slice::from_ref(place));
    let truth = robot(place, (5.2, 22.0));
    let mounting = aimed(&truth, &centre(place))?;
    let mut random = Random::new(SEED);
    let mut frames = std::iter::repeat_with(|| look(&truth, &mounting, place, 1.5, &mut random)).take(200);
    let (seen, both) = frames
        .find_map(|seen| {
            let seen = seen?;
            let observed = [LandmarkObservation { landmark: LandmarkId(0), seen: &seen, place }];
            let both = fixes(&observed, &mounting, None).ok().filter(|f| f.len() == 2)?;
            Some((seen, both))
        })
        .context("no frame of 200 is ambiguous")?;
    for (fix, colour) in both.iter().zip([ESTIMATE, SECOND]) {
        let pose = &fix.pose;
        let sight = [pose.pose.position().into(), Point2::new(place.x_m, place.y_m)];
        plan.line(svg, sight, &format!(r#"stroke="{FAINT}" stroke-dasharray="4 3""#));
        plan.pose_ellipse(svg, pose, colour);
        plan.robot(svg, &pose.pose, colour);
        let words = format!("chi2 {:.1}", fix.chi2);
        plan.label(svg, &pose.pose.position().into(), ("start", [14.0, 4.0]), &words);
    }
    plan.cross(svg, &truth.position().into(), TRUTH);
    let prior = around(truth.plus(&Vector3::new(0.25, -0.2, 0.03)), [0.3, 0.3, 0.08])?;
    let observed = [LandmarkObservation { landmark: LandmarkId(0), seen: &seen, place }];
    let fix = the_fix(&observed, &mounting, Some(&prior))?;
    anyhow::ensure!(fix.decided_by == AmbiguityResolvedBy::Prior, "the prior decides");
    plan.pose_ellipse(svg, &prior, PRIOR);
    verdict(svg, &both, &fix, &prior);
    Ok(())
}

/// Which solution the prior chose.
fn verdict(svg: &mut String, both: &[Fix], chosen: &Fix, prior: &Pose2Covariance) {
    let number = 1 + both.iter().position(|f| f.pose.pose == chosen.pose.pose).unwrap_or(0);
    let distances: Vec<String> =
        both.iter().map(|f| format!("{:.1}", f.pose.distance2(prior).unwrap_or(f64::INFINITY))).collect();
    let words = format!("squared distances to the prior {}: solution {number}", distances.join(" and "));
    text(svg, (820.0, 368.0), "start", &words);
}
