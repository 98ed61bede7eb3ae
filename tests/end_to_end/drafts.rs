//! Claim: a draft is edited beside a map in use, and no robot sees it; what it would change for a
//! robot is known before it is published, and is what happens then.

use client::{
    RobotClient,
    api::{LandmarkPatch, NewMap, PageQuery, Place, ReplayedPose},
    v1,
};
use server::config::Limits;
use sim::{building::Building, corridor::CorridorParams, robot::SensorReadings};
use std::sync::Arc;
use tests::{
    Inside, SOON, eventually,
    robots::{MAP, capture, connect, find_itself, teach},
};

const DRAFT: &str = "building-draft";

async fn told(robot: &RobotClient, readings: &SensorReadings) -> v1::Answer {
    robot.recognise("front", capture(readings), SOON).await.expect("an answer")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_draft_is_tried_with_the_frames_of_a_robot_that_does_not_see_it() {
    let inside = Inside::start(Limits::default()).await;
    let params = CorridorParams { posters: 1, column: false, ..CorridorParams::default() };
    let building = Arc::new(Building::corridor_with(&params, 3));
    let maps = inside.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    teach(&inside, &building, &["poster-0"], 6).await;
    maps.begin_draft(MAP, DRAFT).await.expect("a draft");
    let nothing = maps.replay_draft(MAP, DRAFT, None).await.expect("a report");
    assert_eq!((nothing.frames, nothing.robots.len()), (0, 0), "no robot has driven");
    maps.put_robot("r1", MAP).await.expect("robot");
    let robot = connect(&inside.server.zenoh_endpoint, "r1").await;
    let readings = find_itself(&inside, &building, &robot, "r1").await;
    let same = maps.replay_draft(MAP, DRAFT, None).await.expect("a report");
    assert!(same.frames > 0 && same.unchanged == same.frames, "{same:?}");

    // 30 cm to the side on the draft; the robot goes on by the map.
    let here = maps.landmark(MAP, "poster-0").await.expect("landmark").place.expect("a place");
    let aside = Place {
        y_m: here.y_m + 0.3 * here.theta_rad.cos(),
        x_m: here.x_m - 0.3 * here.theta_rad.sin(),
        ..here
    };
    let patch = LandmarkPatch { place: Some(Some(aside)), ..LandmarkPatch::default() };
    maps.update_landmark(DRAFT, "poster-0", &patch).await.expect("moved");
    let shown = maps.draft_difference(MAP, DRAFT, &PageQuery::default()).await.expect("a difference");
    let [poster] = shown.landmarks.items.as_slice() else { panic!("{shown:?}") };
    let places = [poster.before, poster.after].map(|side| side.and_then(|side| side.place));
    assert_eq!((poster.fields.as_slice(), places), (&["place".to_owned()][..], [Some(here), Some(aside)]));
    let before = told(&robot, &readings).await;
    assert_eq!(before.map, MAP);
    let moved = eventually("the draft's version", async || {
        let report = maps.replay_draft(MAP, DRAFT, Some(100)).await.expect("a report");
        (report.unchanged < report.frames).then_some(report)
    });
    let moved = moved.await;
    let [r1] = moved.robots.as_slice() else { panic!("{moved:?}") };
    assert_eq!((r1.robot.as_str(), r1.lost, r1.gained, r1.pose_lost), ("r1", 0, 0, 0), "{r1:?}");
    assert!(r1.pose_moved > 0 && (r1.longest_move_m - 0.3).abs() < 0.02, "{r1:?}");

    // Deleted on the draft: the robot would know nothing of it.
    maps.delete_landmark(DRAFT, "poster-0").await.expect("deleted");
    let lost = eventually("the draft's version", async || {
        let report = maps.replay_draft(MAP, DRAFT, Some(100)).await.expect("a report");
        report.changes.iter().any(|change| change.pose == ReplayedPose::Lost).then_some(report)
    });
    let lost = lost.await;
    assert!(lost.changes.iter().all(|c| c.lost == ["poster-0"] && c.gained.is_empty()), "{lost:?}");
    assert_eq!(told(&robot, &readings).await.status(), v1::Status::Matched, "robots do not see the draft");
    maps.publish_draft(MAP, DRAFT).await.expect("published");
    eventually("the answer that was foretold", async || {
        (told(&robot, &readings).await.status() == v1::Status::NoMatch).then_some(())
    })
    .await;
    let gone = maps.replay_draft(MAP, DRAFT, None).await.map_err(|e| e.to_string());
    assert!(gone.is_err_and(|e| e.contains("unknown_draft")));
    inside.server.stop().await;
}
