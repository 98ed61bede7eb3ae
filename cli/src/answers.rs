//! Answers and poses as lines for a person. In: what the server sent. Out: text. Prints nothing.

use super::screen::counted;
use client::{
    NamedLandmark,
    api::{PoseTrust, RobotPose},
    named,
    v1::{Answer, QuadAnswer, QuadKind, Verdict},
};
use nalgebra::Vector3;
use protos::convert::geometry::pose3;

/// What was recognised in a picture, a line for each quad.
pub(super) fn sentence(name: &str, answer: &Answer) -> String {
    let mut lines = vec![format!("{name}: {}", counted(answer.quads.len() as u64, "quad"))];
    lines.extend(answer.quads.iter().filter_map(quad_line).map(|line| format!("  {line}")));
    if lines.len() == 1 {
        lines.push("  no landmark recognised".to_owned());
    }
    lines.extend(standpoint(answer).map(|line| format!("  {line}")));
    lines.extend(answer.pose_cautions.iter().map(|word| format!("  caution ({word}): {}", caution(word))));
    lines.join("\n")
}

/// Where a photograph was taken, or why landmarks with a pose do not say it.
fn standpoint(answer: &Answer) -> Option<String> {
    let Some(found) = &answer.camera_pose else {
        let reason = no_standpoint(&answer.camera_pose_refusal)?;
        return Some(format!("no pose of the camera ({}): {reason}", answer.camera_pose_refusal));
    };
    let pose = pose3(found.map_from_camera.as_ref()?).ok()?;
    let (at, ahead) = (pose.translation.vector, pose.rotation * Vector3::z());
    let sigma = |k: usize| found.covariance.get(7 * k).map_or(f64::NAN, |variance| variance.sqrt());
    Some(format!(
        "taken at {:.2}, {:.2} m (+- {:.2}, {:.2}), {:.2} m above the floor, looking to {:.0} degrees (+- {:.1}), by {}",
        at.x,
        at.y,
        sigma(3),
        sigma(4),
        at.z,
        ahead.y.atan2(ahead.x).to_degrees(),
        sigma(2).to_degrees(),
        found.landmarks.join(", ")
    ))
}

/// What a caution of a pose means, and what to look at.
fn caution(word: &str) -> &'static str {
    match word {
        "behind_wall" => {
            "a wall of the map is between this position and a landmark; check the place, facing and size of the \
             landmark, unless the wall is low or of glass"
        }
        "outside_map" => {
            "this position is outside of the walls of the map; check the place and facing of the landmark, unless \
             the map lacks walls there"
        }
        _ => "the walls of the map speak against it",
    }
}

fn no_standpoint(refusal: &str) -> Option<&'static str> {
    Some(match refusal {
        "" => return None,
        "landmark_not_placed" => "say where the landmark hangs: waymark landmark place",
        "landmark_quarantined" => "the landmark was found moved or missing; place it again",
        "ambiguous" => "two poses fit; photograph from more to the side, or closer",
        "gate_camera_height" => {
            "the camera would be below the floor or 5 m above it; check size, place and height of the landmark"
        }
        "gate_inconsistent" => "the landmarks contradict one another; check their sizes and places",
        "gate_imprecise" => {
            "the landmarks give its position worse than to 15 cm; photograph from closer, from the side, or several"
        }
        _ => "the corners do not determine it",
    })
}

/// The line for a quad; `None` for verdict unknown.
fn quad_line(quad: &QuadAnswer) -> Option<String> {
    let line = match (named(quad), quad.verdict()) {
        (Some(named), _) => named_line(&named),
        (None, Verdict::Ambiguous) if !quad.doubtful_landmark.is_empty() => {
            format!("perhaps {}: a part of it shows something else", quad.doubtful_landmark)
        }
        (None, Verdict::Ambiguous) => ambiguous_line(quad),
        _ => return None,
    };
    Some(line + &by_points(quad) + &pose_text(quad))
}

