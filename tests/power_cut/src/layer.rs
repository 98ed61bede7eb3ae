//! The layer as SQLite sees it: a table of functions for the file system (`sqlite3_vfs`), and one
//! for each open file (`sqlite3_io_methods`). A file is our own structure, followed in memory by
//! that of SQLite's own layer.

use crate::{
    disk::{self, SECTOR, State, Unsynced},
    io_error::Call,
};
use libsqlite3_sys::{
    SQLITE_IOERR_DELETE, SQLITE_IOERR_FSYNC, SQLITE_IOERR_TRUNCATE, SQLITE_IOERR_WRITE, SQLITE_OK,
    SQLITE_OPEN_MAIN_DB, SQLITE_OPEN_WAL, sqlite3_file, sqlite3_io_methods, sqlite3_vfs, sqlite3_vfs_find,
    sqlite3_vfs_register,
};
use std::{
    ffi::{CStr, c_char, c_int, c_void},
    mem::size_of,
    path::{Path, PathBuf},
    ptr,
    sync::{Arc, Mutex, MutexGuard, Once, PoisonError},
};

/// Name of the layer, for `vfs` of the options of a connection.
pub const NAME: &str = "power-cut";
const NAME_C: &CStr = c"power-cut";

/// The file of a disk that can be cut.
struct Tracked {
    disk: Arc<Mutex<State>>,
    path: PathBuf,
}

/// An open file. SQLite allocates it with the size of the layer, so that the file of the layer
/// below follows.
#[repr(C)]
struct File {
    base: sqlite3_file,
    /// Null: a file of no disk, such as a temporary one.
    tracked: *mut Tracked,
}

/// Registers the layer, once a process.
pub fn install() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // SAFETY: the default layer is never removed, and its table may be copied. Ours lives for
        // ever.
        let registered = unsafe {
            let below = sqlite3_vfs_find(ptr::null());
            assert!(!below.is_null(), "SQLite has a default layer");
            let mut ours = *below;
            ours.zName = NAME_C.as_ptr();
            ours.pNext = ptr::null_mut();
            ours.szOsFile += size_of::<File>() as c_int;
            ours.xOpen = Some(open);
            ours.xDelete = Some(delete);
            sqlite3_vfs_register(Box::leak(Box::new(ours)), 0)
        };
        assert_eq!(registered, SQLITE_OK);
    });
}

fn below() -> *mut sqlite3_vfs {
    // SAFETY: a question that SQLite answers at any time.
    unsafe { sqlite3_vfs_find(ptr::null()) }
}

/// The file of the layer below.
///
/// # Safety
/// `file` was opened by [`open`].
unsafe fn inner(file: *mut sqlite3_file) -> *mut sqlite3_file {
    // SAFETY: SQLite allocated `szOsFile` bytes, which is ours and that of the layer below.
    unsafe { file.cast::<u8>().add(size_of::<File>()).cast() }
}

/// # Safety
/// `file` was opened by [`open`] and not closed.
unsafe fn tracked<'f>(file: *mut sqlite3_file) -> Option<(&'f Tracked, MutexGuard<'f, State>)> {
    // SAFETY: the pointer is null or that of the box made by `open`, which `close` alone frees.
    let tracked: &Tracked = unsafe { (*file.cast::<File>()).tracked.as_ref() }?;
    Some((tracked, tracked.disk.lock().unwrap_or_else(PoisonError::into_inner)))
}

/// Calls a function of the layer below.
macro_rules! pass {
    ($file:ident . $function:ident ( $($argument:expr),* )) => {{
        // SAFETY: the layer below opened this file, and all its functions are there from version 2
        // on.
        unsafe {
            let inner = inner($file);
            match (*(*inner).pMethods).$function {
                Some(function) => function(inner $(, $argument)*),
                None => libsqlite3_sys::SQLITE_IOERR,
            }
        }
    }};
}

