//! The audit log in a file, without asking a server. In: a data directory, of a server that may
//! run, or a backup. Out: whether its chain is whole.

use crate::store::{StoreError, audit, copies, open::FILE};
use protos::api::{AuditCheck, AuditHead};
use std::path::{Path, PathBuf};

/// Why there is nothing to say about a file.
#[derive(Debug, thiserror::Error)]
pub enum AuditFileError {
    /// It is not there.
    #[error("there is no {0}; of a store in PostgreSQL ask its server")]
    Missing(PathBuf),
    /// It cannot be read as a database with an audit log.
    #[error("{path}: {reason}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the database says.
        reason: String,
    },
    /// The noted digest is none.
    #[error("a digest has 64 hexadecimal digits")]
    BadDigest,
}

/// Computes the digest of every entry anew. An entry that was `noted` elsewhere has to have its
/// digest still.
pub async fn check(path: &Path, noted: Option<&AuditHead>) -> Result<AuditCheck, AuditFileError> {
    let is_data = path.is_dir();
    let file = if is_data { path.join(FILE) } else { path.to_owned() };
    if !file.exists() {
        return Err(AuditFileError::Missing(file));
    }
    let noted =
        noted.map(audit::ChainLink::try_from).transpose().map_err(|_none| AuditFileError::BadDigest)?;
    let check = async {
        let mut conn =
            if is_data { copies::open_live(&file).await? } else { copies::open_file(&file).await? };
        audit::check(&mut conn, noted).await
    };
    check.await.map_err(|error: StoreError| {
        let cause = std::error::Error::source(&error).map(|cause| format!(": {cause}"));
        AuditFileError::Unreadable { path: file, reason: format!("{error}{}", cause.unwrap_or_default()) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        config::Config,
        publication::Catalogue,
        store::{db, maps},
    };
    use vision::recognise::DistanceKind;

    async fn fault_of(path: &Path) -> Option<String> {
        check(path, None).await.unwrap().fault
    }

    #[tokio::test]
    async fn a_running_server_and_a_copy_are_read_and_a_changed_row_is_found_in_both() {
        let data = tempfile::tempdir().unwrap();
        let config = Config { data: data.path().to_owned(), ..Config::default() };
        let (store, _tasks) = Catalogue::open(&config).await.unwrap();
        for name in ["a", "b"] {
            let write = store.write(move |tx| Box::pin(maps::create(tx, name, DistanceKind::Both, 9)));
            write.await.unwrap();
        }
        let live = check(data.path(), None).await.unwrap();
        assert_eq!((live.entries, &live.fault), (2, &None));
        let sound = data.path().join("sound.waymark");
        copies::copy(data.path(), &sound).await.unwrap();
        assert_eq!(check(&sound, Some(&live.head)).await.unwrap(), live);
        assert!(copies::examine(&sound).await.unwrap().1.is_empty());

        let write = store.write(|tx| {
            Box::pin(async move {
                let sql = "DROP TRIGGER audit_is_not_changed; UPDATE audit SET actor = 'sam' WHERE seq = 1";
                db::raw_sql(sql).execute(tx.conn()).await.unwrap();
                Ok(())
            })
        });
        write.await.unwrap();
        let changed = data.path().join("changed.waymark");
        copies::copy(data.path(), &changed).await.unwrap();
        let expected = Some("entry 1 is not as it was written".to_owned());
        assert_eq!((fault_of(data.path()).await, fault_of(&changed).await), (expected.clone(), expected));
        let faults = copies::examine(&changed).await.unwrap().1;
        assert_eq!(faults, ["the audit log: entry 1 is not as it was written"]);
        let noted = AuditHead { seq: 1, sha256: "no".into() };
        assert!(matches!(check(data.path(), Some(&noted)).await, Err(AuditFileError::BadDigest)));
        let missing = check(&data.path().join("none"), None).await;
        assert!(matches!(missing, Err(AuditFileError::Missing(_))), "{missing:?}");
        std::fs::write(data.path().join("text"), "no database").unwrap();
        let unreadable = check(&data.path().join("text"), None).await;
        assert!(matches!(unreadable, Err(AuditFileError::Unreadable { .. })), "{unreadable:?}");
    }
}
