//! The journal of a mapping: its scans and frames on disk, so that a restart of the server loses no
//! drive. One append-only file a map. In: what is mapped. Out: the same at the next start, up to
//! the first record that is not whole.
//!
//! A record is its length (4 bytes, little-endian), the first 8 bytes of its SHA-256, and its
//! bytes. The first record is the header as JSON; the others are those of `record`.

use super::record::Record;
use map::{check::OutOfRange, pose2::Pose2};
use protos::{Name, convert::frame::MAX_FRAME_IMAGE_BYTES};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use std::{
    fs::{File, OpenOptions},
    io::{self, BufReader, Read, Seek, Write},
    path::{Path, PathBuf},
};

/// Largest journal: some hours of a large scanner.
pub(super) const MAX_BYTES: u64 = 2 << 30;
/// Largest record: a frame with the largest image.
const MAX_RECORD: u32 = (MAX_FRAME_IMAGE_BYTES + crate::limits::MAX_SCAN_BYTES) as u32;
/// Scans after which the file is synced, in case of a power cut.
const SYNC_EVERY: u32 = 50;
/// Bytes of the length and the digest.
const FRAME_BYTES: usize = 12;
/// Extension of the files.
const EXTENSION: &str = "scans";

/// The first record: whose scans follow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct JournalHeader {
    /// Version of the format.
    waymark_mapping: u32,
    /// Name of the map.
    pub map: Name,
    /// Name of the robot.
    pub robot: Name,
    /// The robot's first pose where it is known: x, y (map frame, m), theta (rad).
    pub origin: Option<[f64; 3]>,
    /// Whether frames are taken.
    pub landmarks: bool,
}

impl JournalHeader {
    pub(super) fn new(map: &Name, robot: &Name, (origin, landmarks): (Option<&Pose2>, bool)) -> Self {
        let origin = origin.map(|pose| [pose.x_m, pose.y_m, pose.theta_rad]);
        Self { waymark_mapping: 2, map: map.clone(), robot: robot.clone(), origin, landmarks }
    }

    /// The first pose where it is known; an error where it is out of range.
    pub(super) fn origin(&self) -> Result<Option<Pose2>, OutOfRange> {
        let pose = |[x_m, y_m, theta_rad]: [f64; 3]| Pose2 { x_m, y_m, theta_rad };
        let origin = self.origin.map(pose);
        origin.as_ref().map_or(Ok(()), Pose2::check)?;
        Ok(origin)
    }
}

/// The journal of an open mapping.
#[derive(Debug)]
pub(super) struct Journal {
    file: File,
    bytes: u64,
    unsynced: u32,
}

fn path(dir: &Path, map: &str) -> PathBuf {
    dir.join(map).with_extension(EXTENSION)
}

fn framed(record: &[u8]) -> io::Result<Vec<u8>> {
    let length = u32::try_from(record.len()).ok().filter(|n| *n <= MAX_RECORD);
    let length = length.ok_or_else(|| io::Error::other("a record is too long"))?;
    let digest = Sha256::digest(record);
    Ok([&length.to_le_bytes()[..], &digest[..8], record].concat())
}

impl Journal {
    /// A new journal; replaces any other of the map.
    pub(super) fn create(dir: &Path, head: &JournalHeader) -> io::Result<Self> {
        std::fs::create_dir_all(dir)?;
        let mut options = OpenOptions::new();
        options.write(true).create(true).truncate(true);
        // Where robots drove is for the server's user alone, whatever the umask.
        #[cfg(unix)]
        {
            std::fs::set_permissions(dir, std::os::unix::fs::PermissionsExt::from_mode(0o700))?;
            std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        }
        let file = options.open(path(dir, head.map.as_str()))?;
        let mut made = Self { file, bytes: 0, unsynced: 0 };
        made.put(&serde_json::to_vec(head)?)?;
        made.file.sync_all()?;
        Ok(made)
    }

    /// Adds a scan or a frame.
    pub(super) fn put_record(&mut self, record: &Record) -> io::Result<()> {
        self.put(&record.bytes())?;
        self.unsynced += 1;
        if self.unsynced >= SYNC_EVERY {
            self.unsynced = 0;
            self.file.sync_data()?;
        }
        Ok(())
    }

