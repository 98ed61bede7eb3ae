//! Claim: what a robot was told can be opened again, with the pictures that it rests on and what
//! was learnt of the landmark.

use client::{
    api::{
        AnswerStatus, DuplicateQuery, LandmarkModelQuery, ModelPictureQuery, NewMap, NumberOrder,
        PriorSource, StoredAnswerQuery, ViewQuery,
    },
    v1::Verdict,
};
use server::config::Limits;
use sim::{building::Building, corridor::CorridorParams};
use std::{sync::Arc, time::Duration};
use tests::{
    Inside, SOON, eventually,
    robots::{MAP, capture, connect, find_itself, teach},
};

const OTHER: &str = "cellar";

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_is_opened_again_with_what_it_rests_on() {
    let inside = Inside::start(Limits::default()).await;
    let params = CorridorParams { posters: 1, column: false, ..CorridorParams::default() };
    let building = Arc::new(Building::corridor_with(&params, 3));
    let maps = inside.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    maps.create_map(&NewMap::new(OTHER)).await.expect("map");
    teach(&inside, &building, &["poster-0"], 6).await;
    maps.put_robot("r1", MAP).await.expect("robot");
    let robot = connect(&inside.server.zenoh_endpoint, "r1").await;
    let readings = find_itself(&inside, &building, &robot, "r1").await;

    let about = StoredAnswerQuery {
        robot: Some("r1".into()),
        landmark: Some("poster-0".into()),
        status: Some(AnswerStatus::Matched),
        ..StoredAnswerQuery::default()
    };
    let stored = eventually("a stored answer", async || {
        maps.stored_answers(&about).await.expect("answers").items.into_iter().next()
    });
    let summary = stored.await;
    assert!(summary.has_pose && summary.refusal.is_none(), "{summary:?}");
    assert_eq!((summary.map.as_str(), summary.landmarks.as_slice()), (MAP, &["poster-0".to_owned()][..]));
    let opened = maps.stored_answer(summary.id).await.expect("the answer");
    let quad = opened.answer.quads.iter().position(|quad| quad.verdict() == Verdict::Unique).expect("a quad");
    assert!(opened.answer.map_from_robot.is_some() && opened.answer.quads[quad].pose.is_some());
    assert!(opened.quads[quad].icon.is_some(), "{:?}", opened.quads[quad]);
    assert!(opened.quads[quad].landmarks.iter().any(|l| l.landmark == "poster-0" && l.icon.is_some()));
    let matched = opened.quads[quad].matched.as_ref().expect("matches");
    let agreeing = matched.matches.iter().filter(|m| m.agrees).count();
    assert!(matched.landmark == "poster-0" && agreeing >= 8 && matched.matches.len() <= 100, "{matched:?}");
    let quad_icon = maps.stored_quad_icon(summary.id, quad).await.expect("its icon");
    let landmark_icon =
        maps.landmark_icon(MAP, "poster-0", ModelPictureQuery::default()).await.expect("icon");
    for icon in [&quad_icon, &landmark_icon] {
        let icon = image::load_from_memory(icon).expect("a picture");
        assert_eq!((icon.width(), icon.height()), (75, 75));
    }

    // Another kind of answer of the same camera, a second later.
    tokio::time::sleep(Duration::from_millis(1100)).await;
    robot.recognise("front", capture(&readings).against_map(OTHER), SOON).await.expect("an answer");
    let other = StoredAnswerQuery { map: Some(OTHER.into()), ..StoredAnswerQuery::default() };
    let refused = eventually("the other answer", async || {
        maps.stored_answers(&other).await.expect("answers").items.into_iter().next()
    });
    let refused = refused.await;
    assert_eq!((refused.status, refused.has_pose), (AnswerStatus::NoMatch, false), "{refused:?}");

    // The robot has a pose by now: a later answer says how far that of the picture is from it.
    let with_prior = eventually("an answer with a prior", async || {
        robot.recognise("front", capture(&readings), SOON).await.expect("an answer");
        let newest = maps.stored_answers(&about).await.expect("answers").items.into_iter().next()?;
        maps.stored_answer(newest.id).await.expect("the answer").prior_check
    });
    let check = with_prior.await;
    assert!(check.source == PriorSource::Server && !check.refused && check.seen.is_some(), "{check:?}");
    assert!(check.distance2.is_some_and(|d2| d2 < check.limit), "{check:?}");

    let query = LandmarkModelQuery { harris: Some(true) };
    let model = maps.landmark_model(MAP, "poster-0", query).await.expect("the model");
    assert!(model.in_use && model.correlation.threshold > 0.0 && !model.keypoints.is_empty(), "{model:?}");
    assert_eq!(model.harris.len(), model.exemplars);
    let distances = maps.landmark_distances(MAP, "poster-0").await.expect("distances");
    assert!(distances.correlation.own.iter().sum::<u32>() > 0, "{distances:?}");
    assert_eq!(maps.duplicates(MAP, &DuplicateQuery::default()).await.expect("pairs").total, 0);
    let newest =
        ViewQuery { sort: Some(NumberOrder::NumberReversed), limit: Some(1), ..ViewQuery::default() };
    let page = maps.find_views(MAP, "poster-0", &newest).await.expect("views");
    let all = maps.views(MAP, "poster-0").await.expect("views");
    assert_eq!((page.items.last(), page.total), (all.last(), all.len() as u64));
    robot.close().await.expect("closed");
    inside.server.stop().await;
}
