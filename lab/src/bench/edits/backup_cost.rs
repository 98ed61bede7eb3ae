//! What a backup costs: making and downloading it, restoring it into an empty data directory, and
//! starting a server there.

use super::{Args, MAP, large_map::settings};
use anyhow::Context as _;
use cli::scratch;
use client::{MapClient, api::BackupState};
use serde::Serialize;
use server::{
    Server,
    backup::{StoppedServer, verify},
};
use std::{
    path::Path,
    time::{Duration, Instant},
};
use tokio::{fs, io::AsyncWriteExt as _};

/// Longest wait for the backup.
const LONGEST: Duration = Duration::from_hours(1);

/// Seconds and size of one backup of the whole server.
#[derive(Debug, Serialize)]
pub(super) struct BackupCost {
    /// Making it and downloading it.
    backup_s: f64,
    backup_mb: f64,
    /// Verification of the whole file, and putting it in place.
    restore_s: f64,
    /// Until the server that was restored is ready.
    start_s: f64,
    landmarks: usize,
}

impl BackupCost {
    /// The line of the table for people.
    pub(super) fn sentence(&self) -> String {
        let Self { backup_s, backup_mb, restore_s, start_s, landmarks } = self;
        format!(
            "backup of {landmarks} landmarks: {backup_s:.1} s, {backup_mb:.0} MB; restored in {restore_s:.1} s, server \
             ready after {start_s:.1} s"
        )
    }
}

/// Makes a backup of the running server and downloads it to `file`. Gives the seconds of both
/// together.
pub(super) async fn download_backup(maps: &MapClient, file: &Path) -> anyhow::Result<f64> {
    let started = Instant::now();
    let backup = maps.wait_for_backup(maps.make_backup().await?, LONGEST).await?;
    anyhow::ensure!(backup.state == BackupState::Complete, "no backup: {:?}", backup.reason);
    let (mut from, mut to) = (maps.backup_file(&backup.name).await?, fs::File::create(file).await?);
    while let Some(bytes) = from.next().await? {
        to.write_all(&bytes).await?;
    }
    to.sync_all().await?;
    Ok(started.elapsed().as_secs_f64())
}

/// Restores `file` into an empty data directory and starts a server there. `backup_s`: what
/// [`download_backup`] gave.
pub(super) async fn measure_restore(args: &Args, file: &Path, backup_s: f64) -> anyhow::Result<BackupCost> {
    let folder = scratch::Folder::new("restored")?;
    let backup_mb = fs::metadata(file).await?.len() as f64 / 1e6;
    let started = Instant::now();
    let backup = verify(file).await?;
    StoppedServer::of(folder.path())?.restore(&backup)?;
    let restore_s = started.elapsed().as_secs_f64();
    let started = Instant::now();
    let server = Server::start(settings(folder.path(), args)?).await?;
    let start_s = started.elapsed().as_secs_f64();
    let maps = MapClient::new(&format!("http://{}", server.http_addr))?;
    let landmarks = maps.landmarks(MAP).await.context("the restored map")?.len();
    server.stop().await;
    anyhow::ensure!(landmarks == args.landmarks as usize, "{landmarks} landmarks are restored");
    Ok(BackupCost { backup_s, backup_mb, restore_s, start_s, landmarks })
}
