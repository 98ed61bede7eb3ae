//! A question where a robot is, on arrival, and its answer.

use super::{CheckedFrame, CheckedScan};
use crate::{
    Code, Name, Rejection,
    api::{LocaliseHypothesisBody, LocaliseResult, LocaliseStatus},
    v1,
};
use map::{extrinsics::CameraExtrinsics, laser::Scan};
use std::time::Duration;
use vision::frame::Intrinsics;

/// Longest search.
pub const MAX_LOCALISE_MS: u32 = 10_000;

/// What a robot senses at one place, checked: a frame, a scan or both.
#[derive(Debug, Clone)]
pub struct CheckedLocalise {
    /// The frame with its camera and where that is on the robot; the pixels are still encoded.
    pub frame: Option<(CheckedFrame, Intrinsics, CameraExtrinsics)>,
    /// A scan from the same place.
    pub scan: Option<Scan>,
    /// The requested map; `None` for the robot's.
    pub map: Option<Name>,
    /// Longest time from receipt to the end of the search, at most [`MAX_LOCALISE_MS`].
    pub budget: Duration,
}

impl TryFrom<v1::LocaliseRequest> for CheckedLocalise {
    type Error = Rejection;

    fn try_from(request: v1::LocaliseRequest) -> Result<Self, Rejection> {
        if request.frame.is_none() && request.scan.is_none() {
            return Err(Rejection::new(Code::Missing, "frame", "a frame or a scan is needed, or both"));
        }
        let map = match request.map.as_str() {
            "" => None,
            name => Some(Name::new(name).map_err(|e| Rejection::new(Code::BadName, "map", e.to_string()))?),
        };
        let frame = request.frame.map(frame).transpose().map_err(|r| r.inside("frame"))?;
        let scan = request.scan.map(|scan| {
            let odom_from_robot = Some(v1::Pose2::default());
            CheckedScan::try_from(v1::Scan { odom_from_robot, ..scan })
        });
        let scan = scan.transpose().map_err(|r| r.inside("scan"))?.map(|checked| checked.scan);
        let budget_ms = match request.deadline_ms {
            0 => MAX_LOCALISE_MS,
            asked => asked.min(MAX_LOCALISE_MS),
        };
        Ok(Self { frame, scan, map, budget: Duration::from_millis(u64::from(budget_ms)) })
    }
}

fn frame(sent: v1::Frame) -> Result<(CheckedFrame, Intrinsics, CameraExtrinsics), Rejection> {
    let (odometry, prior, deadline_ms, map) = (None, None, 0, String::new());
    let frame = CheckedFrame::try_from(v1::Frame { odometry, prior, deadline_ms, map, ..sent })?;
    let missing = |field: &str| Rejection::new(Code::Missing, field, "it is needed with a frame");
    let intrinsics = frame.intrinsics.ok_or_else(|| missing("intrinsics"))?;
    let mounting = frame.mounting.clone().ok_or_else(|| missing("robot_from_camera"))?;
    Ok((frame, intrinsics, mounting))
}

/// A result as the wire says it.
pub fn localise_reply(result: LocaliseResult) -> v1::LocaliseReply {
    let status = match result.status {
        LocaliseStatus::Located => v1::LocaliseStatus::Located,
        LocaliseStatus::Ambiguous => v1::LocaliseStatus::Ambiguous,
        LocaliseStatus::NoMatch => v1::LocaliseStatus::NoMatch,
    };
    let hypothesis = |h: LocaliseHypothesisBody| v1::LocaliseHypothesis {
        map_from_robot: Some(h.map_from_robot),
        probability: h.probability,
        landmarks: h.landmarks,
        matched: h.matched,
    };
    v1::LocaliseReply {
        map: result.map,
        map_version: result.map_version,
        status: status.into(),
        reason: result.reason.unwrap_or_default(),
        map_from_robot: result.map_from_robot,
        hypotheses: result.hypotheses.into_iter().map(hypothesis).collect(),
        answer: result.answer,
        ..v1::LocaliseReply::default()
    }
}

