//! The way without a joint map, at its best: poses and walls by lines and odometry alone, then each
//! landmark by itself with those poses, independent from view to view, the camera as stated.

use super::{building::NAMED, figures::Placed, passages::LabelledSurvey};
use map::joint::{
    Factor, JointError, JointParams, LandmarkState, LandmarkView, Level, Marginals, OnWall, QuadView, State,
    Survey, SurveyMap, Variable, landmark_by_rays, surveyed,
};
use nalgebra::{DMatrix, DVector, Matrix2, SMatrix, Vector2};

/// Gauss-Newton steps of one landmark.
const STEPS: usize = 12;
/// Largest change of a parameter in one step.
const MOST: f64 = 0.5;

/// The map without landmarks, and each object with an appearance of its own by itself.
pub(super) fn two_step(
    labelled: &LabelledSurvey,
    params: &JointParams,
    corner_sigma_px: f64,
) -> Result<(SurveyMap, Vec<Placed>), JointError> {
    let blind = without_tracks(&labelled.survey);
    let map = surveyed(&blind, params)?;
    let mut placed = Vec::new();
    for object in 0..NAMED {
        let (mut views, mut wall) = (Vec::new(), None);
        let mut number = 0;
        for (drive, record) in labelled.survey.drives.iter().enumerate() {
            for track in &record.tracks {
                if labelled.object_of[number] == object {
                    let first = map.first_keyframe[drive];
                    views.extend(track.views.iter().map(|v| (first + v.keyframe, *v)));
                    let same = track.wall.map(|w| labelled.survey.same_wall[w]);
                    wall = wall.or(same.and_then(|w| map.wall_of.get(&w).copied()));
                }
                number += 1;
            }
        }
        if views.len() < params.min_views {
            continue;
        }
        if let Some(landmark) =
            alone(&map, labelled.survey.camera.camera, &views, wall, params, corner_sigma_px)?
        {
            placed.push(Placed { object, variable: 0, landmark, covariance: None });
        }
    }
    Ok((map, placed))
}

fn without_tracks(survey: &Survey) -> Survey {
    let mut blind = Survey { candidates: Vec::new(), ..survey.clone() };
    blind.drives.iter_mut().for_each(|drive| drive.tracks.clear());
    blind
}

/// One landmark, by views whose weights contain the covariance of their poses.
fn alone(
    map: &SurveyMap,
    camera: map::joint::CameraState,
    views: &[(usize, QuadView)],
    wall: Option<usize>,
    params: &JointParams,
    corner_sigma_px: f64,
) -> Result<Option<LandmarkState>, JointError> {
    let keyframes = &map.problem.state.keyframes;
    let posed: Vec<_> = views.iter().map(|(k, view)| (keyframes[*k], *view)).collect();
    let Some(mut landmark) = landmark_by_rays(&posed, &camera) else { return Ok(None) };
    let mut chosen: Vec<Variable> = views.iter().map(|(k, _)| Variable::Keyframe(*k)).collect();
    chosen.retain(|v| *v != Variable::Keyframe(0));
    let marginals = Marginals::of(&map.problem, &chosen)?;
    let mut hanging = vec![Factor::Level(Level { landmark: 0, sigma_rad: params.hanging_sigma_rad })];
    let (distance_sigma_m, angle_sigma_rad) = (params.hanging_sigma_m, params.hanging_sigma_rad);
    let on_wall = |wall| Factor::OnWall(OnWall { landmark: 0, wall, distance_sigma_m, angle_sigma_rad });
    hanging.extend(wall.map(on_wall));
    for _ in 0..STEPS {
        let state = State {
            landmarks: vec![landmark],
            cameras: vec![camera],
            keyframes: keyframes.clone(),
            walls: map.problem.state.walls.clone(),
            ..State::default()
        };
        let (mut h, mut g) = (DMatrix::zeros(8, 8), DVector::zeros(8));
        for (keyframe, view) in views {
            let view = LandmarkView {
                keyframe: *keyframe,
                landmark: 0,
                camera: 0,
                mounting_from_camera: view.mounting_from_camera,
                corners_px: view.corners_px,
                sqrt_information: [Matrix2::identity(); 4],
            };
            let term = Factor::View(view).linearised(&state);
            let (by_pose, by) = (&term.by[0].1, &term.by[1].1);
            let of = Variable::Keyframe(*keyframe);
            let pose = marginals.block(of, of).unwrap_or_else(|| DMatrix::zeros(3, 3));
            let noise = DMatrix::identity(8, 8) * corner_sigma_px.powi(2);
            let Some(weight) = (by_pose * pose * by_pose.transpose() + noise).try_inverse() else {
                return Ok(None);
            };
            h += by.tr_mul(&(&weight * by));
            g += by.tr_mul(&(&weight * &term.residual));
        }
        for term in hanging.iter().map(|f| f.linearised(&state)) {
            h += term.by[0].1.tr_mul(&term.by[0].1);
            g += term.by[0].1.tr_mul(&term.residual);
        }
        let Some(step) = h.lu().solve(&g) else { return Ok(None) };
        landmark = stepped(&landmark, &step.map(|v| (-v).clamp(-MOST, MOST)));
    }
    Ok(Some(landmark))
}

fn stepped(m: &LandmarkState, d: &DVector<f64>) -> LandmarkState {
    let p: SMatrix<f64, 8, 1> = m.parameters() + SMatrix::<f64, 8, 1>::from_column_slice(d.as_slice());
    LandmarkState {
        centre: nalgebra::Vector3::new(p[0], p[1], p[3]),
        theta_rad: p[2],
        tilt_rad: p[4],
        roll_rad: p[5],
        log_size: Vector2::new(p[6], p[7]),
    }
}
