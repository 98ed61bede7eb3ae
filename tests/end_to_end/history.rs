//! Claim: a wrong view that was taught is undone: after a roll back every landmark has the
//! thresholds that it had, and every photograph the answer that it had. A deleted landmark comes
//! back. The history says who did what, and why.

use client::{
    ClientError, LandmarkRegion, MapClient,
    api::{
        ChangeKind, DifferenceQuery, Landmark, NewMap, NewToken, PageQuery, Place, Role, Size, SizeAndPlace,
    },
};
use server::config::Limits;
use std::time::Duration;
use tests::{Inside, SOON, command::waymark, pictures::picture};

const MAP: &str = "hall";
/// By poster: the seed of its picture.
const POSTERS: [(&str, u64); 3] = [("atlas", 11), ("birch", 12), ("comet", 13)];
const LONGEST: Duration = Duration::from_mins(2);

async fn teach(maps: &MapClient, landmark: &str, seed: u64) {
    let view = maps.upload_view(MAP, landmark, picture(seed), LandmarkRegion::WholeImage).await;
    view.unwrap_or_else(|error| panic!("{landmark}, {seed}: {error}"));
}

async fn learn(maps: &MapClient, landmarks: Option<&[String]>) {
    let job = maps.learn(MAP, landmarks, None).await.expect("job");
    maps.wait_for_job(job, 3 * SOON, |_| {}).await.expect("the lesson ends");
}

/// The landmarks without what counts their edits.
async fn landmarks(maps: &MapClient) -> Vec<Landmark> {
    let all = maps.landmarks(MAP).await.expect("landmarks");
    all.into_iter().map(|landmark| Landmark { revision: String::new(), ..landmark }).collect()
}

/// What the server answers to the photograph of each poster, and of one that is none.
async fn answers(maps: &MapClient) -> Vec<String> {
    let mut all = Vec::new();
    for seed in [11, 12, 13, 99] {
        let answer = maps.recognise(MAP, picture(seed), None).await.expect("an answer");
        all.push(format!("{:?} {:?}", answer.status, answer.quads));
    }
    all
}

async fn newest(maps: &MapClient) -> u64 {
    maps.commits(MAP, &PageQuery::default()).await.expect("commits").items[0].id
}

