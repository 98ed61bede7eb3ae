//! Answers and poses as lines for a person. In: what the server sent. Out: text. Prints nothing.

use super::screen::counted;
use client::{
    NamedLandmark,
    api::{PoseTrust, Robot},
    named,
    v1::{Answer, QuadAnswer, QuadKind, Verdict},
};

/// What was recognised in a picture, a line for each quad.
pub(super) fn sentence(name: &str, answer: &Answer) -> String {
    let mut lines = vec![format!("{name}: {}", counted(answer.quads.len() as u64, "quad"))];
    lines.extend(answer.quads.iter().filter_map(quad_line).map(|line| format!("  {line}")));
    if lines.len() == 1 {
        lines.push("  no landmark recognised".to_owned());
    }
    lines.join("\n")
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
    Some(line + &by_points(quad))
}

/// The line for verdict ambiguous: one landmark and why it is not named, or several that the quad fits.
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
    quad.candidates.iter().filter(|c| c.ratio < 1.0).map(|c| c.landmark.as_str()).collect()
}

/// The points' evidence for the first candidate; empty where points did not decide.
fn by_points(quad: &QuadAnswer) -> String {
    quad.points.as_ref().map_or_else(String::new, |points| {
        let alarms = points.log10_false_alarms.round();
        format!(", {} of {} matches agree, 1e{alarms} false alarms expected", points.inliers, points.matches)
    })
}

/// The line for a robot: its map, and its pose if that is known.
pub(super) fn robot_line(robot: &Robot) -> String {
    let at = robot.pose.as_ref().map_or_else(String::new, |pose| {
        let (x_m, y_m, degrees) = (pose.x_m, pose.y_m, pose.theta_rad.to_degrees());
        format!(", at {x_m:.2}, {y_m:.2} m, {degrees:.0} degrees: {}", trust(pose.trust))
    });
    format!("{}  {}{at}", robot.name, robot.map)
}

/// How far a pose is trusted.
fn trust(trust: PoseTrust) -> &'static str {
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
    use client::{
        api::RobotPose,
        v1::{Candidate, PointEvidence, Sighting},
    };

    fn of(quad: &QuadAnswer) -> String {
        sentence("a.jpg", &Answer { quads: vec![quad.clone()], ..Answer::default() })
    }

    #[test]
    fn a_line_says_what_points_say() {
        let points =
            PointEvidence { matches: 40, inliers: 34, log10_false_alarms: -21.3, ..PointEvidence::default() };
        let mut quad = QuadAnswer {
            verdict: Verdict::Unique.into(),
            landmark: "door".into(),
            confidence: 0.98,
            points: Some(points),
            ..QuadAnswer::default()
        };
        let evidence = ", 34 of 40 matches agree, 1e-21 false alarms expected";
        assert_eq!(of(&quad), format!("a.jpg: 1 quad\n  door with confidence 0.98{evidence}"));
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
        let candidate =
            |name: &str, ratio| Candidate { landmark: name.into(), ratio, ..Candidate::default() };
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
    fn a_robot_is_shown_with_its_pose_and_how_far_that_is_trusted() {
        let robot: Robot = serde_json::from_str(r#"{"name":"r1","map":"hall","alive":true}"#).unwrap();
        assert_eq!(robot_line(&robot), "r1  hall");
        let at = |trust| {
            let pose = RobotPose {
                x_m: 1.5,
                y_m: -2.0,
                theta_rad: std::f64::consts::FRAC_PI_2,
                trust,
                ..RobotPose::default()
            };
            robot_line(&Robot { pose: Some(pose), ..robot.clone() })
        };
        assert_eq!(at(PoseTrust::Supported), "r1  hall, at 1.50, -2.00 m, 90 degrees: landmarks agree");
        assert!(at(PoseTrust::Contradicted).ends_with(": contradicted by the last landmark"));
    }
}
