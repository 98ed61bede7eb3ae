//! Whether the disk of the data directory has room for more. In: the free space, looked at every
//! [`PERIOD`]. Out: a refusal of everything that adds data, from before the disk is full until
//! there is room again.
//!
//! Reading, recognition, deletions, revocations and small edits go on. Pages of the database that
//! deletions have freed count as room, since the file does not shrink and new data take them first.

use crate::{
    config::Limits,
    store::{
        StoreError,
        db::{self, Pool},
    },
};
use engine::vitals::Pulse;
use std::{
    fmt, io,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};
use tokio::sync::watch;

/// Time between two looks at the disk.
pub(crate) const PERIOD: Duration = Duration::from_secs(2);
/// Its name among the parts of the server.
pub(crate) const PART: &str = "the task that looks at the disk";

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Bounds {
    percent: u64,
    spare_bytes: u64,
    free_bytes: u64,
}

/// The disk of the data directory at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct DiskSpace {
    /// Size that this user can fill.
    pub(crate) total_bytes: u64,
    pub(crate) free_bytes: u64,
    /// Free pages inside of the database.
    pub(crate) reusable_bytes: u64,
    /// It is mounted read-only.
    pub(crate) is_read_only: bool,
    /// Used share at which additions are refused.
    pub(crate) limit_percent: u64,
    /// More is refused.
    pub(crate) is_nearly_full: bool,
}

impl DiskSpace {
    fn of(total_bytes: u64, free_bytes: u64, reusable_bytes: u64, bounds: Bounds) -> Self {
        let room = free_bytes.saturating_add(reusable_bytes);
        let used = total_bytes.saturating_sub(room);
        // An unknown size is not a full disk.
        let is_over =
            total_bytes > 0 && u128::from(used) * 100 >= u128::from(total_bytes) * u128::from(bounds.percent);
        let is_short = total_bytes > 0 && free_bytes < bounds.free_bytes;
        Self {
            total_bytes,
            free_bytes,
            reusable_bytes,
            is_read_only: false,
            limit_percent: bounds.percent,
            is_nearly_full: (is_over && room < bounds.spare_bytes) || is_short,
        }
    }

    /// Used share of the disk, in percent, rounded down.
    pub(crate) fn used_percent(&self) -> u64 {
        let used = self.total_bytes.saturating_sub(self.free_bytes.saturating_add(self.reusable_bytes));
        (u128::from(used) * 100).checked_div(u128::from(self.total_bytes)).unwrap_or(0) as u64
    }

    /// Why additions are refused, and what to do; `None`: they are not.
    pub(crate) fn refusal(&self) -> Option<String> {
        if self.is_read_only {
            return Some(StoreError::ReadOnly.to_string());
        }
        self.is_nearly_full.then(|| self.to_string())
    }
}

impl fmt::Display for DiskSpace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mb = |bytes: u64| bytes / 1_000_000;
        write!(
            f,
            "the disk of the data directory is {} % full (limit {} %), {} MB of {} MB are free: nothing is added until there \
             is room. Delete backups, maps or gatherings that nobody needs, or enlarge the disk; then it goes on by itself",
            self.used_percent(),
            self.limit_percent,
            mb(self.free_bytes),
            mb(self.total_bytes),
        )
    }
}

/// Looks at the disk and refuses what adds data.
#[derive(Debug, Default)]
pub(crate) struct DiskGuard {
    data: PathBuf,
    bounds: Bounds,
    space: Mutex<DiskSpace>,
}

impl DiskGuard {
    /// Looks once.
    pub(in crate::store) fn new(data: &Path, limits: &Limits) -> Self {
        let bounds = Bounds {
            percent: u64::from(limits.disk_percent),
            spare_bytes: limits.disk_spare_bytes as u64,
            free_bytes: limits.disk_free_bytes as u64,
        };
        let guard = Self { data: data.to_owned(), bounds, space: Mutex::default() };
        guard.look(0);
        guard
    }