unsafe extern "C" fn open(
    _vfs: *mut sqlite3_vfs,
    name: *const c_char,
    file: *mut sqlite3_file,
    flags: c_int,
    out: *mut c_int,
) -> c_int {
    let below = below();
    // SAFETY: SQLite gives memory for both structures; the layer below gets its own part and its
    // own table.
    unsafe {
        (*file).pMethods = ptr::null();
        (*file.cast::<File>()).tracked = ptr::null_mut();
        let inner = inner(file);
        (*inner).pMethods = ptr::null();
        let Some(open) = (*below).xOpen else { return libsqlite3_sys::SQLITE_CANTOPEN };
        let opened = open(below, name, inner, flags, out);
        if opened != SQLITE_OK {
            return opened;
        }
        (*file).pMethods = &raw const METHODS;
        if !name.is_null() && flags & (SQLITE_OPEN_MAIN_DB | SQLITE_OPEN_WAL) != 0 {
            let path = PathBuf::from(CStr::from_ptr(name).to_string_lossy().into_owned());
            if let Some(disk) = disk::of(&path) {
                let len = std::fs::metadata(&path).map_or(0, |data| data.len());
                let new = || Unsynced::new(len);
                let mut state = disk.lock().unwrap_or_else(PoisonError::into_inner);
                state.files.entry(path.clone()).or_insert_with(new);
                drop(state);
                (*file.cast::<File>()).tracked = Box::into_raw(Box::new(Tracked { disk, path }));
            }
        }
    }
    SQLITE_OK
}

unsafe extern "C" fn delete(_vfs: *mut sqlite3_vfs, name: *const c_char, sync: c_int) -> c_int {
    // SAFETY: SQLite gives a name that ends with 0.
    let path = unsafe { CStr::from_ptr(name) }.to_string_lossy().into_owned();
    if let Some(disk) = disk::of(Path::new(&path)) {
        let mut state = disk.lock().unwrap_or_else(PoisonError::into_inner);
        if !state.goes_on(Path::new(&path)) {
            return SQLITE_IOERR_DELETE;
        }
        state.files.remove(Path::new(&path));
    }
    let below = below();
    // SAFETY: passed on with the table of the layer below.
    unsafe {
        match (*below).xDelete {
            Some(delete) => delete(below, name, sync),
            None => SQLITE_IOERR_DELETE,
        }
    }
}

unsafe extern "C" fn close(file: *mut sqlite3_file) -> c_int {
    let closed = pass!(file.xClose());
    // SAFETY: SQLite closes a file once; the box was made by `open`.
    unsafe {
        let tracked = std::mem::replace(&mut (*file.cast::<File>()).tracked, ptr::null_mut());
        if !tracked.is_null() {
            drop(Box::from_raw(tracked));
        }
    }
    closed
}

unsafe extern "C" fn read(file: *mut sqlite3_file, to: *mut c_void, count: c_int, at: i64) -> c_int {
    pass!(file.xRead(to, count, at))
}

/// Keeps what the sectors from `from` to `end` (bytes) hold on the disk.
fn keep(file: *mut sqlite3_file, unsynced: &mut Unsynced, from: u64, end: u64) {
    let Unsynced { before, lost, .. } = unsynced;
    for sector in from / SECTOR..end.div_ceil(SECTOR) {
        before.entry(sector).or_insert_with(|| {
            if let Some(old) = lost.remove(&sector) {
                return old;
            }
            let mut old = vec![0_u8; SECTOR as usize];
            // What lies beyond the end is read as zeros.
            pass!(file.xRead(old.as_mut_ptr().cast(), SECTOR as c_int, (sector * SECTOR) as i64));
            old
        });
    }
}

unsafe extern "C" fn write(file: *mut sqlite3_file, from: *const c_void, count: c_int, at: i64) -> c_int {
    // SAFETY: an open file of this layer.
    if let Some((tracked, mut state)) = unsafe { tracked(file) } {
        if !state.goes_on(&tracked.path) {
            return SQLITE_IOERR_WRITE;
        }
        if let Some(unsynced) = state.files.get_mut(&tracked.path) {
            keep(file, unsynced, at as u64, at as u64 + count as u64);
        }
        if state.fails(Call::Write, &tracked.path) {
            pass!(file.xWrite(from, count / 2, at));
            return SQLITE_IOERR_WRITE;
        }
    }
    pass!(file.xWrite(from, count, at))
}