/// The line for verdict ambiguous: one landmark and why it is not named, or several that the quad
/// fits.
fn ambiguous_line(quad: &QuadAnswer) -> String {
    let refused = |why: &str| quad.candidates.iter().find(|c| c.refusal == why).map(|c| c.landmark.as_str());
    match (refused("plain"), refused("corners")) {
        (Some(name), _) => format!("perhaps {name}: too plain to be named without the robot's pose"),
        (None, Some(name)) => format!("perhaps {name}: where its corners are is not clear"),
        (None, None) => format!("one of {}: not sure which", fitting(quad).join(", ")),
    }
}

fn named_line(named: &NamedLandmark<'_>) -> String {
    let NamedLandmark { name, quad, .. } = named;
    if !named.is_guided() {
        return format!("{name} with confidence {:.2}", quad.confidence);
    }
    if quad.kind() == QuadKind::Expected {
        return format!("{name} by pose, found where it was expected");
    }
    match fitting(quad).as_slice() {
        [] => format!("{name} by pose"),
        alone => format!("{name} by pose; the picture alone says {}", alone.join(" or ")),
    }
}

/// The landmarks that the quad fits by the picture alone.
fn fitting(quad: &QuadAnswer) -> Vec<&str> {
    quad.candidates
        .iter()
        .filter(|c| c.ratio.is_some_and(|ratio| ratio < 1.0))
        .map(|c| c.landmark.as_str())
        .collect()
}

/// Distance of a landmark with a pose, or that its size is missing for one; nothing where no camera
/// was given.
fn pose_text(quad: &QuadAnswer) -> String {
    match quad.pose.as_ref().and_then(|pose| pose.camera_from_landmark.as_ref()) {
        Some(p) => format!(", {:.2} m away", p.x_m.hypot(p.y_m).hypot(p.z_m)),
        None if quad.pose_refusal == "no_size" => {
            format!(", no pose: its size is not known (waymark landmark size {} WxH)", quad.landmark)
        }
        None if quad.pose_refusal == "reprojection" => {
            ", no pose: its corners fit no landmark of its size (check width and height, and the camera)"
                .to_owned()
        }
        None if quad.pose_refusal == "border_unclear" => {
            ", no pose: a shadow or a second frame may be its border (try another view)".to_owned()
        }
        None => String::new(),
    }
}

/// The points' evidence for the first candidate; empty where points did not decide.
fn by_points(quad: &QuadAnswer) -> String {
    quad.points.as_ref().map_or_else(String::new, |points| {
        let chance = points.log10_chance.round();
        format!(", {} of {} matches agree, by chance 1e{chance}", points.inliers, points.matches)
    })
}

/// Where a robot is.
pub(super) fn pose_line(pose: &RobotPose) -> String {
    let (x_m, y_m, degrees) = (pose.x_m, pose.y_m, pose.theta_rad.to_degrees());
    format!("{x_m:.2}, {y_m:.2} m, {degrees:.0} deg")
}

