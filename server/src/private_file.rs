//! Files and folders of the data directory: readable by their owner alone, whatever the umask. In:
//! paths. Out: files made with mode 0600 and folders with 0700, and those of an earlier program
//! closed to others.
//!
//! Each is closed where it is made, so that it holds for a server inside another program, whose
//! umask is that program's. `waymark serve` owns its process and sets the umask besides, for what
//! libraries make.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Write as _},
    path::Path,
};

/// What may be in a data directory, files and folders: whole names, or how they begin. Nothing else
/// is touched: the directory may be a folder with files of other programs.
#[cfg(unix)]
const OWN: [&str; 9] = [
    "waymark.sqlite",
    "lock",
    "local-token",
    "server-name",
    "backups",
    "mapping",
    "restor",
    "replaced-",
    "tls",
];
/// Folders in one another that are looked into: `replaced-TIME/mapping`.
#[cfg(unix)]
const MAX_DEPTH: usize = 3;
/// Bits of the mode that group and others have.
#[cfg(unix)]
const OTHERS: u32 = 0o077;
/// A folder that everybody may write, `/tmp`: it is not the server's.
#[cfg(unix)]
const STICKY: u32 = 0o1000;

/// Writes a file that nobody else can read, not even for a moment. It appears whole or not at all.
pub(crate) fn write(path: &Path, text: &str) -> io::Result<()> {
    let draft = path.with_extension("new");
    // One that a crash has left behind; its mode is not known.
    match fs::remove_file(&draft) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let mut file = private(OpenOptions::new().write(true).create_new(true)).open(&draft)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()?;
    fs::rename(&draft, path)
}

/// A file to write, empty if it is not there: what is there stays.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    private(OpenOptions::new().write(true).create(true).truncate(false)).open(path)
}

/// A new empty file to write.
pub(crate) fn create(path: &Path) -> io::Result<File> {
    private(OpenOptions::new().write(true).create(true).truncate(true)).open(path)
}

/// Options by which a file is made for its owner alone.
fn private(options: &mut OpenOptions) -> &mut OpenOptions {
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(options, 0o600);
    options
}

/// Makes a folder that nobody else can enter; one that is there is closed to others.
pub(crate) fn folder(path: &Path) -> io::Result<()> {
    fs::create_dir_all(path)?;
    close_to_others(path, 0o700)
}

/// Takes the rights of group and others away.
pub(crate) fn close_to_others(path: &Path, mode: u32) -> io::Result<()> {
    #[cfg(unix)]
    fs::set_permissions(path, std::os::unix::fs::PermissionsExt::from_mode(mode))?;
    #[cfg(not(unix))]
    let _ = (path, mode);
    Ok(())
}

/// What of a data directory was open to others.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct OpenToOthers {
    /// Files that are closed now.
    pub(crate) files: u64,
    /// Folders that are closed now, the data directory among them.
    pub(crate) folders: u64,
    /// What stays open: it is another user's, or the file system refuses.
    pub(crate) left: u64,
}

/// Makes a data directory if it is not there, and closes what an earlier program, a copy or an
/// unpacked archive has left open in it. Links are not followed.
pub(crate) fn data_directory(data: &Path) -> io::Result<OpenToOthers> {
    let mut found = OpenToOthers::default();
    if !data.exists() {
        folder(data)?;
        return Ok(found);
    }
    #[cfg(unix)]
    {
        let entries: Vec<_> = fs::read_dir(data)?.collect::<io::Result<_>>()?;
        close(data, &fs::metadata(data)?, &mut found);
        let is_own = |name: &std::ffi::OsStr| {
            name.to_str().is_some_and(|name| OWN.iter().any(|own| name.starts_with(own)))
        };
        for entry in entries.iter().filter(|entry| is_own(&entry.file_name())) {
            close_all(&entry.path(), MAX_DEPTH, &mut found);
        }
    }
    Ok(found)
}

/// Closes a file, or a folder with what is in it. What cannot be read stays as it is.
#[cfg(unix)]
fn close_all(path: &Path, depth: usize, found: &mut OpenToOthers) {
    let Ok(metadata) = fs::symlink_metadata(path) else { return };
    if metadata.is_symlink() {
        return;
    }
    close(path, &metadata, found);
    if metadata.is_dir() && depth > 0 {
        for entry in fs::read_dir(path).into_iter().flatten().flatten() {
            close_all(&entry.path(), depth - 1, found);
        }
    }
}

#[cfg(unix)]
fn close(path: &Path, metadata: &fs::Metadata, found: &mut OpenToOthers) {
    use std::os::unix::fs::PermissionsExt as _;
    let mode = metadata.permissions().mode();
    if mode & OTHERS == 0 {
        return;
    }
    let is_folder = metadata.is_dir();
    let is_closed = mode & STICKY == 0 && close_to_others(path, mode & 0o7777 & !OTHERS).is_ok();
    match (is_closed, is_folder) {
        (false, _) => found.left += 1,
        (true, true) => found.folders += 1,
        (true, false) => found.files += 1,
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).unwrap().permissions().mode() & 0o7777
    }

    #[test]
    fn what_an_earlier_program_left_open_is_closed_and_counted_and_nothing_else_is_touched() {
        let dir = tempfile::tempdir().unwrap();
        let (data, outside) = (dir.path().join("data"), dir.path().join("outside"));
        fs::write(&outside, "of somebody else").unwrap();
        assert_eq!(data_directory(&data).unwrap(), OpenToOthers::default());
        assert_eq!(mode(&data), 0o700, "made");
        let set = |path: &Path, mode| fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
        let put = |name: &str, mode| {
            let path = data.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, "x").unwrap();
            set(&path, mode);
        };
        for (name, mode) in [
            ("waymark.sqlite", 0o644),
            ("waymark.sqlite-wal", 0o666),
            ("lock", 0o600),
            ("backups/a.waymark", 0o640),
            ("replaced-7/mapping/hall.scans", 0o604),
            ("notes.txt", 0o644),
        ] {
            put(name, mode);
        }
        for folder in ["backups", "replaced-7", "replaced-7/mapping"] {
            set(&data.join(folder), 0o755);
        }
        set(&data, 0o755);
        std::os::unix::fs::symlink(&outside, data.join("backups/link")).unwrap();
        assert_eq!(data_directory(&data).unwrap(), OpenToOthers { files: 4, folders: 4, left: 0 });
        for (name, wanted) in [
            ("", 0o700),
            ("waymark.sqlite", 0o600),
            ("waymark.sqlite-wal", 0o600),
            ("lock", 0o600),
            ("backups", 0o700),
            ("backups/a.waymark", 0o600),
            ("replaced-7/mapping", 0o700),
            ("replaced-7/mapping/hall.scans", 0o600),
            ("notes.txt", 0o644),
        ] {
            assert_eq!(mode(&data.join(name)), wanted, "{name}");
        }
        assert_eq!(mode(&outside), 0o644, "behind a link");
        assert_eq!(data_directory(&data).unwrap(), OpenToOthers::default(), "once is enough");
        // A folder for everybody is not the server's to close.
        set(&data, 0o1777);
        assert_eq!(data_directory(&data).unwrap(), OpenToOthers { left: 1, ..OpenToOthers::default() });
        assert_eq!(mode(&data), 0o1777);
    }
}
