//! What a disk holds after a cut: sectors that were not synced, by file.

use std::{
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

/// Bytes that are written as a whole or not at all.
pub(crate) const SECTOR: u64 = 512;

/// Numbers from a seed (splitmix64).
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// The numbers of this seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number.
    pub fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `bound`, which is not 0.
    pub fn below(&mut self, bound: u64) -> u64 {
        self.next_u64() % bound
    }
}

/// What was not synced of a file.
#[derive(Debug)]
pub(crate) struct Unsynced {
    /// Length at the last sync.
    pub(crate) synced_len: u64,
    /// It is on the disk for certain.
    pub(crate) is_synced: bool,
    /// Content at the last sync of the sectors that have changed since, filled up with zeros.
    pub(crate) before: BTreeMap<u64, Vec<u8>>,
}

#[derive(Debug, Default)]
pub(crate) struct State {
    pub(crate) files: BTreeMap<PathBuf, Unsynced>,
    /// Calls until the cut.
    left: Option<u64>,
    cut_in: Option<PathBuf>,
    is_cut: bool,
}

impl State {
    /// Counts a call that changes a file. False once the power is cut.
    pub(crate) fn goes_on(&mut self, path: &Path) -> bool {
        if self.is_cut {
            return false;
        }
        let Some(left) = &mut self.left else { return true };
        if *left > 0 {
            *left -= 1;
            return true;
        }
        (self.is_cut, self.cut_in) = (true, Some(path.to_owned()));
        false
    }
}

static DISKS: Mutex<Vec<(PathBuf, Arc<Mutex<State>>)>> = Mutex::new(Vec::new());

fn lock<T>(what: &Mutex<T>) -> MutexGuard<'_, T> {
    what.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The disk of a file, if it lies in the directory of one.
pub(crate) fn of(file: &Path) -> Option<Arc<Mutex<State>>> {
    let disks = lock(&DISKS);
    disks.iter().find(|(folder, _)| file.starts_with(folder)).map(|(_, state)| state.clone())
}

/// A disk whose power can be cut: a directory, until this is dropped.
#[derive(Debug)]
pub struct Disk {
    folder: PathBuf,
    state: Arc<Mutex<State>>,
}

impl Disk {
    /// The disk of the files below this directory; what is there is synced.
    pub fn of(folder: &Path) -> io::Result<Self> {
        let (folder, state) = (folder.canonicalize()?, Arc::<Mutex<State>>::default());
        lock(&DISKS).push((folder.clone(), state.clone()));
        Ok(Self { folder, state })
    }

    /// Cuts the power at the call after so many writes, truncations, syncs and deletions from now on.
    pub fn cut_after(&self, calls: u64) {
        lock(&self.state).left = Some(calls);
    }

    /// Name of the file whose call was cut; `None` before the cut.
    pub fn cut_in(&self) -> Option<String> {
        let state = lock(&self.state);
        state.cut_in.as_ref()?.file_name()?.to_str().map(str::to_owned)
    }

    /// Writes the files to the directory `to` as they may be after the cut.
    pub fn after_cut(&self, to: &Path, random: &mut Random) -> io::Result<()> {
        let state = lock(&self.state);
        for (path, unsynced) in &state.files {
            let Some(name) = path.file_name() else { continue };
            // A file that was never synced may have no entry in its directory.
            if !path.exists() || (!unsynced.is_synced && random.below(2) == 0) {
                continue;
            }
            let mut bytes = fs::read(path)?;
            // All that was not synced is lost, half of it, or a tenth.
            let kept_of_ten = [0, 5, 9][random.below(3) as usize];
            for (sector, old) in &unsynced.before {
                if random.below(10) < kept_of_ten {
                    continue;
                }
                let at = (sector * SECTOR) as usize;
                if bytes.len() < at + old.len() {
                    bytes.resize(at + old.len(), 0);
                }
                bytes[at..at + old.len()].copy_from_slice(old);
            }
            let longest = fs::metadata(path)?.len().max(unsynced.synced_len);
            let len = if random.below(3) == 0 { unsynced.synced_len } else { longest };
            bytes.truncate(len as usize);
            fs::write(to.join(name), bytes)?;
        }
        Ok(())
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        lock(&DISKS).retain(|(folder, _)| *folder != self.folder);
    }
}
