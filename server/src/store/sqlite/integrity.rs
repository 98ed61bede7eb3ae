//! The check of the whole file after each start: every page, every row, and every index against its
//! table. In: the open store. Out: `running`, `ok`, or what is wrong, for `/readyz`, the metrics
//! and the log.
//!
//! The start itself compares no indexes (`open`): that reads the file once more, and robots would
//! wait for it. An index that differs from its table makes a query miss rows, or find others.

use crate::store::{Store, StoreError, now_ms, statements::statements};
use protos::api::DatabaseCheckState;
use sqlx::Connection as _;
use std::{
    sync::{Arc, Mutex, PoisonError},
    thread,
    time::{Duration, Instant},
};
use tokio::sync::watch;

statements! {
    CHECK = "PRAGMA integrity_check(20)";
}

/// Steps of SQLite between two looks at the clock.
const STEPS: i32 = 2_000;
/// The check works for this long, then pauses, so that it takes no more than a share of a core and
/// of the disk from robots.
const WORK: Duration = Duration::from_millis(10);
const PAUSE: Duration = Duration::from_millis(20);

/// What the check has found.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) enum DatabaseCheck {
    /// It goes on.
    #[default]
    Running,
    /// Everything is as it was written.
    Sound {
        /// When it ended, ms since the Unix epoch.
        ended_ms: i64,
    },
    /// At most 20 faults, as SQLite says them.
    Damaged {
        /// When it ended, ms since the Unix epoch.
        ended_ms: i64,
        /// At least one.
        faults: Vec<String>,
    },
}

impl DatabaseCheck {
    /// Its state on the wire.
    pub(crate) fn state(&self) -> DatabaseCheckState {
        match self {
            Self::Running => DatabaseCheckState::Running,
            Self::Sound { .. } => DatabaseCheckState::Ok,
            Self::Damaged { .. } => DatabaseCheckState::Failed,
        }
    }

    /// When it ended, ms since the Unix epoch.
    pub(crate) fn ended_ms(&self) -> Option<i64> {
        match self {
            Self::Running => None,
            Self::Sound { ended_ms } | Self::Damaged { ended_ms, .. } => Some(*ended_ms),
        }
    }

    /// What is wrong.
    pub(crate) fn faults(&self) -> &[String] {
        if let Self::Damaged { faults, .. } = self { faults } else { &[] }
    }
}

/// The check of one start.
#[derive(Debug, Clone, Default)]
pub(crate) struct LastCheck(Arc<Mutex<DatabaseCheck>>);

impl LastCheck {
    /// How far it has come.
    pub(crate) fn get(&self) -> DatabaseCheck {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn set(&self, check: DatabaseCheck) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = check;
    }
}

/// Checks the database once, if it is a file. Ends early when the server stops.
pub(crate) async fn check(store: Store, stopping: watch::Receiver<bool>) {
    if store.database().is_some() {
        return;
    }
    let started = Instant::now();
    let found = faults(&store, stopping.clone()).await;
    if *stopping.borrow() {
        return;
    }
    let took_ms = started.elapsed().as_millis() as u64;
    let faults = match found {
        Ok(faults) => faults,
        Err(error) => vec![format!("the check broke off: {error}{}", cause(&error))],
    };
    if faults.is_empty() {
        tracing::info!(took_ms, "database_checked");
        store.last_check().set(DatabaseCheck::Sound { ended_ms: now_ms() });
        return;
    }
    let follows = "robots are served; stop the server and restore a backup: waymark restore FILE --data DIR";
    tracing::error!(took_ms, faults = faults.join("; "), follows, "database_check_failed");
    store.last_check().set(DatabaseCheck::Damaged { ended_ms: now_ms(), faults });
}

fn cause(error: &StoreError) -> String {
    std::error::Error::source(error).map_or_else(String::new, |cause| format!(": {cause}"))
}

/// What is wrong with the file. It is read as one state: the log grows meanwhile by what is
/// written.
async fn faults(store: &Store, stopping: watch::Receiver<bool>) -> Result<Vec<String>, StoreError> {
    let at = || StoreError::during("check the database");
    // A connection of its own: requests keep theirs.
    let mut conn = store.reads().sqlite().map_err(at())?.acquire().await.map_err(at())?.detach();
    let mut since = Instant::now();
    conn.lock_handle().await.map_err(at())?.set_progress_handler(STEPS, move || {
        if since.elapsed() > WORK {
            thread::sleep(PAUSE);
            since = Instant::now();
        }
        !*stopping.borrow()
    });
    let said = sqlx::query_scalar::<_, String>(CHECK).fetch_all(&mut conn).await.map_err(at());
    conn.close().await.map_err(at())?;
    Ok(said?.into_iter().filter(|text| text != "ok").collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        publication::{Catalogue, tests::config},
        store::{landmarks, maps, open::FILE},
    };
    use std::{fs, path::Path};
    use vision::recognise::DistanceKind;

    async fn store(data: &Path) -> (Catalogue, crate::publication::CatalogueTasks) {
        Catalogue::open(&config(data)).await.unwrap()
    }

    /// A database with a landmark whose name an index does not have any more: the row is whole.
    async fn with_damaged_index(data: &Path) {
        let (catalogue, task) = store(data).await;
        catalogue.write(|tx| Box::pin(maps::create(tx, "hall", DistanceKind::Both, 9))).await.unwrap();
        let none = landmarks::LandmarkGeometry::default();
        let create = catalogue.write(move |tx| Box::pin(landmarks::create(tx, "hall", "poster", none, 9)));
        create.await.unwrap();
        let roots = "SELECT rootpage FROM sqlite_schema WHERE type = 'index' AND tbl_name = 'landmarks'";
        let roots: Vec<i64> =
            sqlx::query_scalar(roots).fetch_all(catalogue.reads().sqlite().unwrap()).await.unwrap();
        task.close().await;
        let mut bytes = fs::read(data.join(FILE)).unwrap();
        let mut damaged = 0;
        for root in roots {
            let page = &mut bytes[(root as usize - 1) * 4096..root as usize * 4096];
            if let Some(at) = page.windows(6).position(|text| text == b"poster") {
                page[at] = b'q';
                damaged += 1;
            }
        }
        assert!(damaged > 0, "no index has the name");
        fs::write(data.join(FILE), bytes).unwrap();
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn an_index_that_differs_from_its_table_is_found_after_the_start() {
        let (sound, damaged) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        with_damaged_index(damaged.path()).await;
        for (data, wanted) in [(&sound, DatabaseCheckState::Ok), (&damaged, DatabaseCheckState::Failed)] {
            let (catalogue, task) = store(data.path()).await;
            assert_eq!(catalogue.last_check().get(), DatabaseCheck::Running, "the start does not wait");
            let (_stop, stopping) = watch::channel(false);
            check((*catalogue).clone(), stopping).await;
            let found = catalogue.last_check().get();
            assert_eq!(found.state(), wanted, "{found:?}");
            let is_named = found.faults().iter().any(|fault| fault.contains("missing from index"));
            assert_eq!(is_named, wanted == DatabaseCheckState::Failed, "{found:?}");
            task.close().await;
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_check_ends_with_the_server_and_says_nothing() {
        let data = tempfile::tempdir().unwrap();
        with_damaged_index(data.path()).await;
        let (catalogue, task) = store(data.path()).await;
        let (stop, stopping) = watch::channel(false);
        stop.send_replace(true);
        check((*catalogue).clone(), stopping).await;
        assert_eq!(catalogue.last_check().get(), DatabaseCheck::Running);
        task.close().await;
    }
}
