//! What a disk holds after a cut: sectors that were not synced, by file.

use crate::io_error::{Call, IoError, Planned};
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
#[derive(Debug, Clone)]
pub(crate) struct Unsynced {
    /// Length at the last sync.
    pub(crate) synced_len: u64,
    /// It is on the disk for certain.
    pub(crate) is_synced: bool,
    /// Content at the last sync of the sectors that have changed since, filled up with zeros.
    pub(crate) before: BTreeMap<u64, Vec<u8>>,
    /// The same of sectors whose sync has failed: they are as good as synced, unless they are
    /// written again.
    pub(crate) lost: BTreeMap<u64, Vec<u8>>,
}

impl Unsynced {
    /// A file as it is on the disk.
    pub(crate) fn new(len: u64) -> Self {
        Self { synced_len: len, is_synced: len > 0, before: BTreeMap::new(), lost: BTreeMap::new() }
    }

    /// All that was written is on the disk, but for what a failed sync has lost.
    pub(crate) fn synced(&mut self, len: u64) {
        self.before.clear();
        (self.synced_len, self.is_synced) = (len, true);
    }

    /// Nothing that was written will be synced any more.
    pub(crate) fn not_synced(&mut self) {
        self.lost.append(&mut self.before);
    }
}

#[derive(Debug, Default, Clone)]
pub(crate) struct State {
    pub(crate) files: BTreeMap<PathBuf, Unsynced>,
    /// Errors of single calls.
    errors: Option<Planned>,
    /// Calls until the cut.
    left: Option<u64>,
    cut_in: Option<PathBuf>,
    is_cut: bool,
}

impl State {
    /// Whether this call has an error.
    pub(crate) fn fails(&mut self, call: Call, path: &Path) -> bool {
        self.errors.as_mut().is_some_and(|errors| errors.fails(call, path))
    }

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

/// To be called where a program has written a whole file anew by itself, and synced it.
pub fn synced(file: &Path) {
    let Some(disk) = of(file) else { return };
    if let Some(unsynced) = lock(&disk).files.get_mut(file) {
        *unsynced = Unsynced::new(fs::metadata(file).map_or(0, |data| data.len()));
    }
}

/// A disk whose power can be cut, and whose calls can fail: a directory, until this is dropped.
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

    /// Cuts the power at the call after so many writes, truncations, syncs and deletions from now
    /// on.
    pub fn cut_after(&self, calls: u64) {
        lock(&self.state).left = Some(calls);
    }

    /// Has these errors from now on; `None`: no more.
    pub fn set_error(&self, error: Option<IoError>) {
        lock(&self.state).errors = error.map(Planned::new);
    }

    /// How many calls have failed since the last [`Self::set_error`].
    pub fn failed_calls(&self) -> u64 {
        lock(&self.state).errors.as_ref().map_or(0, |errors| errors.failed)
    }

    /// The files as a process that is killed now leaves them, at the directory `to`: what was not
    /// synced, or is lost, stays so.
    pub fn after_kill(&self, to: &Path) -> io::Result<Self> {
        let copy = Self::of(to)?;
        let state = lock(&self.state);
        for (path, unsynced) in &state.files {
            let Some(name) = path.file_name().filter(|_| path.exists()) else { continue };
            fs::copy(path, copy.folder.join(name))?;
            lock(&copy.state).files.insert(copy.folder.join(name), unsynced.clone());
        }
        Ok(copy)
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
            for (sector, old) in unsynced.before.iter().chain(&unsynced.lost) {
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
