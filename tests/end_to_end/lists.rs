//! Claim: lists are read by filter, order and page through the SDK, several landmarks are made and
//! deleted together or not at all, and jobs are listed, also by the command line.

use client::{
    ClientError, LandmarkRegion,
    api::{JobQuery, JobState, LandmarkDeletion, LandmarkQuery, ListOrder, ListQuery, NewLandmark, NewMap},
};
use server::config::Limits;
use tests::{Inside, SOON, command::waymark, pictures::picture};

#[tokio::test(flavor = "multi_thread")]
async fn lists_are_found_and_several_landmarks_are_one_change() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    for name in ["hall", "yard"] {
        maps.create_map(&NewMap::new(name)).await.expect("map");
    }
    maps.put_robot("r1", "hall").await.expect("robot");
    let named = |part: &str| ListQuery { name: Some(part.into()), ..ListQuery::default() };
    let found = maps.find_maps(&named("ar")).await.expect("maps");
    assert_eq!((found.items[0].name.as_str(), found.total), ("yard", 1));
    assert_eq!(maps.find_robots(&named("r")).await.expect("robots").total, 1);
    let new = |name: &str| NewLandmark { name: name.into(), ..NewLandmark::default() };
    let made = maps.add_landmarks("hall", &[new("door"), new("sign"), new("poster")]).await;
    assert_eq!(made.expect("landmarks"), 3);
    match maps.add_landmarks("hall", &[new("lamp"), new("sign")]).await {
        Err(ClientError::Refused { code, field, .. }) => {
            assert_eq!((code.as_str(), field.as_str()), ("exists", "landmarks[1].name"));
        }
        other => panic!("{other:?}"),
    }
    let query = LandmarkQuery {
        sort: Some(ListOrder::NameReversed),
        limit: Some(2),
        has_place: Some(false),
        ..LandmarkQuery::default()
    };
    let page = maps.find_landmarks("hall", &query).await.expect("landmarks");
    let names: Vec<_> = page.items.iter().map(|landmark| landmark.name.as_str()).collect();
    assert_eq!((names, page.total), (vec!["sign", "poster"], 3));
    let rest = LandmarkQuery { cursor: page.next, ..query };
    let rest = maps.find_landmarks("hall", &rest).await.expect("landmarks");
    assert_eq!((rest.items[0].name.as_str(), rest.next), ("door", None));
    let gone = ["door", "sign"].map(|name| LandmarkDeletion { name: name.into(), revision: None });
    assert_eq!(maps.delete_landmarks("hall", &gone).await.expect("deleted"), 2);

    maps.upload_view("hall", "poster", picture(1), LandmarkRegion::WholeImage).await.expect("view");
    let job = maps.learn("hall", None, None).await.expect("job");
    maps.wait_for_job(job, 3 * SOON, |_| {}).await.expect("done");
    let done = JobQuery { state: Some(JobState::Done), map: Some("hall".into()), ..JobQuery::default() };
    let jobs = maps.jobs(&done).await.expect("jobs");
    assert_eq!((jobs.items[0].id, jobs.total), (1, 1));
    let elsewhere = JobQuery { map: Some("yard".into()), ..JobQuery::default() };
    assert_eq!(maps.jobs(&elsewhere).await.expect("jobs").total, 0);
    let url = inside.url();
    let listed = tokio::task::spawn_blocking(move || {
        waymark(["job", "list", "--state", "done", "--json", "--server", &url], 3 * SOON)
    });
    let listed = listed.await.expect("it ends");
    assert_eq!(listed.status, 0, "{listed:?}");
    assert!(listed.stdout.contains("\"hall\"") && listed.stdout.contains("\"done\""), "{listed:?}");
    inside.server.stop().await;
}
