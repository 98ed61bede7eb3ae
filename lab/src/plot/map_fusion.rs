//! A drive with gaps between its landmarks: odometry, fixes, the fused pose with its ellipses; and a fix that comes
//! late and is put where it belongs (method 15.1).

use super::{
    map_plan::{ESTIMATE, LANDMARK, ODOMETRY, Plan, Sign, TRUTH, legend, page, title},
    map_scene::{SIGMA_PX, aimed, around, centre, fixes, look, poster},
};
use crate::evaluate::chart::COLOURS;
use anyhow::Context as _;
use map::{
    extrinsics::CameraExtrinsics,
    fuse::{FixOutcome, FuseParams, Fuser},
    localise::{Fix, LandmarkObservation},
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::Point2;
use sim::odometry::{Odometry, OdometryParams};
use std::f64::consts::{FRAC_PI_2, PI};
use vision::{model::LandmarkId, pose::LandmarkPose, random::Random};

/// x, y, direction of the normal.
const POSTERS: [[f64; 3]; 3] = [[3.3, 0.0, FRAC_PI_2], [12.0, 3.1, PI], [3.2, 6.5, -FRAC_PI_2]];
/// The room, and a partition between the two ways.
const WALLS: [[f64; 4]; 5] = [
    [0.0, 0.0, 12.0, 0.0],
    [12.0, 0.0, 12.0, 6.5],
    [12.0, 6.5, 0.0, 6.5],
    [0.0, 6.5, 0.0, 0.0],
    [1.0, 3.25, 9.0, 3.25],
];
const START: Pose2 = Pose2 { x_m: 1.4, y_m: 1.3, theta_rad: 0.0 };
const STEP_M: f64 = 0.05;
const STEP_NS: i64 = 100_000_000;
/// A frame each so many steps.
const FRAME_STEPS: usize = 3;
/// Farthest landmark that is looked at, metres.
const REACH_M: f64 = 2.4;
/// Steps by which the first fix of the last poster is late.
const LATE_STEPS: i64 = 12;
const SEED: u64 = 5;
const FIX: &str = COLOURS[3];
const REPLAYED: &str = COLOURS[4];

struct Moment {
    truth: Pose2,
    odometry: Pose2,
    fused: Pose2Covariance,
    is_corrected: bool,
}

/// A fix that came late: the fused poses of the last seconds before and after it was applied.
struct LateFix {
    fix: Fix,
    truth: Vec<Pose2>,
    before: Vec<Pose2Covariance>,
    after: Vec<Pose2Covariance>,
    /// Index of the pose at the time of its frame.
    captured: usize,
}

struct Drive {
    posters: Vec<LandmarkPlace>,
    moments: Vec<Moment>,
    late: LateFix,
}

/// True motions of a step: up the room, round the partition, and back.
fn motions() -> Vec<Pose2> {
    let straight = |metres: f64| vec![Pose2::new(STEP_M, 0.0, 0.0); (metres / STEP_M).round() as usize];
    let radius_m = 1.2;
    let corner =
        vec![Pose2::new(STEP_M, 0.0, STEP_M / radius_m); (FRAC_PI_2 * radius_m / STEP_M).round() as usize];
    [straight(8.1), corner.clone(), straight(1.5), corner, straight(8.1)].concat()
}

/// What a robot sees of a landmark, with the camera turned to it.
struct Frame {
    poster: usize,
    seen: LandmarkPose,
    mounting: CameraExtrinsics,
}

impl Drive {
    fn new() -> anyhow::Result<Self> {
        let posters: Vec<LandmarkPlace> =
            POSTERS.iter().map(|&[x, y, theta]| poster(x, y, theta)).collect::<Result<_, _>>()?;
        let wrong =
            OdometryParams { scale_error: 0.03, heading_bias_rad_per_m: 0.012, ..OdometryParams::default() };
        let (mut odometry, mut random) = (Odometry::new(wrong, START, SEED), Random::new(SEED));
        let mut fuser = Fuser::new(FuseParams::default());
        let (mut truth, mut at_ns) = (START, 0);
        fuser.apply_odometry(at_ns, odometry.pose())?;
        fuser.start(&around(START, [0.05, 0.05, 0.01])?)?;
        let (mut moments, mut waiting, mut late) = (Vec::<Moment>::new(), None, None);
        for (i, motion) in motions().iter().enumerate() {
            truth = truth.compose(motion);
            at_ns += STEP_NS;
            fuser.apply_odometry(at_ns, odometry.advance(motion))?;
            let mut is_corrected = false;
            let frame = (i % FRAME_STEPS == 0 && waiting.is_none())
                .then(|| frame(&truth, &posters, &mut random))
                .flatten();
            if let Some(frame) = frame {
                let prior = fuser.pose_at(at_ns);
                let observed = [LandmarkObservation {
                    landmark: LandmarkId(frame.poster as u64),
                    seen: &frame.seen,
                    place: &posters[frame.poster],
                }];
                if let [fix] = &fixes(&observed, &frame.mounting, prior.as_ref())?[..] {
                    if frame.poster == posters.len() - 1 && late.is_none() {
                        waiting = Some((at_ns, fix.clone()));
                    } else {
                        let outcome = fuser.apply_fix(at_ns, fix)?;
                        is_corrected = matches!(outcome, FixOutcome::Applied { .. });
                    }
                }
            }
            let arrives = waiting.as_ref().is_some_and(|(t, _)| at_ns == t + LATE_STEPS * STEP_NS);
            if let Some((captured_ns, fix)) = waiting.take_if(|_| arrives) {
                late = Some(LateFix::applied(&mut fuser, (captured_ns, fix), at_ns, (&moments, truth))?);
                is_corrected = true;
            }
            let fused = fuser.pose().context("a fused pose")?.pose;
            moments.push(Moment { truth, odometry: odometry.pose(), fused, is_corrected });
        }
        Ok(Self { posters, moments, late: late.context("no fix was late")? })
    }
}

/// The nearest poster within reach, if all of it is in the image.
fn frame(truth: &Pose2, posters: &[LandmarkPlace], random: &mut Random) -> Option<Frame> {
    let away = |p: &LandmarkPlace| (p.x_m - truth.x_m).hypot(p.y_m - truth.y_m);
    let poster = (0..posters.len()).min_by(|a, b| away(&posters[*a]).total_cmp(&away(&posters[*b])))?;
    let place = &posters[poster];
    let mounting = aimed(truth, &centre(place)).ok()?;
    let seen = look(truth, &mounting, place, SIGMA_PX, random)?;
    (away(place) < REACH_M).then_some(Frame { poster, seen, mounting })
}

impl LateFix {
    /// Applies a fix at the time of its frame, and keeps the poses around it from before and after.
    fn applied(
        fuser: &mut Fuser,
        (captured_ns, fix): (i64, Fix),
        now_ns: i64,
        (moments, truth): (&[Moment], Pose2),
    ) -> anyhow::Result<Self> {
        // As far back as the fusion can replay.
        let count = LATE_STEPS + 6;
        let times = |fuser: &Fuser| -> Option<Vec<Pose2Covariance>> {
            (0..=count).rev().map(|k| fuser.pose_at(now_ns - k * STEP_NS)).collect()
        };
        let before = times(fuser).context("poses of the window")?;
        let outcome = fuser.apply_fix(captured_ns, &fix)?;
        anyhow::ensure!(
            matches!(outcome, FixOutcome::Applied { .. }),
            "the late fix is applied: {outcome:?}"
        );
        let after = times(fuser).context("poses of the window")?;
        let past = &moments[moments.len() - count as usize..];
        let truth = past.iter().map(|m| m.truth).chain([truth]).collect();
        Ok(Self { fix, truth, before, after, captured: (count - LATE_STEPS) as usize })
    }
}

/// The picture.
pub(super) fn svg() -> anyhow::Result<String> {
    let drive = Drive::new()?;
    page([1160.0, 560.0], |svg| {
        whole(svg, &drive);
        late(svg, &drive.late);
        legend(
            svg,
            (40.0, 492.0),
            &[
                (Sign::Line, TRUTH, "true path"),
                (Sign::Line, ODOMETRY, "odometry alone"),
                (Sign::Landmark, LANDMARK, "landmarks"),
            ],
        );
        legend(
            svg,
            (240.0, 492.0),
            &[
                (Sign::Line, ESTIMATE, "fused pose; dots: corrected by a fix"),
                (Sign::Ellipse, ESTIMATE, "95 % of it, each metre"),
            ],
        );
        legend(
            svg,
            (720.0, 450.0),
            &[
                (Sign::Line, TRUTH, "true path"),
                (Sign::Ellipse, ESTIMATE, "fused pose as it was believed until the fix arrived"),
                (Sign::Ellipse, FIX, "the fix, at the time of its frame; arrives 1.2 s later"),
                (Sign::Ellipse, REPLAYED, "the same seconds replayed with the fix"),
            ],
        );
        Ok(())
    })
}

fn whole(svg: &mut String, drive: &Drive) {
    title(svg, (40.0, 26.0), "A drive past three landmarks");
    let plan = Plan::new((40.0, 44.0), [[-0.2, -0.2], [12.2, 6.7]], 52.0);
    let walls: Vec<[Point2<f64>; 2]> =
        WALLS.iter().map(|w| [Point2::new(w[0], w[1]), Point2::new(w[2], w[3])]).collect();
    plan.walls(svg, walls.iter().map(|[a, b]| (a, b)));
    for place in &drive.posters {
        plan.landmark(svg, place, LANDMARK);
    }
    let line = |of: fn(&Moment) -> Pose2| drive.moments.iter().map(move |m| Point2::from(of(m).position()));
    plan.line(svg, line(|m| m.odometry), &format!(r#"stroke="{ODOMETRY}" stroke-width="1.5""#));
    plan.line(svg, line(|m| m.truth), &format!(r#"stroke="{TRUTH}" stroke-width="1.5""#));
    plan.line(svg, line(|m| m.fused.pose), &format!(r#"stroke="{ESTIMATE}" stroke-width="1.5""#));
    let each = (1.0 / STEP_M).round() as usize;
    for moment in drive.moments.iter().skip(each - 1).step_by(each) {
        plan.pose_ellipse(svg, &moment.fused, ESTIMATE);
    }
    let corrected = drive.moments.iter().filter(|m| m.is_corrected);
    plan.dots(svg, corrected.map(|m| m.fused.pose.position().into()), (2.2, ESTIMATE));
    plan.robot(svg, &START, TRUTH);
    plan.label(svg, &Point2::from(START.position()), ("middle", [0.0, 26.0]), "start");
    plan.scale_bar(svg, 1.0);
}

fn late(svg: &mut String, late: &LateFix) {
    title(svg, (720.0, 26.0), "A late fix is replayed at its time (drive to the left)");
    let points = late.truth.iter().chain(late.before.iter().map(|p| &p.pose));
    let middle = |k: fn(&Pose2) -> f64| {
        let (low, high) =
            points.clone().map(k).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        f64::midpoint(low, high)
    };
    let (x, y) = (middle(|p| p.x_m), middle(|p| p.y_m));
    let plan = Plan::new((720.0, 44.0), [[x - 0.95, y - 0.85], [x + 0.95, y + 0.85]], 210.0);
    let positions = |poses: &[Pose2Covariance]| -> Vec<Point2<f64>> {
        poses.iter().map(|p| p.pose.position().into()).collect()
    };
    let truth = late.truth.iter().map(|p| Point2::from(p.position()));
    plan.line(svg, truth, &format!(r#"stroke="{TRUTH}" stroke-width="1.5""#));
    let last = late.before.len() - 1;
    for (poses, colour) in [(&late.before, ESTIMATE), (&late.after, REPLAYED)] {
        plan.line(svg, positions(poses), &format!(r#"stroke="{colour}" stroke-width="2""#));
        plan.dots(svg, positions(poses), (2.2, colour));
        for k in [late.captured, last] {
            plan.pose_ellipse(svg, &poses[k], colour);
        }
    }
    plan.pose_ellipse(svg, &late.fix.pose, FIX);
    plan.robot(svg, &late.fix.pose.pose, FIX);
    for (k, words) in [(late.captured, "frame captured"), (last, "fix arrives: now")] {
        let at = Point2::from(late.before[k].pose.position());
        plan.label(svg, &at, ("middle", [0.0, 86.0]), words);
    }
    plan.scale_bar(svg, 0.2);
}