    fn put(&mut self, record: &[u8]) -> io::Result<()> {
        let framed = framed(record)?;
        let bytes = self.bytes + framed.len() as u64;
        if bytes > MAX_BYTES {
            return Err(io::Error::other(format!("more than {MAX_BYTES} bytes of scans and frames")));
        }
        self.file.write_all(&framed)?;
        self.bytes = bytes;
        Ok(())
    }
}

/// Removes the journal of a map.
pub(super) fn remove(dir: &Path, map: &str) {
    if let Err(error) = std::fs::remove_file(path(dir, map))
        && error.kind() != io::ErrorKind::NotFound
    {
        tracing::warn!(map, %error, "journal_not_removed");
    }
}

/// A journal that is read, and then appended to.
#[derive(Debug)]
pub(super) struct JournalReader {
    pub(super) head: JournalHeader,
    from: BufReader<File>,
    file: File,
    /// Up to here every record is whole.
    whole: u64,
}

impl JournalReader {
    /// All journals of a folder, by map. A file that is no journal is left alone and logged.
    pub(super) fn all(dir: &Path) -> Vec<Self> {
        let entries = std::fs::read_dir(dir).into_iter().flatten().flatten();
        let mut paths: Vec<PathBuf> = entries.map(|e| e.path()).collect();
        paths.retain(|p| p.extension().is_some_and(|e| e == EXTENSION));
        paths.sort();
        let read = |p: &PathBuf| {
            Self::open(p).inspect_err(|error| tracing::warn!(path = %p.display(), %error, "journal unreadable; mapping not resumed, file kept")).ok()
        };
        paths.iter().filter_map(read).collect()
    }

    fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).open(path)?;
        let mut from = BufReader::new(file.try_clone()?);
        let mut whole = 0;
        let record = record(&mut from, &mut whole).ok_or_else(|| io::Error::other("it has no head"))?;
        let head: JournalHeader = serde_json::from_slice(&record)?;
        let named = path.file_stem().is_some_and(|stem| stem == head.map.as_str());
        if !named || head.waymark_mapping != 2 || head.origin().is_err() {
            return Err(io::Error::other("its head is not one of this map"));
        }
        Ok(Self { head, from, file, whole })
    }

    /// The next scan or frame; `None` at the end, or before the first that is not whole.
    pub(super) fn next(&mut self) -> Option<Record> {
        let before = self.whole;
        let read = record(&mut self.from, &mut self.whole);
        let next = read.and_then(|bytes| Record::parsed(&bytes, &self.head.map));
        if next.is_none() {
            self.whole = before;
        }
        next
    }

    /// The journal for appending after the last whole record.
    pub(super) fn reopened(mut self) -> io::Result<Journal> {
        self.file.set_len(self.whole)?;
        self.file.seek(io::SeekFrom::Start(self.whole))?;
        Ok(Journal { file: self.file, bytes: self.whole, unsynced: 0 })
    }
}

