//! A gaze request on arrival, and the advice that answers it.

use super::geometry;
use crate::{Code, Rejection, v1};
use map::{
    gaze::{Criterion, GazeAction, GazeTarget, PanTiltUnit},
    pose2::Pose2Covariance,
    visibility::PanTiltCamera,
};

/// A checked gaze request.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedGaze {
    /// The robot's own pose, if given.
    pub pose: Option<Pose2Covariance>,
    /// Pan-tilt unit with its present direction.
    pub head: PanTiltUnit,
    /// Rightmost and leftmost pan of the unit, radians, if given.
    pub pan_range_rad: Option<[f64; 2]>,
    /// Lowest and highest tilt of the unit, radians, if given.
    pub tilt_range_rad: Option<[f64; 2]>,
    /// Criterion of the choice.
    pub criterion: Criterion,
    /// Robot's clock, ns.
    pub at_ns: i64,
    /// The last target, and whether it was recognised.
    pub looked: Option<(String, bool)>,
}

impl TryFrom<v1::GazeRequest> for CheckedGaze {
    type Error = Rejection;

    fn try_from(g: v1::GazeRequest) -> Result<Self, Rejection> {
        let pose = g.map_from_robot.as_ref().map(geometry::pose2_covariance).transpose();
        let usual = PanTiltUnit::default();
        let or = |value: f64, usual: f64| if value == 0.0 { usual } else { value };
        let head = PanTiltUnit {
            camera_m: [g.camera_x_m, g.camera_y_m, or(g.camera_z_m, usual.camera_m[2])],
            pan_rad: g.pan_rad,
            tilt_rad: g.tilt_rad,
            rate_radps: or(g.rate_radps, usual.rate_radps),
        };
        let pan_range_rad = range("pan_range_rad", &g.pan_range_rad)?;
        let tilt_range_rad = range("tilt_range_rad", &g.tilt_range_rad)?;
        let criterion = match g.criterion() {
            v1::GazeCriterion::Unspecified | v1::GazeCriterion::Product => Criterion::Product,
            v1::GazeCriterion::Information => Criterion::Information,
        };
        let made = Self {
            pose: pose.map_err(|r| r.inside("map_from_robot"))?,
            head,
            pan_range_rad,
            tilt_range_rad,
            criterion,
            at_ns: g.at_ns,
            looked: (!g.looked_at.is_empty()).then_some((g.looked_at, g.recognised)),
        };
        let viewer = made.viewer(&PanTiltCamera::default());
        made.head.check().and_then(|()| viewer.check()).map_err(|error| {
            let refused = geometry::refused(&error);
            Rejection { field: made.field(&refused.field), ..refused }
        })?;
        Ok(made)
    }
}

impl CheckedGaze {
    /// The field of the message that a number of the unit or of its ranges is from.
    fn field(&self, of: &str) -> String {
        let axes = ["camera_x_m", "camera_y_m", "camera_z_m"].into_iter().zip(self.head.camera_m);
        let camera = || axes.clone().find(|(_, value)| !(-10.0..=10.0).contains(value));
        match of {
            "head.camera_m" => camera().map_or("camera_z_m", |(name, _)| name).to_owned(),
            _ => of
                .trim_start_matches("head.")
                .replace("pan_rad[", "pan_range_rad[")
                .replace("tilt_rad[", "tilt_range_rad["),
        }
    }

    /// The robot's camera: absent ranges are those of `usual`.
    pub fn viewer(&self, usual: &PanTiltCamera) -> PanTiltCamera {
        PanTiltCamera {
            pan_rad: self.pan_range_rad.unwrap_or(usual.pan_rad),
            tilt_rad: self.tilt_range_rad.unwrap_or(usual.tilt_rad),
            ..usual.clone()
        }
    }
}

fn range(field: &str, given: &[f64]) -> Result<Option<[f64; 2]>, Rejection> {
    match given {
        [] => Ok(None),
        [low, high] => Ok(Some([*low, *high])),
        _ => {
            let detail = format!("2 numbers expected, {} given", given.len());
            Err(Rejection::new(Code::OutOfRange, field, detail))
        }
    }
}

/// The advice; `name` gives the name of a landmark.
pub fn advice(action: &GazeAction, name: impl Fn(&GazeTarget) -> String) -> v1::GazeAdvice {
    let (kind, choice) = match action {
        GazeAction::Landmark(choice) => (v1::GazeAction::Landmark, Some(choice)),
        GazeAction::Ahead => (v1::GazeAction::Ahead, None),
        GazeAction::Sweep => (v1::GazeAction::Sweep, None),
    };
    let mut advice = v1::GazeAdvice { action: kind.into(), ..v1::GazeAdvice::default() };
    if let Some(c) = choice {
        advice.landmark = name(c);
        (advice.pan_rad, advice.tilt_rad) = (c.pan_rad, c.tilt_rad);
        (advice.utility, advice.probability) = (c.utility, c.probability);
        (advice.margin_m, advice.gain_nats) = (c.margin_m, c.gain_nats);
        (advice.range_m, advice.incidence_rad) = (c.range_m, c.incidence_rad);
    }
    advice
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absent_numbers_are_the_usual_ones_and_wrong_ones_are_named() {
        let empty = CheckedGaze::try_from(v1::GazeRequest::default()).unwrap();
        assert_eq!(empty.viewer(&PanTiltCamera::default()), PanTiltCamera::default());
        assert_eq!((empty.head, empty.pose), (PanTiltUnit::default(), None));
        let refused = |g: v1::GazeRequest| CheckedGaze::try_from(g).unwrap_err().field;
        let g = v1::GazeRequest::default;
        assert_eq!(refused(v1::GazeRequest { pan_range_rad: vec![1.0], ..g() }), "pan_range_rad");
        assert_eq!(refused(v1::GazeRequest { pan_range_rad: vec![1.0, 0.5], ..g() }), "pan_range_rad[1]");
        assert_eq!(refused(v1::GazeRequest { rate_radps: f64::NAN, ..g() }), "rate_radps");
        assert_eq!(refused(v1::GazeRequest { camera_y_m: 11.0, ..g() }), "camera_y_m");
        let pose = v1::Pose2Covariance { pose: None, covariance: vec![] };
        assert_eq!(refused(v1::GazeRequest { map_from_robot: Some(pose), ..g() }), "map_from_robot.pose");
    }
}