/// A map with three posters that are learnt.
async fn taught(inside: &Inside) -> MapClient {
    let maps = inside.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    for (i, (name, seed)) in POSTERS.into_iter().enumerate() {
        let place = Place { x_m: i as f64 * 2.0, z_m: 1.5, ..Place::default() };
        let size = Size { width_m: 0.8, height_m: 0.6 };
        maps.add_landmark(MAP, name, Some(size), Some(place)).await.expect("landmark");
        teach(&maps, name, seed).await;
    }
    learn(&maps, None).await;
    maps
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_view_is_undone_with_all_that_followed_from_it() {
    let inside = Inside::start(Limits::default()).await;
    let maps = taught(&inside).await;
    let (good, was, answered) = (newest(&maps).await, landmarks(&maps).await, answers(&maps).await);

    let hasty = maps.with_reason("für den Rundgang");
    teach(&hasty, "atlas", 12).await;
    learn(&hasty, Some(&["atlas".to_owned()])).await;
    maps.delete_landmark(MAP, "comet").await.expect("deleted");
    assert_ne!(landmarks(&maps).await, was);

    let asked = DifferenceQuery { from: good, limit: Some(1), ..DifferenceQuery::default() };
    let first = maps.difference(MAP, &asked).await.expect("a difference");
    assert_eq!(
        (first.landmarks.total, first.summary.landmarks_removed, first.summary.views_added),
        (3, 1, 1)
    );
    let rest = DifferenceQuery { cursor: first.landmarks.next.clone(), limit: None, ..asked };
    let rest = maps.difference(MAP, &rest).await.expect("a difference").landmarks.items;
    let all: Vec<_> =
        first.landmarks.items.iter().chain(&rest).map(|l| (l.name.as_str(), l.change)).collect();
    let (changed, removed) = (ChangeKind::Changed, ChangeKind::Removed);
    assert_eq!(all, [("atlas", changed), ("birch", changed), ("comet", removed)]);
    assert!(first.landmarks.items[0].views_added == 1 && rest[0].model_changed && rest[0].views_added == 0);

    let x_m = |side: Option<SizeAndPlace>| side.map(|side| side.place.map(|place| place.x_m));
    let shown: Vec<_> = rest.iter().map(|l| [x_m(l.before), x_m(l.after)]).collect();
    assert_eq!(shown, [[Some(Some(2.0)), Some(Some(2.0))], [Some(Some(4.0)), None]]);
    assert_eq!(rest[1].before.and_then(|side| side.size), Some(Size { width_m: 0.8, height_m: 0.6 }));
    let commits = maps.commits(MAP, &PageQuery::default()).await.expect("commits").items;
    let told: Vec<_> =
        commits.iter().take(3).map(|c| (c.author.as_str(), c.operation.as_str(), c.why.as_deref())).collect();
    let reason = Some("für den Rundgang");
    assert_eq!(
        told,
        [
            ("local", "DELETE /maps/{map}/landmarks/{landmark}", None),
            ("local", "learn", reason),
            ("local", "POST /maps/{map}/landmarks/{landmark}/views", reason),
        ]
    );
    assert!(commits[1].job.is_some() && commits[0].parent == Some(commits[1].id));

    let done = maps.roll_back(MAP, good).await.expect("rolled back");
    assert!(done.changed && done.commit.summary.landmarks_added == 1, "{done:?}");
    assert_eq!(landmarks(&maps).await, was, "thresholds, views, places");
    assert_eq!(answers(&maps).await, answered);
    let view = maps.views(MAP, "comet").await.expect("views")[0].id;
    assert_eq!(maps.view_image(MAP, "comet", view).await.expect("its photograph"), picture(13));
    let none = maps.difference(MAP, &DifferenceQuery { from: good, ..DifferenceQuery::default() }).await;
    assert_eq!(none.expect("a difference").landmarks.total, 0);
    inside.server.stop().await;
}

fn code(result: Result<impl std::fmt::Debug, ClientError>) -> (u16, String) {
    match result {
        Err(ClientError::Refused { status, code, .. }) => (status, code),
        other => panic!("{other:?}"),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn ways_back_are_for_operators_and_overwrite_nobody() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    let empty = newest(&maps).await;
    maps.add_landmark(MAP, "door", None, None).await.expect("landmark");
    let made = newest(&maps).await;
    let seen = maps.map(MAP).await.expect("map").revision;
    maps.rename_map(MAP, "hall-2").await.expect("renamed");
    maps.rename_map("hall-2", MAP).await.expect("renamed");
    assert_eq!(code(maps.if_match(&seen).roll_back(MAP, empty).await), (412, "changed_meanwhile".to_owned()));
    assert_eq!(code(maps.roll_back(MAP, 999).await), (404, "unknown_commit".to_owned()));
    assert_eq!(code(maps.undo_commit(MAP, empty).await), (409, "in_use".to_owned()));
    let both = DifferenceQuery { from: made, to: Some(empty), ..DifferenceQuery::default() };
    assert_eq!(code(maps.difference(MAP, &both).await), (422, "out_of_range".to_owned()));
    maps.create_map(&NewMap::new("other")).await.expect("map");
    assert_eq!(
        code(maps.roll_back("other", made).await),
        (404, "unknown_commit".to_owned()),
        "of another map"
    );

    let token = |role, maps: Option<Vec<String>>| NewToken { name: "kim".into(), role, maps, valid_s: None };
    let of = async |role, for_maps| {
        let made = maps.create_token(&token(role, for_maps)).await.expect("token");
        inside.maps().with_token(&made.text)
    };
    let (viewer, teacher) = (of(Role::Viewer, None).await, of(Role::Teacher, None).await);
    assert!(viewer.commits(MAP, &PageQuery::default()).await.is_ok());
    assert_eq!(code(teacher.roll_back(MAP, empty).await), (403, "forbidden".to_owned()));
    let elsewhere = of(Role::Operator, Some(vec!["other".into()])).await;
    assert_eq!(code(elsewhere.commits(MAP, &PageQuery::default()).await).0, 404);
    teacher.delete_landmark(MAP, "door").await.expect("deleted");
    let operator = of(Role::Operator, None).await;
    let deleted = newest(&maps).await;
    let undone = operator.with_reason("kim was mistaken").undo_commit(MAP, deleted).await.expect("undone");
    assert_eq!(
        (undone.commit.author.as_str(), undone.commit.why.as_deref()),
        ("kim", Some("kim was mistaken"))
    );
    assert_eq!(maps.landmarks(MAP).await.expect("landmarks").len(), 1);
    let refused = operator.undo_commit(MAP, made).await;
    assert!(
        matches!(&refused, Err(ClientError::Refused { code, more, .. })
        if code == "changed_since" && more["by"].as_u64() > Some(deleted)),
        "{refused:?}"
    );
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_command_line_lists_compares_and_goes_back() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    maps.add_landmark(MAP, "door", None, None).await.expect("landmark");
    let made = newest(&maps).await;
    maps.with_reason("it is gone").delete_landmark(MAP, "door").await.expect("deleted");
    let deleted = newest(&maps).await;
    let url = inside.url();
    let run = |line: &str| {
        let line = format!("history {line} --map {MAP} --server {url}");
        waymark(line.split_whitespace(), LONGEST)
    };
    let listed = run("list");
    assert!(
        listed.status == 0 && listed.stdout.contains("it is gone") && listed.stdout.contains("-door"),
        "{listed:?}"
    );
    let shown = run(&format!("diff {made}"));
    assert!(
        shown.status == 0 && shown.stdout.contains("door") && shown.stdout.contains("removed"),
        "{shown:?}"
    );
    assert_eq!(run(&format!("rollback {made}")).status, 2, "nobody said yes");
    let back = run(&format!("rollback {made} --yes --why mistake"));
    assert!(back.status == 0 && back.stdout.contains("+door"), "{back:?}");
    let commit = maps.commits(MAP, &PageQuery::default()).await.expect("commits").items.remove(0);
    assert_eq!(commit.why.as_deref(), Some("mistake"));
    let undone = run(&format!("undo {} --yes", commit.id));
    assert!(undone.status == 0 && undone.stdout.contains("-door"), "{undone:?}");
    let refused = run(&format!("undo {deleted} --yes"));
    assert_eq!(refused.status, 4, "{refused:?}");
    assert!(refused.stderr.contains("changed landmark door since"), "{refused:?}");
    assert_eq!(run("rollback 999 --yes").status, 3);
    inside.server.stop().await;
}