    /// The disk as it was at the last look.
    pub(crate) fn space(&self) -> DiskSpace {
        *self.space.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Refuses an addition while there is no room for it.
    pub(crate) fn check(&self) -> Result<(), StoreError> {
        let space = self.space();
        if space.is_read_only {
            return Err(StoreError::ReadOnly);
        }
        if space.is_nearly_full { Err(StoreError::NearlyFull(Box::new(space))) } else { Ok(()) }
    }

    /// Refuses a file of this size that would leave the disk nearly full.
    pub(crate) fn check_for(&self, bytes: u64) -> Result<(), StoreError> {
        self.check()?;
        let space = self.space();
        let after = DiskSpace::of(space.total_bytes, space.free_bytes.saturating_sub(bytes), 0, self.bounds);
        if after.is_nearly_full { Err(StoreError::NearlyFull(Box::new(after))) } else { Ok(()) }
    }

    /// Looks at the disk; says in the log when additions begin or cease to be refused.
    fn look(&self, reusable_bytes: u64) {
        let now = match measured(&self.data) {
            Ok((total, free, is_read_only)) => {
                DiskSpace { is_read_only, ..DiskSpace::of(total, free, reusable_bytes, self.bounds) }
            }
            Err(error) => {
                tracing::warn!(%error, follows = "the last look counts", "disk_not_looked_at");
                return;
            }
        };
        let before = std::mem::replace(&mut *self.space.lock().unwrap_or_else(PoisonError::into_inner), now);
        match (before.refusal(), now.refusal()) {
            (None, Some(reason)) => {
                tracing::error!(
                    reason,
                    follows = "additions are refused; robots are served",
                    "storage_nearly_full"
                );
            }
            (Some(_), None) => tracing::info!(free_bytes = now.free_bytes, "storage_has_room_again"),
            _ => {}
        }
    }

    /// Looks every [`PERIOD`], until the server stops. `after` runs after each look.
    pub(crate) async fn watch(
        self: Arc<Self>,
        reads: Pool,
        (pulse, mut stopping): (Pulse, watch::Receiver<bool>),
        after: impl Fn() + Send + 'static,
    ) {
        let mut reusable = 0;
        loop {
            let is_told = tokio::time::timeout(PERIOD, stopping.wait_for(|stop| *stop)).await.is_ok();
            if is_told {
                break;
            }
            reusable = freed(&reads).await.unwrap_or(reusable);
            let guard = self.clone();
            // The file system may be slow to answer.
            if let Err(error) = tokio::task::spawn_blocking(move || guard.look(reusable)).await {
                tracing::error!(%error, "disk_look_failed");
            }
            after();
        }
        drop(pulse);
    }
}

/// Bytes of the database that are free inside of it.
async fn freed(reads: &Pool) -> Result<u64, db::Error> {
    if !matches!(reads, Pool::Sqlite(_)) {
        return Ok(0);
    }
    let sql = "SELECT freelist_count * page_size FROM pragma_freelist_count, pragma_page_size";
    db::query_scalar::<i64>(sql).fetch_one(reads).await.map(|bytes| bytes.max(0) as u64)
}

/// Whether the file system of this directory is mounted read-only.
pub(super) fn is_read_only(data: &Path) -> bool {
    measured(data).is_ok_and(|(.., is_read_only)| is_read_only)
}

/// Size and free bytes for this user of the file system of a directory, and whether it is
/// read-only.
#[cfg(unix)]
fn measured(data: &Path) -> io::Result<(u64, u64, bool)> {
    use rustix::fs::{StatVfsMountFlags, statvfs};
    let is = statvfs(data)?;
    let free = is.f_bavail.saturating_mul(is.f_frsize);
    let used = is.f_blocks.saturating_sub(is.f_bfree).saturating_mul(is.f_frsize);
    Ok((used.saturating_add(free), free, is.f_flag.contains(StatVfsMountFlags::RDONLY)))
}

/// Not known on other systems: a full disk is noticed when it is full.
#[cfg(not(unix))]
fn measured(_data: &Path) -> io::Result<(u64, u64, bool)> {
    Ok((0, 0, false))
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: Bounds = Bounds { percent: 90, spare_bytes: 5_000, free_bytes: 20 };

    #[test]
    fn additions_are_refused_from_the_limit_on_and_where_too_little_is_free() {
        let full = |total, free, reusable| DiskSpace::of(total, free, reusable, BOUNDS).is_nearly_full;
        assert!(!full(1_000, 101, 0) && full(1_000, 100, 0), "from 90 % on");
        assert!(!full(100_000, 5_000, 0) && full(100_000, 4_999, 0), "a large disk has enough to spare");
        assert!(!full(1_000, 50, 51), "pages that deletions have freed are room");
        assert!(full(100, 19, 60) && !full(100, 20, 60), "the log itself needs some free space");
        assert!(!full(0, 0, 0), "an unknown size refuses nothing");
        let space = DiskSpace::of(1_000_000_000, 40_000_000, 0, BOUNDS);
        assert_eq!((space.used_percent(), space.refusal()), (96, None));
        let space = DiskSpace::of(1_000_000_000, 4_000, 0, BOUNDS);
        let said = space.refusal().unwrap();
        assert!(said.contains("99 % full (limit 90 %)") && said.contains("Delete backups"), "{said}");
    }

    #[test]
    fn a_guard_looks_at_the_disk_of_its_directory_and_lets_additions_go_on_when_there_is_room() {
        let dir = tempfile::tempdir().unwrap();
        // A limit that every disk has passed, and one that none has.
        let tight = Limits { disk_percent: 1, disk_spare_bytes: usize::MAX, ..Limits::default() };
        let wide = Limits { disk_percent: 100, disk_free_bytes: 0, ..Limits::default() };
        let guard = DiskGuard::new(dir.path(), &tight);
        let refused = guard.check();
        assert!(
            matches!(&refused, Err(StoreError::NearlyFull(space)) if space.total_bytes > 0),
            "{refused:?}"
        );
        let guard = DiskGuard { bounds: DiskGuard::new(dir.path(), &wide).bounds, ..guard };
        assert!(guard.check().is_err(), "until the next look");
        guard.look(0);
        guard.check().unwrap();
        guard.check_for(1).unwrap();
        let space = guard.space();
        let all = Bounds { free_bytes: 1, ..guard.bounds };
        let guard = DiskGuard { bounds: all, ..guard };
        assert!(guard.check_for(space.free_bytes).is_err(), "a file that takes all");
        assert!(!is_read_only(dir.path()));
    }
}
