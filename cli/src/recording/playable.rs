//! Which file is played. In: what was named: an MCAP file, or the folder of a bag as
//! `ros2 bag play` takes it. Out: the file, or what converts it.

use crate::failure::{Class, Failure};
use std::{
    fs::File,
    io::Read as _,
    path::{Path, PathBuf},
};

/// First bytes of files that hold messages in another form, and what to do.
const OTHER_FORMS: [(&[u8], &str, &str); 5] = [
    (
        b"SQLite format 3\0",
        "a bag of ROS 2 in SQLite (.db3)",
        "`ros2 bag convert` makes an MCAP file of it: storage_id: mcap.",
    ),
    (
        b"#ROSBAG V",
        "a bag of ROS 1",
        "`rosbags-convert --src NAME.bag --dst NAME` makes a bag of ROS 2 of it.",
    ),
    (b"\x28\xb5\x2f\xfd", "packed with zstd", "Unpack it: `zstd -d FILE`."),
    (b"\x1f\x8b", "packed with gzip", "Unpack it: `gunzip FILE`."),
    (b"BZh", "packed with bzip2", "Unpack it: `bunzip2 FILE`."),
];

/// The MCAP file that is named, or the only one in the folder that is.
pub(super) fn playable(path: &Path) -> Result<PathBuf, Failure> {
    let path = if path.is_dir() { in_folder(path)? } else { path.to_owned() };
    let mut head = [0; 16];
    let read = File::open(&path).and_then(|mut file| file.read(&mut head)).unwrap_or(0);
    match OTHER_FORMS.iter().find(|(form, ..)| head[..read].starts_with(form)) {
        None => Ok(path),
        Some((_, form, advice)) => {
            let sentence = format!("cannot play {}: it is {form}, no MCAP file.", path.display());
            Err(Failure::new(Class::Usage, "not_mcap", sentence).advise(*advice))
        }
    }
}

fn in_folder(folder: &Path) -> Result<PathBuf, Failure> {
    let unreadable =
        |error| Failure::new(Class::Usage, "unreadable", format!("{}: {error}", folder.display()));
    let entries = std::fs::read_dir(folder).map_err(unreadable)?;
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.sort();
    let ends = |path: &PathBuf, ends: &[&str]| {
        let name = path.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
        ends.iter().any(|end| name.ends_with(end))
    };
    let mcap: Vec<&PathBuf> = files.iter().filter(|path| ends(path, &[".mcap"])).collect();
    match mcap.as_slice() {
        [only] => Ok((*only).clone()),
        [] => files
            .iter()
            .find(|path| ends(path, &[".db3", ".bag", ".mcap.zstd", ".db3.zstd"]))
            .cloned()
            .ok_or_else(|| {
                let sentence = format!("No MCAP file is in {}.", folder.display());
                Failure::new(Class::NotFound, "not_mcap", sentence)
            }),
        several => {
            let sentence = format!("{} is a bag of {} files.", folder.display(), several.len());
            let advice =
                "Play one after the other, or make one of them: `mcap merge FOLDER/*.mcap -o whole.mcap`.";
            Err(Failure::new(Class::Usage, "several_files", sentence).advise(advice))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Files of a folder, `(name, first bytes)`, and the name that is played, or words of the
    /// refusal.
    type Case = (&'static [(&'static str, &'static [u8])], Result<&'static str, &'static str>);

    const CASES: &[Case] = &[
        (&[("metadata.yaml", b"rosbag2"), ("bag_0.mcap", b"\x89MCAP0\r\n")], Ok("bag_0.mcap")),
        (&[("BAG.MCAP", b"\x89MCAP0\r\n")], Ok("BAG.MCAP")),
        (&[("a_0.mcap", b"\x89MCAP0"), ("a_1.mcap", b"\x89MCAP0")], Err("a bag of 2 files")),
        (&[("metadata.yaml", b""), ("bag_0.db3", b"SQLite format 3\0rest")], Err("in SQLite (.db3)")),
        (&[("old.bag", b"#ROSBAG V2.0\n")], Err("a bag of ROS 1")),
        (&[("bag_0.mcap.zstd", b"\x28\xb5\x2f\xfd\0")], Err("packed with zstd")),
        (&[("bag_0.mcap", b"\x28\xb5\x2f\xfd\0")], Err("packed with zstd")),
        (&[("bag_0.mcap", b"\x1f\x8b\x08")], Err("packed with gzip")),
        (&[("bag_0.mcap", b"BZh9")], Err("packed with bzip2")),
        (&[("readme.txt", b"")], Err("No MCAP file is in")),
        (&[], Err("No MCAP file is in")),
    ];

    #[test]
    fn a_folder_is_played_and_other_forms_are_named_with_what_converts_them() {
        for (files, expected) in CASES {
            let folder = tempfile::tempdir().unwrap();
            for (name, bytes) in *files {
                std::fs::write(folder.path().join(name), bytes).unwrap();
            }
            match (playable(folder.path()), expected) {
                (Ok(path), Ok(name)) => assert_eq!(path, folder.path().join(name)),
                (Err(failure), Err(words)) => {
                    assert!(failure.sentence.contains(words), "{words}: {failure:?}");
                }
                (found, _) => panic!("{expected:?}: {found:?}"),
            }
        }
    }
}
