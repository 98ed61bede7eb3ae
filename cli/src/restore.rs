//! `waymark restore`: a backup takes the place of the data of a server that does not run.

use super::{
    failure::{Class, Failure},
    screen::{self, counted},
    session::Consent,
};
use client::api::BackupManifest;
use serde_json::json;
use server::{
    backup::{RestoreError, StoppedServer, Verified, verify},
    config::{PostgresAddress, default_data},
};
use std::{
    io,
    path::{Path, PathBuf},
};

/// `waymark restore`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The backup.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The data directory of the server; made if missing.
    #[arg(long, env = "WAYMARK_DATA", value_name = "DIR", default_value_os_t = default_data())]
    data: PathBuf,
    /// An empty database of PostgreSQL that it is put into, in place of the data directory:
    /// `postgres://USER@HOST/NAME`.
    #[arg(long, value_name = "URL")]
    store: Option<String>,
    /// Only verify the backup.
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    consent: Consent,
    /// Print results and errors as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let database = PostgresAddress::checked(args.store.clone().unwrap_or_default())?;
    let take = || StoppedServer::of(&args.data).map_err(failure);
    // First, as verification may take long; but nothing is made for a file that is no backup.
    let is_of_data = !args.dry_run && database.is_none();
    let held = (is_of_data && args.data.exists()).then(take).transpose()?;
    let backup = verified(&args.file).await?;
    if args.dry_run {
        return args.show(&backup, None, &format!("{} is sound", args.file.display()));
    }
    if let Some(database) = database {
        backup.restore_into(&database).await.map_err(failure)?;
        return args.show(&backup, None, &format!("restored into {database}"));
    }
    let stopped = held.map_or_else(take, Ok)?;
    if stopped.has_data() {
        let data = args.data.display();
        args.consent.ask(&format!(
            "Replace the data in {data} by that of {}? The present data stay in a folder there.",
            args.file.display()
        ))?;
    }
    let replaced = stopped.restore(&backup).map_err(failure)?;
    let kept = replaced.as_ref().map(|folder| format!("; what was there is in {}", folder.display()));
    let text = format!("restored into {}{}", args.data.display(), kept.unwrap_or_default());
    args.show(&backup, replaced.as_deref(), &text)
}

impl Args {
    fn show(&self, backup: &Verified, replaced: Option<&Path>, text: &str) -> anyhow::Result<()> {
        if self.json {
            let shown = json!({ "manifest": backup.manifest, "replaced": replaced });
            screen::say(&serde_json::to_string(&shown)?);
        } else {
            screen::say(&format!("{text}\n{}", holds(&backup.manifest)));
        }
        Ok(())
    }
}

/// The whole of a backup, compared with its digests.
pub(crate) async fn verified(file: &Path) -> anyhow::Result<Verified> {
    verify(file).await.map_err(|error| failure(error).into())
}

fn failure(error: RestoreError) -> Failure {
    let sentence = format!("{error}.");
    match error {
        RestoreError::Damaged { faults } => {
            let mut failure = Failure::new(Class::Refused, "backup_damaged", sentence);
            failure.more.insert("faults".into(), json!(faults));
            failure.advise("Nothing was changed. Take another backup: waymark restore OTHER --dry-run")
        }
        RestoreError::Newer { .. } => Failure::new(Class::Refused, "newer_schema", sentence),
        RestoreError::Database(_) => Failure::new(Class::Refused, "store_refused", sentence),
        RestoreError::Directory(_) => Failure::new(Class::Conflict, "in_use", sentence),
        RestoreError::File { source, .. } if source.kind() == io::ErrorKind::NotFound => {
            Failure::new(Class::NotFound, "no_file", sentence)
        }
        RestoreError::File { .. } => Failure::new(Class::Failed, "failed", sentence),
    }
}

/// What a backup holds, in lines.
pub(crate) fn holds(manifest: &BackupManifest) -> String {
    let (count, pictures) =
        (counted(manifest.maps.len() as u64, "map"), counted(manifest.pictures, "picture"));
    let mut lines = vec![format!(
        "  {count} and {pictures}, schema {}, made by waymark {}",
        manifest.schema, manifest.program
    )];
    lines.extend(manifest.maps.iter().map(|map| {
        let (landmarks, views) = (counted(map.landmarks, "landmark"), counted(map.views, "view"));
        let walls = counted(map.walls, "wall segment");
        format!("  map {}, version {}: {landmarks}, {views}, {walls}", map.name, map.version)
    }));
    lines.extend(manifest.faults.iter().map(|fault| format!("  damaged before the backup: {fault}")));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use client::api::BackupMap;

    #[test]
    fn a_backup_is_shown_with_its_maps_and_faults() {
        let map = BackupMap {
            name: "office".into(),
            version: 7,
            landmarks: 1,
            views: 2,
            models: 1,
            walls: 0,
            sha256: String::new(),
        };
        let manifest = BackupManifest {
            created_ms: 0,
            program: "0.1.0".into(),
            schema: 16,
            maps: vec![map],
            pictures: 2,
            faults: vec!["the picture of view 1".into()],
        };
        assert_eq!(
            holds(&manifest),
            "  1 map and 2 pictures, schema 16, made by waymark 0.1.0\n  \
             map office, version 7: 1 landmark, 2 views, 0 wall segments\n  \
             damaged before the backup: the picture of view 1"
        );
    }
}