/// How far a pose is trusted.
pub(super) fn trust(trust: PoseTrust) -> &'static str {
    match trust {
        PoseTrust::Unspecified => "not checked by a landmark yet",
        PoseTrust::Unsupported => "not confirmed yet",
        PoseTrust::Supported => "landmarks agree",
        PoseTrust::Stale => "last confirmed 30 frames or 10 m ago, or longer",
        PoseTrust::Contradicted => "contradicted by the last landmark",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use client::v1::{CameraPose, Candidate, PointEvidence, Pose3, Sighting};

    fn of(quad: &QuadAnswer) -> String {
        sentence("a.jpg", &Answer { quads: vec![quad.clone()], ..Answer::default() })
    }

    #[test]
    fn a_photograph_says_where_it_was_taken_or_why_that_is_not_known() {
        let mut answer = Answer { camera_pose_refusal: "ambiguous".into(), ..Answer::default() };
        assert!(
            sentence("a.jpg", &answer)
                .ends_with("(ambiguous): two poses fit; photograph from more to the side, or closer")
        );
        let q = std::f64::consts::FRAC_1_SQRT_2;
        let mut covariance = vec![0.0; 36];
        (covariance[14], covariance[21], covariance[28]) = (3.046e-4, 0.0004, 0.0009);
        // The camera looks along y: x right is the map's x, y down is its -z.
        let pose = Pose3 { qx: -q, qw: q, x_m: 1.0, y_m: -2.0, z_m: 1.5, ..Pose3::default() };
        answer.camera_pose_refusal.clear();
        answer.camera_pose =
            Some(CameraPose { map_from_camera: Some(pose), covariance, landmarks: vec!["door".into()] });
        let line = "taken at 1.00, -2.00 m (+- 0.02, 0.03), 1.50 m above the floor, looking to 90 degrees (+- 1.0), by door";
        assert!(sentence("a.jpg", &answer).ends_with(line), "{}", sentence("a.jpg", &answer));
        answer.pose_cautions = vec!["behind_wall".into(), "outside_map".into()];
        let text = sentence("a.jpg", &answer);
        let cautions: Vec<&str> = text.lines().filter(|l| l.starts_with("  caution (")).collect();
        assert!(
            matches!(cautions.as_slice(), [a, b] if a.contains("between") && b.contains("outside")),
            "{text}"
        );
    }

    #[test]
    fn a_line_says_what_points_say() {
        let points =
            PointEvidence { matches: 40, inliers: 34, log10_chance: -21.3, ..PointEvidence::default() };
        let mut quad = QuadAnswer {
            verdict: Verdict::Unique.into(),
            landmark: "door".into(),
            confidence: 0.98,
            points: Some(points),
            ..QuadAnswer::default()
        };
        let evidence = ", 34 of 40 matches agree, by chance 1e-21";
        assert_eq!(of(&quad), format!("a.jpg: 1 quad\n  door with confidence 0.98{evidence}"));
        quad.pose_refusal = "no_size".into();
        assert!(of(&quad).ends_with("no pose: its size is not known (waymark landmark size door WxH)"));
        quad.pose_refusal.clear();
        quad.set_verdict(Verdict::Ambiguous);
        (quad.doubtful_landmark, quad.landmark) = ("door".into(), String::new());
        assert_eq!(
            of(&quad),
            format!("a.jpg: 1 quad\n  perhaps door: a part of it shows something else{evidence}")
        );
        quad.points = None;
        assert_eq!(of(&quad), "a.jpg: 1 quad\n  perhaps door: a part of it shows something else");
    }

    #[test]
    fn a_line_says_what_the_pose_named_and_what_the_picture_alone_says() {
        let candidate = |name: &str, ratio| Candidate {
            landmark: name.into(),
            ratio: Some(ratio),
            ..Candidate::default()
        };
        let mut quad = QuadAnswer {
            verdict: Verdict::Ambiguous.into(),
            candidates: vec![candidate("door-2", 0.5), candidate("door-3", 0.6), candidate("poster", 1.4)],
            ..QuadAnswer::default()
        };
        assert_eq!(of(&quad), "a.jpg: 1 quad\n  one of door-2, door-3: not sure which");
        for (refusal, why) in [
            ("plain", "too plain to be named without the robot's pose"),
            ("corners", "where its corners are is not clear"),
        ] {
            let mut refused = quad.clone();
            refused.candidates.truncate(1);
            refused.candidates[0].refusal = refusal.into();
            assert_eq!(of(&refused), format!("a.jpg: 1 quad\n  perhaps door-2: {why}"));
        }
        quad.set_sighting(Sighting::Guided);
        quad.guided_landmark = "door-3".into();
        assert_eq!(of(&quad), "a.jpg: 1 quad\n  door-3 by pose; the picture alone says door-2 or door-3");
        let quad = QuadAnswer {
            kind: QuadKind::Expected.into(),
            verdict: Verdict::Unknown.into(),
            candidates: Vec::new(),
            ..quad
        };
        assert_eq!(of(&quad), "a.jpg: 1 quad\n  door-3 by pose, found where it was expected");
        assert_eq!(of(&QuadAnswer::default()), "a.jpg: 1 quad\n  no landmark recognised");
    }

    #[test]
    fn a_pose_is_told_in_metres_and_degrees() {
        let pose =
            RobotPose { x_m: 1.5, y_m: -2.0, theta_rad: std::f64::consts::FRAC_PI_2, ..RobotPose::default() };
        assert_eq!(pose_line(&pose), "1.50, -2.00 m, 90 deg");
        assert_eq!(trust(PoseTrust::Contradicted), "contradicted by the last landmark");
    }
}
