//! A database that was restored takes the place of the one in use. In: a data directory in which a
//! verified copy has been written completely. Out: the same with that copy as its database, and
//! what it replaces in a folder beside it.
//!
//! The file `restored-TIME.sqlite` decides: from the moment that it has this name, whoever holds
//! the lock finishes the replacement, the restoring program or the next start of the server. Each
//! step may be done again.

use crate::private_file;
use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

const PREFIX: &str = "restored-";
const SUFFIX: &str = ".sqlite";
/// What belongs to the state of a server beside its database `file`, and is moved away with it.
fn others(file: &str) -> [String; 3] {
    [format!("{file}-wal"), format!("{file}-shm"), "mapping".to_owned()]
}

/// The name that decides.
pub(crate) fn decided(data: &Path, time: &str) -> PathBuf {
    data.join(format!("{PREFIX}{time}{SUFFIX}"))
}

/// Finishes a replacement of the database `file` that was decided. Returns the folder with what was
/// replaced, if there was any.
pub(crate) fn put_in_place(data: &Path, file: &str) -> io::Result<Option<PathBuf>> {
    let mut replaced = None;
    for entry in fs::read_dir(data)? {
        let name = entry?.file_name();
        let time = name.to_str().and_then(|name| name.strip_prefix(PREFIX)?.strip_suffix(SUFFIX));
        let Some(time) = time else { continue };
        let aside = data.join(format!("replaced-{time}"));
        for old in std::iter::once(file.to_owned()).chain(others(file)) {
            let path = data.join(&old);
            if path.exists() {
                private_file::folder(&aside)?;
                fs::rename(path, aside.join(old))?;
            }
        }
        fs::rename(data.join(&name), data.join(file))?;
        sync(data)?;
        if aside.exists() {
            sync(&aside)?;
            replaced = Some(aside);
        }
        tracing::info!(time, "restored_database_in_place");
    }
    Ok(replaced)
}

/// Makes renamed files durable.
pub(crate) fn sync(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_replacement_that_broke_off_is_finished() {
        let dir = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| fs::write(dir.path().join(name), text).unwrap();
        let read = |name: &str| fs::read_to_string(dir.path().join(name)).unwrap();
        assert_eq!(put_in_place(dir.path(), "waymark.sqlite").unwrap(), None);
        // It broke off after the first of three files.
        put("waymark.sqlite-wal", "old log");
        fs::create_dir(dir.path().join("replaced-7")).unwrap();
        put("replaced-7/waymark.sqlite", "old");
        put("restored-7.sqlite", "new");
        put("restored-8.part", "half");
        assert_eq!(put_in_place(dir.path(), "waymark.sqlite").unwrap(), Some(dir.path().join("replaced-7")));
        assert_eq!((read("waymark.sqlite"), read("replaced-7/waymark.sqlite")), ("new".into(), "old".into()));
        assert_eq!(read("replaced-7/waymark.sqlite-wal"), "old log");
        assert!(!dir.path().join("waymark.sqlite-wal").exists());
        assert_eq!(put_in_place(dir.path(), "waymark.sqlite").unwrap(), None, "done");
        assert_eq!(read("waymark.sqlite"), "new");
    }
}
