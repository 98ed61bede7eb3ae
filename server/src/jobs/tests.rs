use super::*;
use crate::{
    publication::{CatalogueTasks, tests::config},
    store::maps,
};
use vision::recognise::DistanceKind;

/// A store with map `a`, whose landmarks have no views: every lesson of it fails at once.
async fn store(dir: &std::path::Path) -> (Catalogue, CatalogueTasks) {
    let (store, task) = Catalogue::open(&config(dir)).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    (store, task)
}

async fn started(store: &Catalogue, dir: &std::path::Path) -> (Arc<Jobs>, watch::Sender<bool>) {
    let (stop, stopping) = watch::channel(false);
    let (jobs, _) = Jobs::start(store.clone(), Arc::new(config(dir)), stopping).await.unwrap();
    (jobs, stop)
}

/// A row as its caller leaves it who goes away right after the commit.
async fn queued(store: &Catalogue) -> i64 {
    let write = store.write(|tx| Box::pin(jobs::create(tx, "learn", "a", "{}", (64, 9))));
    write.await.unwrap().id
}

/// It was begun so often, and the process ended each time.
async fn interrupted(store: &Catalogue, times: u32) -> i64 {
    let id = queued(store).await;
    for _ in 0..times {
        assert!(store.write(move |tx| Box::pin(jobs::begin(tx, id))).await.unwrap());
    }
    id
}

async fn ended(store: &Catalogue, id: i64) -> JobRow {
    let begun = Instant::now();
    loop {
        let row = jobs::get(store.reads(), id).await.unwrap();
        if !is_open(&row) {
            return row;
        }
        assert!(begun.elapsed() < Duration::from_secs(20), "{row:?}");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

#[tokio::test]
async fn a_job_is_begun_although_its_caller_has_gone() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    let (jobs, _stop) = started(&store, dir.path()).await;
    let ids = [queued(&store).await, queued(&store).await];
    for id in ids {
        let row = ended(&store, id).await;
        assert_eq!((row.state.as_str(), row.attempts), ("failed", 1));
        assert!(row.message.contains("no landmark"), "{row:?}");
    }
    assert_eq!(jobs.submit("a", &request::Request::default()).await.unwrap().state, "queued");
}

#[tokio::test]
async fn a_job_that_waits_is_cancelled_in_the_table() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    // Interrupted three times: it waits for four seconds.
    let id = interrupted(&store, 3).await;
    let (jobs, _stop) = started(&store, dir.path()).await;
    let mut watched = jobs.watch(id).await.unwrap().unwrap();
    assert!(jobs.learning("a").await.unwrap().has("any"));
    jobs.cancel(id).await.unwrap();
    assert_eq!(jobs::get(store.reads(), id).await.unwrap().state, "cancelled");
    assert!(watched.changed().await.is_err(), "whoever watches is told of the end");
    assert!(jobs.lock().of.is_empty() && !jobs.learning("a").await.unwrap().has("any"));
    // One that has ended stays as it is, and can be watched no more.
    jobs.cancel(id).await.unwrap();
    assert!(jobs.watch(id).await.unwrap().is_none());
    assert!(matches!(jobs.watch(99).await, Err(StoreError::NotFound { .. })));
}

#[tokio::test]
async fn a_job_has_ended_once_its_models_are_published() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    let (jobs, _stop) = started(&store, dir.path()).await;
    let id = queued(&store).await;
    ended(&store, id).await;
    while jobs.lock().running.is_some() {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    assert_eq!(jobs.get(id).await.unwrap().0.state, "failed");
    // The row is committed, and its writer still publishes.
    jobs.reporter(id).report(0.9, "storing");
    jobs.lock().running = Some(id);
    let (row, progress) = jobs.get(id).await.unwrap();
    assert_eq!((row.state.as_str(), row.message.as_str(), progress.unwrap().share), ("running", "", 0.9));
    let mut watched = jobs.watch(id).await.unwrap().expect("it is watched to its end");
    jobs.leave(id);
    assert!(watched.changed().await.is_err());
    assert_eq!(jobs.get(id).await.unwrap().0.state, "failed");
}

#[tokio::test]
async fn a_job_that_ends_the_process_each_time_is_given_up() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    let [killer, once] = [interrupted(&store, MAX_ATTEMPTS).await, interrupted(&store, 1).await];
    let next = queued(&store).await;
    let begun = Instant::now();
    let (_jobs, _stop) = started(&store, dir.path()).await;
    let row = ended(&store, killer).await;
    assert_eq!((row.state.as_str(), row.attempts), ("failed", MAX_ATTEMPTS));
    assert!(row.message.contains("ended 5 times"), "{row:?}");
    // The one behind has its turn before the one that was interrupted.
    ended(&store, next).await;
    assert!(begun.elapsed() < PAUSE && is_open(&jobs::get(store.reads(), once).await.unwrap()));
    assert_eq!(ended(&store, once).await.attempts, 2);
    assert!(begun.elapsed() >= PAUSE);
}

#[tokio::test]
async fn a_stop_of_the_server_is_no_attempt() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    let id = interrupted(&store, 1).await;
    store.write(move |tx| Box::pin(jobs::put_back(tx, id))).await.unwrap();
    let row = jobs::get(store.reads(), id).await.unwrap();
    assert_eq!((row.state.as_str(), row.attempts), ("queued", 0));
}

#[tokio::test]
async fn open_jobs_are_bounded() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    let limits = config(dir.path()).limits;
    let (jobs, _stop) = started(&store, dir.path()).await;
    // Many times more than may be open at once: those that have ended make room.
    for _ in 0..=limits.jobs {
        let row = jobs.submit("a", &request::Request::default()).await.unwrap();
        ended(&store, row.id).await;
    }
    assert!(jobs::open(store.reads()).await.unwrap().is_empty());
}
