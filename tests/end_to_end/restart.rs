//! Claim: killing and restarting the server at any time loses no acknowledged change, repeats none, and leaves a
//! consistent database (the server checks it at each start).

use client::{
    ClientError, LandmarkRegion, MapClient,
    api::{JobState, NewMap},
};
use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};
use tempfile::TempDir;
use tests::{Child, eventually, pictures};

const KILLS: u64 = 20;
const MAP: &str = "hall";

/// Changes that the server has confirmed.
#[derive(Debug, Default, Clone)]
struct Journal {
    /// Landmarks with the numbers of their confirmed views.
    landmarks: BTreeMap<String, Vec<i64>>,
    /// Accepted jobs, each with its landmark.
    jobs: Vec<(i64, String)>,
    version: u64,
}

/// Teaches one new landmark after another until the server is gone.
async fn teach(
    maps: MapClient,
    next: Arc<AtomicU64>,
    journal: Arc<Mutex<Journal>>,
) -> Result<(), ClientError> {
    loop {
        let number = next.fetch_add(1, Ordering::Relaxed);
        let name = format!("l{number:05}");
        maps.add_landmark(MAP, &name, None, None).await?;
        journal.lock().expect("journal").landmarks.insert(name.clone(), Vec::new());
        for seed in [2 * number, 2 * number + 1] {
            let view =
                maps.upload_view(MAP, &name, pictures::picture(seed), LandmarkRegion::WholeImage).await?;
            let id = view.id;
            journal.lock().expect("journal").landmarks.get_mut(&name).expect("own landmark").push(id);
        }
        if number.is_multiple_of(5) {
            let job = maps.learn(MAP, Some(std::slice::from_ref(&name)), Some(3)).await?;
            journal.lock().expect("journal").jobs.push((job.id, name));
        }
        let version = maps.map(MAP).await?.version;
        let mut journal = journal.lock().expect("journal");
        journal.version = journal.version.max(version);
    }
}

async fn views_of(server: &Child, landmark: &str) -> Vec<i64> {
    let url = format!("{}/api/v1/maps/{MAP}/landmarks/{landmark}/views", server.url);
    let page: serde_json::Value =
        tests::http(&server.url).await.get(url).send().await.expect("answer").json().await.expect("JSON");
    page["items"].as_array().expect("items").iter().map(|v| v["id"].as_i64().expect("a number")).collect()
}

/// Every confirmed change is stored once, and nothing else is stored.
async fn check(server: &Child, journal: &Journal, attempted: u64) {
    let maps = server.maps();
    let there: Vec<String> =
        maps.landmarks(MAP).await.expect("landmarks").into_iter().map(|l| l.name).collect();
    let mut distinct = there.clone();
    distinct.dedup();
    assert_eq!(there, distinct, "a landmark is there twice");
    for name in &there {
        let number: u64 = name[1..].parse().expect("our own name");
        assert!(number < attempted, "{name} was never asked for");
    }
    for (name, views) in &journal.landmarks {
        assert!(there.contains(name), "{name} was confirmed and is lost");
        let stored = views_of(server, name).await;
        assert!(views.iter().all(|v| stored.contains(v)), "{name}: {views:?} confirmed, {stored:?} there");
        assert!(stored.len() <= 2, "{name}: a view is there twice: {stored:?}");
    }
    for (job, _) in &journal.jobs {
        maps.job(*job).await.expect("an accepted job is there");
    }
    assert!(maps.map(MAP).await.expect("map").version >= journal.version, "the version went back");
}

/// Whether enough was confirmed since the last kill for the next one to be a test, on a machine of any speed.
fn is_enough(kill: u64, before: &Journal, now: &Journal) -> bool {
    let has_job = kill % 4 != 3 || now.jobs.len() > before.jobs.len();
    has_job && now.landmarks.len() >= before.landmarks.len() + 2
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_acknowledged_is_lost_by_a_kill() {
    let data = TempDir::new().expect("a temporary directory");
    let (next, journal) = (Arc::new(AtomicU64::new(0)), Arc::new(Mutex::new(Journal::default())));
    for kill in 0..KILLS {
        let server = Child::start(data.path());
        if kill == 0 {
            server.maps().create_map(&NewMap::new(MAP)).await.expect("map");
        }
        let confirmed = journal.lock().expect("journal").clone();
        check(&server, &confirmed, next.load(Ordering::Relaxed)).await;
        let teachers = [(); 3].map(|()| tokio::spawn(teach(server.maps(), next.clone(), journal.clone())));
        eventually("enough is taught", || async {
            is_enough(kill, &confirmed, &journal.lock().expect("journal")).then_some(())
        })
        .await;
        // The kills are spread over all steps of teaching.
        tokio::time::sleep(Duration::from_millis(37 * kill % 100)).await;
        server.kill();
        for teacher in teachers {
            let ended =
                teacher.await.expect("the teacher does not panic").expect_err("the server was killed");
            assert!(!matches!(ended, ClientError::Refused { .. }), "refused instead of gone: {ended}");
        }
    }
    let server = Child::start(data.path());
    let journal = journal.lock().expect("journal").clone();
    check(&server, &journal, next.load(Ordering::Relaxed)).await;
    assert!(
        journal.landmarks.len() as u64 > KILLS && journal.jobs.len() > 3,
        "too little was taught: {journal:?}"
    );
    // Interrupted jobs were resumed: every accepted lesson ends, and its landmark has a model.
    for (job, name) in &journal.jobs {
        let maps = server.maps();
        let state = eventually("the job ends", || async {
            let state = maps.job(*job).await.expect("job").state;
            (!matches!(state, JobState::Queued | JobState::Running)).then_some(state)
        })
        .await;
        assert_eq!(state, JobState::Done, "job {job}");
        assert!(maps.landmark(MAP, name).await.expect("landmark").model.is_some(), "{name} has no model");
    }
}
