//! The window against all keyframes at once.

use super::{super::*, golden::Golden};

/// The survey up to a keyframe.
fn until(survey: &Survey, keyframe: usize) -> Survey {
    let mut part = survey.clone();
    let drive = &mut part.drives[0];
    drive.motions.truncate(keyframe);
    drive.lines.retain(|line| line.keyframe <= keyframe);
    drive.tracks.iter_mut().for_each(|track| track.views.retain(|view| view.keyframe <= keyframe));
    part
}

fn seen(survey: &Survey, keyframe: usize) -> KeyframeSeen {
    let drive = &survey.drives[0];
    let mut quads = Vec::new();
    for (number, track) in drive.tracks.iter().enumerate() {
        let views = track.views.iter().filter(|view| view.keyframe == keyframe);
        quads.extend(views.map(|view| (number, track.wall, *view)));
    }
    KeyframeSeen {
        motion: keyframe.checked_sub(1).map(|before| drive.motions[before]),
        lines: drive.lines.iter().filter(|line| line.keyframe == keyframe).copied().collect(),
        quads,
    }
}

/// After each keyframe the newest pose is within 0.2 sigma of that of all keyframes so far.
#[test]
fn the_window_is_the_batch() {
    const SIZE: usize = 12;
    let golden = Golden::read();
    let (survey, params) = (golden.survey(), golden.params());
    let mut window = JointWindow::new(survey.start, &survey.camera, &params, SIZE);
    for keyframe in 0..=survey.drives[0].motions.len() {
        let pose = window.add(&seen(&survey, keyframe)).unwrap();
        let of_window = |f: &Factor| match f {
            Factor::Odometry(f) => Some(f.from),
            Factor::Line(f) => Some(f.keyframe),
            Factor::View(f) => Some(f.keyframe),
            _ => None,
        };
        let oldest = window.problem().factors.iter().filter_map(of_window).min().unwrap();
        assert!(keyframe - oldest < SIZE, "{keyframe} {oldest}");
        if keyframe == 0 {
            continue;
        }
        let batch = surveyed(&until(&survey, keyframe), &params).unwrap();
        let of = Variable::Keyframe(keyframe);
        let covariance = Marginals::of(&batch.problem, &[of]).unwrap().block(of, of).unwrap();
        let d = pose.minus(&batch.problem.state.keyframes[keyframe]);
        for k in 0..3 {
            let sigma = covariance[(k, k)].sqrt();
            assert!(d[k].abs() < 0.2 * sigma, "{keyframe} {k}: {} of {sigma}", d[k]);
        }
    }
}
