//! The file `local-token` in the data directory: an administrator's token for programs of this user
//! on this machine. It is written anew at each start, readable by its owner alone, and removed at
//! the end.

use super::{
    private_file,
    secret::{NoRandomness, Secret, TokenText},
};
use std::{
    fs, io,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
};

/// Name of the file in the data directory; clients read no other.
pub(crate) const FILE: &str = "local-token";

/// Why there is no local token.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LocalTokenError {
    /// The file cannot be written.
    #[error("the local token cannot be written to {path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// There is no secret.
    #[error(transparent)]
    Randomness(#[from] NoRandomness),
}

/// The file with the token of this start.
#[derive(Debug)]
pub(crate) struct LocalToken {
    /// Absolute.
    path: PathBuf,
    secret: Secret<32>,
    port: u16,
    is_written: AtomicBool,
}

impl LocalToken {
    /// Writes a fresh token for the server on this port. A full disk or a read-only one does not
    /// keep the server from starting: then the file comes later ([`LocalToken::write_again`]).
    pub(crate) fn write(data: &Path, port: u16) -> Result<Self, LocalTokenError> {
        let secret = Secret::random()?;
        let text = TokenText::local(port, &secret);
        let at = |path: &Path| {
            let path = path.to_owned();
            |source| LocalTokenError::File { path, source }
        };
        let path = data.canonicalize().map_err(at(data))?.join(FILE);
        let text = format!("{text}\n");
        let written = match private_file::write(&path, &text) {
            Err(error) if error.kind() == io::ErrorKind::StorageFull => {
                // That of an earlier start opens nothing any more, and its place is as large. Fails
                // where there is none.
                drop(fs::remove_file(&path));
                private_file::write(&path, &text)
            }
            written => written,
        };
        let is_written = match written {
            Ok(()) => true,
            Err(error) if has_no_room(&error) => {
                let follows = "commands on this machine have no token until there is room";
                tracing::warn!(%error, path = %path.display(), follows, "local_token_not_written");
                false
            }
            Err(source) => return Err(at(&path)(source)),
        };
        Ok(Self { path, secret, port, is_written: is_written.into() })
    }

    /// Writes the file if the start could not.
    pub(crate) fn write_again(&self) {
        if self.is_written.load(Ordering::Relaxed) {
            return;
        }
        let text = format!("{}\n", TokenText::local(self.port, &self.secret));
        match private_file::write(&self.path, &text) {
            Ok(()) => self.is_written.store(true, Ordering::Relaxed),
            Err(error) => tracing::debug!(%error, "local_token_not_written"),
        }
    }

    /// Where it is, absolute.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn secret(&self) -> &Secret<32> {
        &self.secret
    }

    /// Removes the file, if it still has this token.
    pub(crate) fn remove(&self) {
        let is_own = fs::read_to_string(&self.path)
            .is_ok_and(|text| text.trim() == TokenText::local(self.port, &self.secret));
        if is_own && let Err(error) = fs::remove_file(&self.path) {
            let follows = "it is not valid any more; the next start replaces it";
            tracing::warn!(%error, path = %self.path.display(), follows, "local_token_not_removed");
        }
    }
}

/// Whether a file may be written later.
fn has_no_room(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::ReadOnlyFilesystem
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn the_file_is_private_fresh_at_each_start_and_removed_by_its_owner_alone() {
        use std::os::unix::fs::PermissionsExt as _;
        let data = tempfile::tempdir().unwrap();
        let first = LocalToken::write(data.path(), 8080).unwrap();
        let read = || fs::read_to_string(data.path().join(FILE)).unwrap();
        let text = read();
        assert!(text.starts_with("wmk_local-8080_") && TokenText::parse(text.trim()).is_some());
        assert!(!format!("{first:?}").contains(text.trim()));
        let mode = fs::metadata(first.path()).unwrap().permissions().mode();
        assert_eq!((mode & 0o777, first.path().is_absolute()), (0o600, true));
        // A draft of a crash with another mode does not matter.
        fs::write(data.path().join("local-token.new"), "x").unwrap();
        let second = LocalToken::write(data.path(), 8080).unwrap();
        assert_ne!(read(), text);
        first.remove();
        assert!(second.path().exists(), "it is another's");
        second.remove();
        assert_eq!(fs::read_dir(data.path()).unwrap().count(), 0);
    }
}
