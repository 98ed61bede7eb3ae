//! Single results of a picture, a line each, for people: what was missed or is wrong, and how far
//! off its pose is.

use super::score::{PictureScore, PoseOutcome, View};
use cli::screen;

/// Full views without a name, wrong names and false quads.
pub(super) fn name_misses(score: &PictureScore) {
    let at = |corners: &vision::geometry::Corners| {
        let centre = corners.points().iter().fold([0.0; 2], |s, p| [s[0] + 0.25 * p.x, s[1] + 0.25 * p.y]);
        format!("at ({:.0}, {:.0})", centre[0], centre[1])
    };
    let of = format!("{}/{}", score.world, score.file);
    for label in score.labels.iter().filter(|l| l.view == View::Full && !l.is_named()) {
        let name = label.landmark.as_deref().unwrap_or("a distractor");
        let angle = label.angle_rad.map_or(String::new(), |a| format!(", angle {:.0} deg", a.to_degrees()));
        screen::complain(&format!(
            "{of}: {name} {} not named, side {:.0} px{angle}: {} ({})",
            at(&label.corners),
            label.side_px,
            label.miss.reason,
            label.miss.detail
        ));
    }
    for wrong in &score.wrong {
        let is = wrong.is.as_deref().unwrap_or("nothing labelled");
        screen::complain(&format!("{of}: WRONG {} {} is {is}", wrong.named, at(&wrong.corners)));
    }
    for corners in score.false_quads.iter().flatten() {
        screen::complain(&format!("{of}: false quad {}", at(corners)));
    }
}

/// The camera's pose against the truth, in cm.
pub(super) fn name_pose(score: &PictureScore) {
    let PoseOutcome::Given(pose) = &score.pose else { return };
    let cm = |metres: Option<f64>| metres.map_or("-".to_owned(), |m| format!("{:.1}", 100.0 * m));
    let sigma = |covariance: Option<nalgebra::Matrix3<f64>>| cm(covariance.map(|c| c.trace().sqrt()));
    screen::complain(&format!(
        "{}/{}: position off by {} cm, stated {} (with the place {}), bound {}, of all in view {}; landmarks {}, at {:.1} m, direction {:.2} deg",
        score.world,
        score.file,
        cm(Some(pose.position_m)),
        cm(pose.stated_m),
        cm(Some(pose.stated_whole_m)),
        sigma(pose.bound),
        sigma(pose.bound_of_all),
        pose.names.join(" "),
        pose.distance_m,
        pose.direction_rad.to_degrees()
    ));
}
