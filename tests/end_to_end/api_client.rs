//! Claim: the client covers the HTTP interface: each operation of the OpenAPI document has a
//! method, and the methods of each resource work against a real server.

use client::{
    Capture, ClientError, LandmarkRegion, MapClient, NewView,
    api::{
        AcceptRequest, AcceptedTrackBody, AreaBody, CalibrationRequest, CaptureMetadata, CoverageRequest,
        Distance, FusionModeBody, GazeQueryBody, JobState, LandmarkHealthBody, LandmarkPatch, LandmarkStatus,
        LiveEventBody, MapPatch, MappingStageBody, ModalityBody, ModalityMapPatch, ModalityQuery,
        NewGatheringBody, NewMap, NewMapping, Parent, Place, PoseBody, ReferenceTrajectoryBody, Size,
        TopologyQuery, TransformQuery, UploadOutcomeBody, UploadedView, UploadedViews,
        VisibilitySettingsBody, VisibleRequest, WallsBody,
    },
    http::operations,
};
use map::pose2::{Pose2, Pose2Covariance};
use nalgebra::{Isometry3, Matrix3, Rotation3, Vector3};
use protos::convert::geometry::{intrinsics_wire, pose2_covariance_wire, pose3_wire};
use reqwest::Method;
use serde_json::Value;
use server::config::Limits;
use std::{
    collections::BTreeSet,
    f64::consts::FRAC_PI_2,
    time::{Duration, SystemTime, UNIX_EPOCH},
};
use tests::{
    Inside, SOON, eventually,
    pictures::picture,
    robots::{call, connect},
};

/// Operations without a client method, each with the reason.
const WITHOUT_METHOD: [&str; 0] = [];

#[tokio::test(flavor = "multi_thread")]
async fn every_operation_of_the_document_has_a_method_of_the_client() {
    let inside = Inside::start(Limits::default()).await;
    let (_, document) = call(&inside, Method::GET, "/openapi.json", None).await;
    let mut described = BTreeSet::new();
    for (path, item) in document["paths"].as_object().expect("paths") {
        let path = path.strip_prefix("/api/v1").expect("below /api/v1");
        let methods = item.as_object().expect("methods").keys();
        described.extend(methods.map(|method| format!("{} {path}", method.to_uppercase())));
    }
    let known: BTreeSet<String> = operations().map(|o| format!("{} {}", o.method, o.path)).collect();
    let known_or_not_wanted = known.iter().map(String::as_str).chain(WITHOUT_METHOD).collect::<BTreeSet<_>>();
    let missing: Vec<_> = described.iter().filter(|o| !known_or_not_wanted.contains(o.as_str())).collect();
    assert!(missing.is_empty(), "operations without a method in client/src/http: {missing:?}");
    let gone: Vec<_> = known.difference(&described).collect();
    assert!(gone.is_empty(), "methods of operations that the server does not have: {gone:?}");
    inside.server.stop().await;
}

fn code(result: Result<impl std::fmt::Debug, ClientError>) -> String {
    match result {
        Err(ClientError::Refused { code, .. }) => code,
        other => panic!("not refused: {other:?}"),
    }
}

fn walls() -> WallsBody {
    [[[0.0, 0.0], [10.0, 0.0]], [[10.0, 8.0], [0.0, 8.0]]].into_iter().collect()
}

/// A map with two walls and a poster on the first of them.
async fn hall(maps: &MapClient) {
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    maps.set_walls("hall", &walls()).await.expect("walls");
    let size = Size { width_m: 0.6, height_m: 0.8 };
    let place = Place { x_m: 5.0, z_m: 1.5, theta_rad: FRAC_PI_2, ..Place::default() };
    maps.add_landmark("hall", "poster", Some(size), Some(place)).await.expect("landmark");
}