/// The result that a reply states, or its refusal. `None` for a status or a hypothesis that this
/// version does not know.
pub fn localise_result(reply: v1::LocaliseReply) -> Option<Result<LocaliseResult, v1::Rejection>> {
    let status = match reply.status() {
        _ if reply.rejection.is_some() => return reply.rejection.map(Err),
        v1::LocaliseStatus::Located => LocaliseStatus::Located,
        v1::LocaliseStatus::Ambiguous => LocaliseStatus::Ambiguous,
        v1::LocaliseStatus::NoMatch => LocaliseStatus::NoMatch,
        v1::LocaliseStatus::Unspecified => return None,
    };
    let hypothesis = |h: v1::LocaliseHypothesis| {
        Some(LocaliseHypothesisBody {
            map_from_robot: h.map_from_robot?,
            probability: h.probability,
            landmarks: h.landmarks,
            matched: h.matched,
        })
    };
    Some(Ok(LocaliseResult {
        map: reply.map,
        map_version: reply.map_version,
        status,
        reason: (!reply.reason.is_empty()).then_some(reply.reason),
        map_from_robot: reply.map_from_robot,
        hypotheses: reply.hypotheses.into_iter().map(hypothesis).collect::<Option<_>>()?,
        answer: reply.answer,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request() -> v1::LocaliseRequest {
        let camera = v1::Intrinsics { fx_px: 500.0, fy_px: 500.0, ..v1::Intrinsics::default() };
        let frame = v1::Frame {
            encoding: v1::ImageEncoding::Gray8.into(),
            width_px: 4,
            height_px: 3,
            image: vec![0; 12].into(),
            intrinsics: Some(camera),
            robot_from_camera: Some(v1::Pose3 { qw: 1.0, ..v1::Pose3::default() }),
            // Not used, so not looked at.
            odometry: Some(v1::Pose2 { x_m: f64::NAN, ..v1::Pose2::default() }),
            map: "No Name".to_owned(),
            ..v1::Frame::default()
        };
        let scan = v1::Scan {
            robot_from_laser: Some(v1::Pose2::default()),
            bearing_step_rad: 0.01,
            max_range_m: 30.0,
            ranges_m: vec![2.0; 10],
            ..v1::Scan::default()
        };
        v1::LocaliseRequest { frame: Some(frame), scan: Some(scan), ..v1::LocaliseRequest::default() }
    }

    fn refused(change: impl FnOnce(&mut v1::LocaliseRequest)) -> (Code, String) {
        let mut wire = request();
        change(&mut wire);
        let r = CheckedLocalise::try_from(wire).unwrap_err();
        (r.code, r.field)
    }

    #[test]
    fn a_frame_and_a_scan_pass_and_the_time_is_bounded() {
        let checked = CheckedLocalise::try_from(request()).unwrap();
        assert!(checked.frame.is_some() && checked.scan.is_some() && checked.map.is_none());
        for (asked, got) in [(0, 10_000), (1, 1), (10_000, 10_000), (u32::MAX, 10_000)] {
            let request = v1::LocaliseRequest { deadline_ms: asked, ..request() };
            assert_eq!(CheckedLocalise::try_from(request).unwrap().budget, Duration::from_millis(got));
        }
    }

    #[test]
    fn each_fault_names_its_field() {
        let missing = |field: &str| (Code::Missing, field.to_owned());
        assert_eq!(refused(|r| (r.frame, r.scan) = (None, None)), missing("frame"));
        let of_frame = |change: fn(&mut v1::Frame)| refused(|r| change(r.frame.as_mut().unwrap()));
        assert_eq!(of_frame(|f| f.intrinsics = None), missing("frame.intrinsics"));
        assert_eq!(of_frame(|f| f.robot_from_camera = None), missing("frame.robot_from_camera"));
        assert_eq!(of_frame(|f| f.width_px = 5), (Code::SizeMismatch, "frame.image".to_owned()));
        let of_scan = |change: fn(&mut v1::Scan)| refused(|r| change(r.scan.as_mut().unwrap()));
        assert_eq!(of_scan(|s| s.robot_from_laser = None), missing("scan.robot_from_laser"));
        assert_eq!(of_scan(|s| s.ranges_m.clear()), (Code::OutOfRange, "scan.ranges_m".to_owned()));
        assert_eq!(refused(|r| r.map = "No Name".into()), (Code::BadName, "map".to_owned()));
    }

    #[test]
    fn a_result_reads_as_it_was_sent() {
        let pose = v1::Pose2Covariance { pose: Some(v1::Pose2::default()), covariance: vec![0.0; 9] };
        let hypothesis = LocaliseHypothesisBody {
            map_from_robot: pose.clone(),
            probability: 0.5,
            landmarks: vec!["door".to_owned()],
            matched: Some(0.25),
        };
        let result = LocaliseResult {
            map: "hall".to_owned(),
            map_version: 3,
            status: LocaliseStatus::Ambiguous,
            reason: Some("ambiguous".to_owned()),
            map_from_robot: None,
            hypotheses: vec![hypothesis.clone(), hypothesis],
            answer: Some(v1::Answer::default()),
        };
        assert_eq!(localise_result(localise_reply(result.clone())), Some(Ok(result)));
        let code = "unknown_map".to_owned();
        let rejection = Some(v1::Rejection { code, ..v1::Rejection::default() });
        let refused =
            localise_result(v1::LocaliseReply { rejection: rejection.clone(), ..Default::default() });
        assert_eq!(refused, rejection.map(Err));
        assert_eq!(localise_result(v1::LocaliseReply::default()), None);
    }
}
