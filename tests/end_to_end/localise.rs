//! Claim: a robot learns where it is by a frame, a scan or both, over zenoh as over HTTP: one code,
//! one result.

use client::{
    Capture, LocaliseQuery,
    api::{LocaliseHypothesisBody, LocaliseResult, LocaliseStatus, NewMap, ScanBody},
    http::Sensed,
};
use server::config::Limits;
use sim::{
    building::Building,
    corridor::CorridorParams,
    lesson::{LessonParams, stops},
    robot::{Robot, RobotParams, SensorReadings},
};
use std::sync::Arc;
use tests::{
    Inside, SOON,
    robots::{MAP, connect, jpeg, put_walls, scan_message, teach},
};

fn scan_body(readings: &SensorReadings) -> ScanBody {
    let scan = scan_message(readings, 0);
    ScanBody {
        robot_from_laser: scan.robot_from_laser.expect("a laser"),
        first_bearing_rad: scan.first_bearing_rad,
        bearing_step_rad: scan.bearing_step_rad,
        max_range_m: scan.max_range_m,
        ranges_m: scan.ranges_m.into_iter().map(|range| range.is_finite().then_some(range)).collect(),
    }
}

/// Numbers that went through JSON may differ in their last digit.
const ROUNDING: f64 = 1e-9;

/// Asserts that two results say the same, of the same map, by the same landmarks.
fn assert_same(a: &LocaliseResult, b: &LocaliseResult) {
    let said = |r: &LocaliseResult| {
        let landmarks: Vec<_> = r.hypotheses.iter().map(|h| h.landmarks.clone()).collect();
        let named: Option<Vec<_>> =
            r.answer.as_ref().map(|a| a.quads.iter().map(|q| q.landmark.clone()).collect());
        (r.map.clone(), r.map_version, r.status, r.reason.clone(), landmarks, named)
    };
    assert_eq!(said(a), said(b));
    let numbers = |r: &LocaliseResult| -> Vec<f64> {
        let of = |h: &LocaliseHypothesisBody| {
            let pose = h.map_from_robot.pose.expect("a pose");
            let mut all = vec![pose.x_m, pose.y_m, pose.theta_rad, h.probability, h.matched.unwrap_or(-1.0)];
            all.extend(&h.map_from_robot.covariance);
            all
        };
        r.hypotheses.iter().flat_map(of).collect()
    };
    let differs = numbers(a).iter().zip(numbers(b)).any(|(a, b)| (a - b).abs() > ROUNDING);
    assert!(!differs && a.map_from_robot.is_some() == b.map_from_robot.is_some(), "{a:?}\n{b:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn zenoh_and_http_say_the_same_of_a_frame_a_scan_and_both() {
    let params = CorridorParams { posters: 1, column: false, ..CorridorParams::default() };
    let building = Arc::new(Building::corridor_with(&params, 3));
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    put_walls(&inside, &building).await;
    teach(&inside, &building, &["poster-0"], 6).await;
    maps.put_robot("r1", MAP).await.expect("robot");
    let client = connect(&inside.server.zenoh_endpoint, "r1").await;
    let mut robot = Robot::new(building.clone(), &RobotParams::default());
    let near = LessonParams { seed: 9, views: 3, ..LessonParams::default() };
    let intrinsics = *sim::camera::Camera::vga().intrinsics();
    let mut located = [0; 2];
    for stop in stops(&building, &near).into_iter().filter(|stop| stop.landmark == "poster-0") {
        let readings = robot.look(&stop.step);
        let (picture, mounting) = (jpeg(&readings.frame.image), readings.step.robot_from_camera);
        let frame = Capture::encoded(picture.clone()).expect("a picture");
        let frame = frame.with_intrinsics(&intrinsics).with_mounting(&mounting);
        let scan = scan_message(&readings, 0);
        let pictured = Sensed::default().with_picture(picture, &intrinsics, &mounting);
        let query = LocaliseQuery::default();
        let asked = [
            (query.clone().with_frame(frame.clone()), pictured.clone()),
            (query.clone().with_scan(scan.clone()), Sensed::default().with_scan(scan_body(&readings))),
            (query.with_frame(frame).with_scan(scan), pictured.with_scan(scan_body(&readings))),
        ];
        let mut results = Vec::new();
        for (query, sensed) in asked {
            let by_zenoh = client.localise(query, SOON).await.expect("a result");
            let by_http = maps.localise(MAP, &sensed).await.expect("a result");
            assert_same(&by_zenoh, &by_http);
            results.push(by_zenoh);
        }
        let [by_frame, _, by_both] = results.as_slice() else { panic!("three results") };
        for (count, result) in located.iter_mut().zip([by_frame, by_both]) {
            if result.status == LocaliseStatus::Located {
                *count += 1;
                let pose = result.map_from_robot.as_ref().and_then(|p| p.pose).expect("a pose");
                let truth = &readings.step.map_from_robot;
                let off_m = (pose.x_m - truth.x_m).hypot(pose.y_m - truth.y_m);
                assert!(off_m < 0.3, "{off_m} m off: {result:?}");
            }
        }
        // The laser knows the distance to the wall better than the camera does.
        if let ([frame], [both]) = (by_frame.hypotheses.as_slice(), by_both.hypotheses.as_slice()) {
            let variance = |c: &[f64]| c[0] + c[4];
            assert!(both.matched.is_some() && both.landmarks == ["poster-0"], "{both:?}");
            let (of_frame, of_both) =
                (variance(&frame.map_from_robot.covariance), variance(&both.map_from_robot.covariance));
            assert!(of_both < of_frame, "{of_both} and {of_frame} m^2");
        }
    }
    assert!(located[0] >= 2 && located[1] >= 2, "{located:?} of 3");
    client.close().await.expect("closed");
    inside.server.stop().await;
}