#[tokio::test(flavor = "multi_thread")]
async fn maps_are_stored_with_all_their_fields() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    assert_eq!(maps.health().await.expect("health").status, "ok");
    assert_eq!(maps.readiness().await.expect("readiness").status, "ready");
    assert_eq!(maps.version().await.expect("version").api, "v1");
    hall(&maps).await;
    assert_eq!(maps.walls("hall").await.expect("walls"), walls());
    let parent =
        Parent { map: "hall".into(), x_m: 1.0, y_m: 2.0, theta_rad: 0.0, level_m: 3.0, covariance: None };
    let new = NewMap { distance: Some(Distance::Hausdorff), parent: Some(parent), ..NewMap::new("attic") };
    let attic = maps.create_map(&new).await.expect("map");
    assert_eq!((attic.distance, attic.parent.expect("a parent").level_m), (Distance::Hausdorff, 3.0));
    let query = TransformQuery { to: "hall".into(), x_m: Some(0.5), y_m: Some(0.0), theta_rad: Some(0.0) };
    let found = maps.transform("attic", &query).await.expect("transform");
    assert!((found.pose.expect("the pose").x_m - 1.5).abs() < 1e-9 && (found.level_m - 3.0).abs() < 1e-9);
    let patch = MapPatch { site: Some(Some("Works / 1".into())), parent: Some(None), ..MapPatch::default() };
    let attic = maps.locate_map("attic", &patch).await.expect("located");
    assert_eq!((attic.site.as_deref(), &attic.parent), (Some("Works / 1"), &None));
    let site = maps.site_topology("Works / 1", &TopologyQuery::default()).await.expect("topology");
    assert_eq!((site.maps.len(), site.places.len()), (1, 0));
    assert_eq!(maps.map("attic").await.expect("map"), attic);
    maps.delete_map("attic").await.expect("deleted");
    assert_eq!(code(maps.map("attic").await), "unknown_map");
    assert_eq!(code(maps.map("no / such?map").await), "unknown_map");
    assert!(matches!(maps.map("..").await, Err(ClientError::Name { field: "map", .. })));
    assert_eq!(maps.maps().await.expect("maps").len(), 1);
    inside.server.stop().await;
}

/// Renames `sign` to `exit`; makes landmark `made` with a view, and deletes it.
async fn rename_and_make(maps: &MapClient) {
    let renamed = LandmarkPatch { name: Some("exit".into()), ..LandmarkPatch::default() };
    assert_eq!(maps.update_landmark("hall", "sign", &renamed).await.expect("renamed").name, "exit");
    let taken = LandmarkPatch { name: Some("poster".into()), ..LandmarkPatch::default() };
    assert_eq!(code(maps.update_landmark("hall", "exit", &taken).await), "exists");
    // A landmark is made with its first view.
    let size = Size { width_m: 0.5, height_m: 0.5 };
    let new = || NewView::new(picture(7), LandmarkRegion::WholeImage);
    assert_eq!(code(maps.upload_view_with("hall", "made", new()).await), "unknown_landmark");
    maps.upload_view_with("hall", "made", new().or_make_landmark(Some(size))).await.expect("made");
    let other = Size { width_m: 50.0, ..size };
    let again = maps.upload_view_with("hall", "made", new().or_make_landmark(Some(other))).await;
    assert_eq!(code(again), "size_differs");
    assert_eq!(maps.landmark("hall", "made").await.expect("landmark").size, Some(size));
    maps.delete_landmark("hall", "made").await.expect("deleted");
}

