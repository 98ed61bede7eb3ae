//! Claim: a map that is saved and loaded into an empty server gives the same answers, and is saved
//! as the same bytes again.

use client::{
    MapClient,
    api::{BundleQuery, NewMap},
};
use server::config::Limits;
use sim::{building::Building, corridor::CorridorParams};
use std::sync::Arc;
use tests::{
    Inside, SOON,
    robots::{MAP, capture, connect, find_itself, teach},
};

async fn saved(maps: &MapClient, map: &str) -> Vec<u8> {
    let (mut file, mut bytes) = (maps.save_map(map).await.expect("a bundle"), Vec::new());
    while let Some(part) = file.next().await.expect("the bundle") {
        bytes.extend(part);
    }
    assert_eq!(file.length(), Some(bytes.len() as u64));
    bytes
}

#[tokio::test(flavor = "multi_thread")]
async fn a_loaded_map_answers_as_the_saved_one() {
    let (first, second) = (Inside::start(Limits::default()).await, Inside::start(Limits::default()).await);
    let params = CorridorParams { posters: 2, column: false, ..CorridorParams::default() };
    let building = Arc::new(Building::corridor_with(&params, 3));
    first.maps().create_map(&NewMap::new(MAP)).await.expect("map");
    teach(&first, &building, &["poster-0", "poster-1"], 6).await;
    let bundle = saved(&first.maps(), MAP).await;
    let mut damaged = bundle.clone();
    damaged[bundle.len() / 2] ^= 1;
    let query = BundleQuery::default();
    let refused = second.maps().load_map(damaged, &query).await.map_err(|e| e.to_string());
    assert!(refused.as_ref().is_err_and(|e| e.contains("bundle_damaged")), "{refused:?}");
    assert!(second.maps().maps().await.expect("maps").is_empty(), "nothing is left of it");
    // With one key it is loaded once.
    let keyed = second.maps().with_idempotency_key("once");
    let made = keyed.load_map(bundle.clone(), &query).await.expect("loaded");
    assert_eq!(keyed.load_map(bundle.clone(), &query).await.expect("the same"), made);
    assert_eq!((made.name.as_str(), made.landmarks), (MAP, 2));
    assert_eq!(saved(&second.maps(), MAP).await, bundle, "saved again it is the same");

    let mut answers = Vec::new();
    for inside in [&first, &second] {
        inside.maps().put_robot("r1", MAP).await.expect("robot");
        let robot = connect(&inside.server.zenoh_endpoint, "r1").await;
        let readings = find_itself(inside, &building, &robot, "r1").await;
        let answer = robot.recognise("front", capture(&readings), SOON).await.expect("an answer");
        answers.push((answer.status(), answer.quads, answer.map_from_robot, answer.pose_landmarks));
    }
    assert!(answers[0].2.is_some() && answers[0].3 == ["poster-0"], "{answers:?}");
    assert_eq!(answers[0], answers[1], "names, distances and poses, to the last bit");
    first.server.stop().await;
    second.server.stop().await;
}