unsafe extern "C" fn truncate(file: *mut sqlite3_file, size: i64) -> c_int {
    // SAFETY: an open file of this layer.
    if let Some((tracked, mut state)) = unsafe { tracked(file) } {
        if !state.goes_on(&tracked.path) {
            return SQLITE_IOERR_TRUNCATE;
        }
        if state.fails(Call::Truncate, &tracked.path) {
            return SQLITE_IOERR_TRUNCATE;
        }
        let mut now = 0;
        pass!(file.xFileSize(&raw mut now));
        if let Some(unsynced) = state.files.get_mut(&tracked.path) {
            keep(file, unsynced, size as u64, (now as u64).max(size as u64));
        }
    }
    pass!(file.xTruncate(size))
}

/// The disk of a test need not be synced itself: the process lives on.
unsafe extern "C" fn sync(file: *mut sqlite3_file, flags: c_int) -> c_int {
    // SAFETY: an open file of this layer.
    let Some((tracked, mut state)) = (unsafe { tracked(file) }) else { return pass!(file.xSync(flags)) };
    if !state.goes_on(&tracked.path) {
        return SQLITE_IOERR_FSYNC;
    }
    let fails = state.fails(Call::Sync, &tracked.path);
    let mut now = 0;
    let sized = pass!(file.xFileSize(&raw mut now));
    if let Some(unsynced) = state.files.get_mut(&tracked.path) {
        if fails {
            unsynced.not_synced();
            return SQLITE_IOERR_FSYNC;
        }
        unsynced.synced(now as u64);
    }
    sized
}

unsafe extern "C" fn file_size(file: *mut sqlite3_file, size: *mut i64) -> c_int {
    pass!(file.xFileSize(size))
}

unsafe extern "C" fn lock(file: *mut sqlite3_file, level: c_int) -> c_int {
    pass!(file.xLock(level))
}

unsafe extern "C" fn unlock(file: *mut sqlite3_file, level: c_int) -> c_int {
    pass!(file.xUnlock(level))
}

unsafe extern "C" fn check_reserved_lock(file: *mut sqlite3_file, out: *mut c_int) -> c_int {
    pass!(file.xCheckReservedLock(out))
}

unsafe extern "C" fn file_control(file: *mut sqlite3_file, operation: c_int, argument: *mut c_void) -> c_int {
    pass!(file.xFileControl(operation, argument))
}

unsafe extern "C" fn sector_size(file: *mut sqlite3_file) -> c_int {
    pass!(file.xSectorSize())
}

/// As in the product: an overwrite spares what it does not touch, and nothing more is promised.
unsafe extern "C" fn device_characteristics(file: *mut sqlite3_file) -> c_int {
    pass!(file.xDeviceCharacteristics())
}

unsafe extern "C" fn shm_map(
    file: *mut sqlite3_file,
    region: c_int,
    size: c_int,
    extend: c_int,
    out: *mut *mut c_void,
) -> c_int {
    pass!(file.xShmMap(region, size, extend, out))
}

unsafe extern "C" fn shm_lock(file: *mut sqlite3_file, offset: c_int, count: c_int, flags: c_int) -> c_int {
    pass!(file.xShmLock(offset, count, flags))
}

unsafe extern "C" fn shm_barrier(file: *mut sqlite3_file) {
    // SAFETY: as in `pass`, for a function without a result.
    unsafe {
        let inner = inner(file);
        if let Some(barrier) = (*(*inner).pMethods).xShmBarrier {
            barrier(inner);
        }
    }
}

unsafe extern "C" fn shm_unmap(file: *mut sqlite3_file, delete: c_int) -> c_int {
    pass!(file.xShmUnmap(delete))
}

static METHODS: sqlite3_io_methods = sqlite3_io_methods {
    iVersion: 2,
    xClose: Some(close),
    xRead: Some(read),
    xWrite: Some(write),
    xTruncate: Some(truncate),
    xSync: Some(sync),
    xFileSize: Some(file_size),
    xLock: Some(lock),
    xUnlock: Some(unlock),
    xCheckReservedLock: Some(check_reserved_lock),
    xFileControl: Some(file_control),
    xSectorSize: Some(sector_size),
    xDeviceCharacteristics: Some(device_characteristics),
    xShmMap: Some(shm_map),
    xShmLock: Some(shm_lock),
    xShmBarrier: Some(shm_barrier),
    xShmUnmap: Some(shm_unmap),
    xFetch: None,
    xUnfetch: None,
};