#[tokio::test(flavor = "multi_thread")]
async fn landmarks_are_placed_patched_taught_and_learnt() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    hall(&maps).await;
    // A sign under the ceiling, and a person's decision on it.
    let place = Place { x_m: 5.0, y_m: 4.0, z_m: 2.5, theta_rad: 0.1, roll_rad: 0.2, tilt_rad: FRAC_PI_2 };
    maps.add_landmark("hall", "sign", None, None).await.expect("landmark");
    let patch = LandmarkPatch {
        place: Some(Some(place)),
        health: Some(LandmarkHealthBody::Quarantined),
        ..LandmarkPatch::default()
    };
    let sign = maps.update_landmark("hall", "sign", &patch).await.expect("patched");
    assert_eq!((sign.place, sign.health, sign.size), (Some(place), LandmarkHealthBody::Quarantined, None));
    let forget = LandmarkPatch { place: Some(None), ..LandmarkPatch::default() };
    assert_eq!(maps.update_landmark("hall", "sign", &forget).await.expect("patched").place, None);
    rename_and_make(&maps).await;
    maps.delete_landmark("hall", "exit").await.expect("deleted");

    // Views, with all capture data.
    let first =
        maps.upload_view("hall", "poster", picture(1), LandmarkRegion::WholeImage).await.expect("view");
    let camera = vision::frame::Intrinsics::new(200.0, 200.0, 80.0, 60.0, vision::frame::Distortion::None);
    let pose =
        Pose2Covariance::new(Pose2::new(5.0, 3.0, -FRAC_PI_2), Matrix3::identity() * 1e-4).expect("a pose");
    let capture = CaptureMetadata {
        intrinsics: intrinsics_wire(&camera.expect("a camera")),
        map_from_robot: pose2_covariance_wire(&pose),
        robot_from_camera: pose3_wire(&Isometry3::translation(0.0, 0.0, 1.5)),
        ceiling_height_m: None,
        corner_covariance_px2: Some([[1.0, 0.0, 1.0]; 4]),
    };
    let corners = LandmarkRegion::Corners([[20.0, 20.0], [80.0, 20.0], [80.0, 100.0], [20.0, 100.0]]);
    let new =
        NewView { capture: Some(capture), keep_near_duplicate: true, ..NewView::new(picture(1), corners) };
    let second = maps.upload_view_with("hall", "poster", new).await.expect("view");
    let placing = second.placing.expect("said");
    assert_eq!((second.outcome, placing.reason.as_deref()), (Some(UploadOutcomeBody::New), Some("by_hand")));
    let views = maps.views("hall", "poster").await.expect("views");
    assert_eq!(views.iter().map(|v| v.id).collect::<Vec<_>>(), [first.id, second.id]);
    assert_eq!(maps.view_image("hall", "poster", first.id).await.expect("picture"), picture(1));
    let icon = maps.view_icon("hall", "poster", first.id).await.expect("icon");
    assert!(icon.starts_with(b"\x89PNG"));
    maps.delete_view("hall", "poster", second.id).await.expect("deleted");

    // Lessons: one landmark followed by its events, then the map.
    let job = maps.learn_landmark("hall", "poster", Some(4)).await.expect("job");
    let (mut events, mut last) = (maps.job_events(job.id).await.expect("events"), None);
    while let Some(job) = tokio::time::timeout(SOON, events.next()).await.expect("in time").expect("an event")
    {
        last = Some(job);
    }
    assert_eq!(last.expect("an event").state, JobState::Done);
    let job = maps.learn("hall", Some(&["poster".into()]), Some(4)).await.expect("job");
    let job = maps.wait_for_job(job, SOON, |_| {}).await.expect("done");
    assert_eq!(maps.cancel_job(job.id).await.expect("job"), maps.job(job.id).await.expect("job"));
    let all = maps.landmarks("hall").await.expect("landmarks");
    assert!(
        all.len() == 1 && all[0].model.is_some() && all[0].status != LandmarkStatus::NotLearnt,
        "{all:?}"
    );
    let answer = maps.recognise("hall", picture(1), None).await.expect("an answer");
    assert_eq!(answer.map, "hall");
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn visibility_follows_the_settings_of_the_map() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    hall(&maps).await;
    let wide = VisibilitySettingsBody { focal_px: Some(300.0), ..VisibilitySettingsBody::default() };
    let set = maps.set_visibility_settings("hall", &wide).await.expect("set");
    assert!(set.focal_px == Some(300.0) && set.max_fill.is_some(), "{set:?}");
    assert_eq!(maps.visibility_settings("hall").await.expect("settings"), set);
    let other = VisibilitySettingsBody { focal_px: Some(900.0), ..VisibilitySettingsBody::default() };
    let own = VisibilitySettingsBody::default();
    let area = async |settings: &VisibilitySettingsBody| {
        maps.visibility_area("hall", "poster", settings).await.expect("an area")
    };
    let (near, far) = (area(&own).await, area(&other).await);
    assert_eq!((near.kind.as_str(), near.properties.landmark.as_str()), ("Feature", "poster"));
    assert!(near.properties.reach_m < far.properties.reach_m && !far.geometry.coordinates.is_empty());
    let pose = PoseBody { x_m: 5.0, y_m: 1.5, theta_rad: -FRAC_PI_2, covariance: None };
    let request = VisibleRequest { pose, visibility_settings: own };
    let visible = maps.visible("hall", &request).await.expect("visible").landmarks;
    assert!(
        visible.len() == 1 && visible[0].landmark == "poster" && visible[0].margin_m > 0.0,
        "{visible:?}"
    );
    let path = CoverageRequest::new(vec![[0.5, 1.5], [9.5, 1.5]]);
    let coverage = maps.coverage("hall", &path).await.expect("coverage");
    assert!((coverage.length_m - 9.0).abs() < 1e-9 && (0.0..1.0).contains(&coverage.share), "{coverage:?}");
    let query = GazeQueryBody { pose, ..GazeQueryBody::default() };
    let ranking = maps.gaze_ranking("hall", &query).await.expect("ranking");
    // A landmark without a model is no gaze target.
    assert_eq!(
        (ranking.map_version, ranking.ranked.len()),
        (maps.map("hall").await.expect("map").version, 0)
    );
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_is_observable_from_its_first_frame_to_its_deletion() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    hall(&maps).await;
    maps.put_robot("r1", "hall").await.expect("robot");
    let mut live = maps.live_events("hall").await.expect("events");
    let robot = connect(&inside.server.zenoh_endpoint, "r1").await;
    let capture = Capture::encoded(picture(1)).expect("a picture").with_odometry(&Pose2::default());
    let answer = robot.recognise("front", capture, SOON).await.expect("an answer");
    let event = async {
        loop {
            match live.next().await.expect("an event").expect("the stream goes on") {
                LiveEventBody::Answer(answer) => return answer,
                other => assert!(!matches!(other, LiveEventBody::Missed(_)), "{other:?}"),
            }
        }
    };
    let event = tokio::time::timeout(SOON, event).await.expect("in time");
    assert_eq!((event.robot.as_str(), event.camera.as_str(), event.answer.seq), ("r1", "front", answer.seq));

    let frame = maps.camera_frame("r1", "front").await.expect("a frame");
    assert_eq!((frame.seq, frame.media_type.as_str(), frame.image), (answer.seq, "image/png", picture(1)));
    assert_eq!(maps.camera_answer("r1", "front").await.expect("an answer").seq, answer.seq);
    assert!(maps.cameras("r1").await.expect("cameras").is_empty(), "no landmark was recognised");
    assert_eq!(maps.trajectories("r1").await.expect("trajectories").pose, []);
    assert!(!maps.relocalisation("r1").await.expect("relocalisation").relocalising);
    assert_eq!(maps.corrections("r1").await.expect("corrections").corrections, []);
    assert!(!maps.ros2_status("r1").await.expect("messages of ROS").configured);
    let known = maps.robot("r1").await.expect("robot");
    assert!(known.alive && known.epoch.is_some() && known.conflict.is_none(), "{known:?}");
    assert_eq!(maps.robots().await.expect("robots").len(), 1);

    let views = Some(uploaded_views());
    let request = CalibrationRequest { uploaded_views: views, ..CalibrationRequest::default() };
    let report = maps.calibrate_camera("r1", "front", &request).await.expect("a report");
    assert!((report.intrinsics.fx_px - 500.0).abs() < 5.0 && report.views.len() == 5, "{report:?}");
    let nothing = maps.calibrate_camera("r1", "front", &CalibrationRequest::default()).await;
    assert_eq!(code(nothing), "unknown_camera");
    robot.close().await.expect("closed");
    maps.delete_robot("r1").await.expect("deleted");
    assert_eq!(code(maps.robot("r1").await), "unknown_robot");
    inside.server.stop().await;
}