/// One record, if it is whole; counts its bytes.
fn record(from: &mut impl Read, whole: &mut u64) -> Option<Vec<u8>> {
    let mut frame = [0; FRAME_BYTES];
    from.read_exact(&mut frame).ok()?;
    let (length, digest) = frame.split_at(4);
    let length = u32::from_le_bytes(length.try_into().ok()?);
    if length > MAX_RECORD {
        return None;
    }
    let mut record = vec![0; length as usize];
    from.read_exact(&mut record).ok()?;
    if Sha256::digest(&record)[..8] != *digest {
        return None;
    }
    *whole += (FRAME_BYTES + record.len()) as u64;
    Some(record)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan_job::ScanJob;
    use map::laser::Scan;

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    fn job(i: i64) -> ScanJob {
        let scan =
            Scan::new(Pose2::new(0.2, 0.0, 0.0), -1.0, 0.1, 20.0, vec![3.5, f32::NAN, i as f32]).unwrap();
        let odom_from_robot = Pose2::new(0.1 * i as f64, 0.2, 0.3);
        ScanJob { map: "hall".into(), epoch: 7, captured_ns: i, odom_from_robot, scan }
    }

    fn scan_of(record: Record) -> ScanJob {
        let Record::Scan(job) = record else { panic!("{record:?}") };
        job
    }

    fn written(dir: &Path, scans: i64) {
        let head = JournalHeader::new(&name("hall"), &name("r1"), (Some(&Pose2::new(1.0, 2.0, 0.5)), true));
        let mut journal = Journal::create(dir, &head).unwrap();
        for i in 1..=scans {
            journal.put_record(&Record::Scan(job(i))).unwrap();
        }
    }

    fn read(dir: &Path) -> (Vec<i64>, Option<Journal>) {
        let Some(mut reader) = JournalReader::all(dir).pop() else { return (Vec::new(), None) };
        let scans = std::iter::from_fn(|| reader.next()).map(|record| scan_of(record).captured_ns).collect();
        (scans, reader.reopened().ok())
    }

    #[test]
    fn what_was_written_is_read_and_appended_to() {
        let dir = tempfile::tempdir().unwrap();
        written(dir.path(), 3);
        let mut reader = JournalReader::all(dir.path()).pop().unwrap();
        assert_eq!(
            (reader.head.robot.as_str(), reader.head.origin()),
            ("r1", Ok(Some(Pose2::new(1.0, 2.0, 0.5))))
        );
        let first = scan_of(reader.next().unwrap());
        assert_eq!((first.epoch, first.odom_from_robot), (7, job(1).odom_from_robot));
        assert!((first.scan.ranges_m()[0] - 3.5).abs() < 1e-9 && first.scan.ranges_m()[1].is_nan());
        let (scans, journal) = read(dir.path());
        assert_eq!(scans, [1, 2, 3]);
        journal.unwrap().put_record(&Record::Scan(job(4))).unwrap();
        assert_eq!(read(dir.path()).0, [1, 2, 3, 4]);
        remove(dir.path(), "hall");
        remove(dir.path(), "hall");
        assert!(JournalReader::all(dir.path()).is_empty());
    }

    #[test]
    fn a_torn_tail_is_cut_off_wherever_it_is_torn() {
        let dir = tempfile::tempdir().unwrap();
        written(dir.path(), 2);
        let file = path(dir.path(), "hall");
        let two = std::fs::read(&file).unwrap();
        written(dir.path(), 3);
        let three = std::fs::read(&file).unwrap();
        assert_eq!(three[..two.len()], two[..]);
        for end in two.len()..three.len() {
            std::fs::write(&file, &three[..end]).unwrap();
            let (scans, journal) = read(dir.path());
            assert_eq!(scans, [1, 2], "{end}");
            journal.unwrap().put_record(&Record::Scan(job(9))).unwrap();
            assert_eq!(read(dir.path()).0, [1, 2, 9], "{end}");
        }
    }

    #[test]
    fn a_damaged_record_ends_it_and_a_damaged_head_is_no_mapping() {
        let dir = tempfile::tempdir().unwrap();
        written(dir.path(), 3);
        let file = path(dir.path(), "hall");
        let whole = std::fs::read(&file).unwrap();
        let flipped = |at: usize| {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            std::fs::write(&file, bytes).unwrap();
        };
        flipped(whole.len() - 1);
        assert_eq!(read(dir.path()).0, [1, 2]);
        written(dir.path(), 2);
        let third = whole.len() as u64 - std::fs::metadata(&file).unwrap().len();
        flipped(whole.len() - third as usize - 1);
        let (scans, journal) = read(dir.path());
        assert_eq!(scans, [1]);
        journal.unwrap().put_record(&Record::Scan(job(9))).unwrap();
        assert_eq!(read(dir.path()).0, [1, 9], "what came after the damage does not come back");
        flipped(20);
        assert!(JournalReader::all(dir.path()).is_empty());
        std::fs::write(&file, []).unwrap();
        assert!(JournalReader::all(dir.path()).is_empty());
        std::fs::write(&file, &whole).unwrap();
        std::fs::rename(&file, path(dir.path(), "other")).unwrap();
        assert!(JournalReader::all(dir.path()).is_empty(), "under the name of another map");
    }

    #[test]
    fn it_is_bounded() {
        let dir = tempfile::tempdir().unwrap();
        written(dir.path(), 1);
        let mut journal = read(dir.path()).1.unwrap();
        journal.bytes = MAX_BYTES - 60;
        assert!(journal.put_record(&Record::Scan(job(2))).unwrap_err().to_string().contains("more than"));
        assert_eq!(read(dir.path()).0, [1], "nothing of it was written");
    }
}
