//! `waymark backup`: one file with the whole state of a running server.

use super::{
    failure::{Class, Failure},
    restore::{holds, verified},
    session::{ServerArgs, Session},
};
use anyhow::Context as _;
use client::{
    ClientError, MapClient,
    api::{Backup, BackupState},
};
use serde_json::json;
use std::{
    path::{Path, PathBuf},
    time::Duration,
};
use tokio::{fs, io::AsyncWriteExt as _};

/// Longest wait for the server to write a backup.
const LONGEST: Duration = Duration::from_hours(6);
/// Time between two attempts while another backup is being made.
const POLL: Duration = Duration::from_millis(500);

/// `waymark backup`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Where to; left out, the backup stays in the server's data directory alone.
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    #[command(flatten)]
    server: ServerArgs,
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let done = make(&session, args.file.as_deref()).await;
    session.explained(done).await
}

async fn make(session: &Session, file: Option<&Path>) -> anyhow::Result<()> {
    if let Some(file) = file.filter(|file| file.exists()) {
        let sentence = format!("{} exists already.", file.display());
        return Err(Failure::new(Class::Conflict, "exists", sentence).advise("Choose another name.").into());
    }
    let maps = session.maps();
    let begun = begin(maps).await?;
    let backup = maps.wait_for_backup(begun, LONGEST).await?;
    if backup.state != BackupState::Complete {
        let reason = backup.reason.unwrap_or_else(|| "it takes too long".into());
        let sentence = format!("The server made no backup: {reason}.");
        return Err(Failure::new(Class::Failed, "backup_failed", sentence).into());
    }
    if let Some(file) = file {
        download(maps, &backup, file).await?;
    }
    let place = file.map_or_else(
        || format!("{}, in the server's data directory", backup.name),
        |file| file.display().to_string(),
    );
    let holds = backup.manifest.as_ref().map(holds).unwrap_or_default();
    session.show(&json!({ "backup": backup, "file": file }), &format!("backup {place}\n{holds}"))
}

/// Begins a backup, once the one that is being made is complete.
async fn begin(maps: &MapClient) -> Result<Backup, ClientError> {
    let until = tokio::time::Instant::now() + LONGEST;
    loop {
        match maps.make_backup().await {
            Err(ClientError::Refused { code, .. })
                if code == "in_use" && tokio::time::Instant::now() < until =>
            {
                tokio::time::sleep(POLL).await;
            }
            done => return done,
        }
    }
}

/// Brings a backup to a file, which gets its name once it is verified.
async fn download(maps: &MapClient, backup: &Backup, file: &Path) -> anyhow::Result<()> {
    let mut name = file.as_os_str().to_owned();
    name.push(".part");
    let part = PathBuf::from(name);
    let done = fetch(maps, backup, &part).await;
    let done = match done {
        Ok(()) => verified(&part).await.map(drop),
        error => error,
    };
    if done.is_err() {
        // What has come of it is of no use.
        drop(fs::remove_file(&part).await);
        return done;
    }
    fs::rename(&part, file).await.with_context(|| file.display().to_string())
}

async fn fetch(maps: &MapClient, backup: &Backup, part: &Path) -> anyhow::Result<()> {
    let at = || part.display().to_string();
    let mut from = maps.backup_file(&backup.name).await?;
    let mut to = fs::File::create(part).await.with_context(at)?;
    while let Some(bytes) = from.next().await? {
        to.write_all(&bytes).await.with_context(at)?;
    }
    to.sync_all().await.with_context(at)
}