/// A rectangle of 0.6 m by 0.8 m, 2 m away and turned, in the image of a camera of 500 px.
fn uploaded_views() -> UploadedViews {
    let view = |(pitch, yaw): (f64, f64)| {
        let turned = Rotation3::from_euler_angles(pitch, yaw, 0.0);
        let corners = [[-0.3, -0.4], [0.3, -0.4], [0.3, 0.4], [-0.3, 0.4]].map(|[x, y]| {
            let p = turned * Vector3::new(x, y, 0.0) + Vector3::new(0.0, 0.0, 2.0);
            [500.0 * p.x / p.z + 319.5, 500.0 * p.y / p.z + 239.5]
        });
        UploadedView { corners }
    };
    let angles = [(0.0, 0.7), (0.0, -0.7), (0.7, 0.0), (-0.7, 0.0), (0.5, 0.5)];
    let views = angles.into_iter().map(view).collect();
    UploadedViews { width_px: 640, height_px: 480, size_width_m: 0.6, size_height_m: 0.8, views }
}

#[tokio::test(flavor = "multi_thread")]
async fn drives_are_recorded_mapped_and_gathered() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    hall(&maps).await;
    maps.put_robot("r1", "hall").await.expect("robot");

    // A drive of 1 m with a known path.
    assert!(maps.start_recording("r1").await.expect("begun").active);
    let robot = connect(&inside.server.zenoh_endpoint, "r1").await;
    let mut poses = Vec::new();
    for step in 0..=20 {
        let x_m = 0.05 * f64::from(step);
        let captured_ns = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_nanos() as i64;
        robot.publish_odometry_at(captured_ns, &Pose2::new(x_m, 0.0, 0.0)).await.expect("sent");
        poses.push((captured_ns, 4.0 + x_m, 2.0, 0.0));
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let whole = || async { (maps.recording("r1").await.expect("recording").odometry == 21).then_some(()) };
    eventually("all is recorded", whole).await;
    let trajectory = ReferenceTrajectoryBody { poses, ..ReferenceTrajectoryBody::default() };
    let run = maps.finish_recording("r1", &trajectory).await.expect("learnt");
    assert_eq!(run.statistics.iter().map(|s| s.modality).next(), Some(ModalityBody::Odometry));
    assert_eq!(maps.reference_runs("hall").await.expect("runs"), std::slice::from_ref(&run));
    maps.start_recording("r1").await.expect("begun");
    maps.cancel_recording("r1").await.expect("given up");
    assert_eq!(code(maps.recording("r1").await), "not_recording");

    // Fusion mode, and statistics by modality and place.
    let door = AreaBody { name: "door".into(), corners_m: vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]] };
    let patch = ModalityMapPatch { fusion_mode: Some(FusionModeBody::Best), areas: Some(vec![door]) };
    let set = maps.set_modalities("hall", &patch).await.expect("set");
    assert_eq!((set.fusion_mode, set.areas.len(), set.cells.len()), (FusionModeBody::Best, 1, run.cells));
    assert_eq!(maps.modalities("hall").await.expect("modalities"), set);
    let query = ModalityQuery { x_m: 4.5, y_m: 2.0, theta_rad: 0.0 };
    let here = maps.modalities_at("hall", &query).await.expect("known");
    assert!(here.statistics.len() == 3 && here.statistics[0].steps > 0, "{here:?}");
    maps.delete_reference_run("hall", run.id).await.expect("deleted");
    assert_eq!(maps.reference_runs("hall").await.expect("runs"), []);

    // A mapping that is cancelled, one without any wall, and one whose walls were to be held.
    let new = NewMapping { robot: "r1".into(), origin: Some([1.0, 2.0, 0.0]), landmarks: false };
    assert_eq!(maps.start_mapping("hall", &new).await.expect("begun").stage, MappingStageBody::Mapping);
    maps.cancel_mapping("hall").await.expect("given up");
    maps.start_mapping("hall", &new).await.expect("begun");
    maps.finish_mapping("hall").await.expect("finished");
    let failed = || async {
        (maps.mapping("hall").await.expect("mapping").stage == MappingStageBody::Failed).then_some(())
    };
    eventually("nothing to store", failed).await;
    maps.start_mapping("hall", &new).await.expect("begun");
    maps.hold_mapping("hall").await.expect("finished");
    eventually("nothing to hold", failed).await;
    assert_eq!(maps.walls("hall").await.expect("walls"), walls());

    // A gathering without tracks.
    let new = NewGatheringBody { robot: "r1".into(), ..NewGatheringBody::default() };
    let gathering = maps.start_gathering("hall", &new).await.expect("begun");
    assert!(maps.gathering("hall", gathering.id).await.expect("gathering").open);
    assert_eq!(maps.tracks("hall", gathering.id).await.expect("tracks"), []);
    assert!(!maps.stop_gathering("hall", gathering.id).await.expect("ended").open);
    let track = AcceptedTrackBody { track: 1, name: Some("window".into()) };
    let request = AcceptRequest { tracks: vec![track], learn: false };
    assert_eq!(code(maps.accept_tracks("hall", gathering.id, &request).await), "unknown_track");
    assert_eq!(code(maps.discard_track("hall", gathering.id, 1).await), "unknown_track");
    assert_eq!(code(maps.track_icon("hall", gathering.id, 1, 1).await), "unknown_view");
    assert_eq!(maps.gatherings("hall").await.expect("gatherings").len(), 1);
    maps.delete_gathering("hall", gathering.id).await.expect("deleted");
    robot.close().await.expect("closed");
    inside.server.stop().await;
}

/// Every `$ref` of the OpenAPI document resolves; programs in other languages rely on it.
#[tokio::test(flavor = "multi_thread")]
async fn every_reference_of_the_document_leads_to_a_schema() {
    fn references<'a>(value: &'a Value, found: &mut BTreeSet<&'a str>) {
        match value {
            Value::Object(fields) => {
                found.extend(fields.get("$ref").and_then(Value::as_str));
                fields.values().for_each(|value| references(value, found));
            }
            Value::Array(items) => items.iter().for_each(|value| references(value, found)),
            _ => {}
        }
    }
    let inside = Inside::start(Limits::default()).await;
    let (_, document) = call(&inside, Method::GET, "/openapi.json", None).await;
    let mut found = BTreeSet::new();
    references(&document, &mut found);
    assert!(found.len() > 50, "{found:?}");
    for reference in found {
        let pointer = reference.strip_prefix('#').expect("in this document");
        assert!(document.pointer(pointer).is_some(), "{reference} leads nowhere");
    }
    inside.server.stop().await;
}
