//! Claim: a file that was cut off is read up to its last whole chunk; a damaged file gives an error
//! or messages, never a panic.

use crate::drive::{file, messages, name, read};
use proptest::prelude::*;
use recordings::{DriveReader, DriveWriter, read::ReadFault};
use std::io::{Cursor, Write};

#[test]
fn a_file_that_is_cut_off_is_read_up_to_the_last_whole_chunk() {
    let written = messages(100_000);
    let whole = file(&written);
    let mut lengths = Vec::new();
    for tenth in 1..10 {
        let cut = &whole[..whole.len() * tenth / 10];
        let found = read(cut).unwrap();
        assert_eq!(found, written[..found.len()]);
        let reader = DriveReader::open(Cursor::new(cut)).unwrap();
        assert!(reader.cut_off_at().is_some_and(|at| at <= cut.len() as u64));
        lengths.push(found.len());
    }
    assert!(lengths.is_sorted() && lengths[0] == 0 && lengths[8] > 40, "{lengths:?}");
    assert_eq!(DriveReader::open(Cursor::new(&whole)).unwrap().cut_off_at(), None);
}

/// What a recorder leaves that is killed: it never ends the file.
#[test]
fn a_recorder_that_is_killed_leaves_all_but_the_last_second() {
    let written = messages(12);
    let out = tempfile::NamedTempFile::new().unwrap();
    let mut writer = DriveWriter::create(out.reopen().unwrap(), &name("default"), "test").unwrap();
    for message in &written {
        writer.write(message.clone()).unwrap();
    }
    let mut later = written[0].clone();
    later.log_time_ns += 1_500_000_000;
    writer.write(later).unwrap();
    let left_behind = std::fs::read(out.path()).unwrap();
    std::mem::forget(writer);
    assert_eq!(read(&left_behind).unwrap(), written);
}

#[test]
fn other_files_are_refused() {
    for other in [&b""[..], b"\x89MCAP", b"%PDF-1.7 and more", &[0; 1000]] {
        let error = read(other).unwrap_err();
        assert!(matches!(error.fault, ReadFault::NotMcap), "{error}");
    }
}

#[test]
fn a_damaged_chunk_is_named_with_its_place() {
    let mut damaged = file(&messages(12));
    let at = damaged.windows(6).position(|w| w == b"poster").unwrap();
    damaged[at] ^= 1;
    let error = read(&damaged).unwrap_err();
    assert!(matches!(error.fault, ReadFault::Checksum { .. }) && error.offset > 0, "{error}");
}

#[test]
fn a_chunk_that_claims_to_be_huge_is_refused() {
    let mut file = Vec::from(mcap::MAGIC);
    let mut chunk = vec![0; 16];
    chunk.extend(u64::MAX.to_le_bytes());
    chunk.extend([0; 8]);
    chunk.extend(0_u64.to_le_bytes());
    file.write_all(&[6]).unwrap();
    file.extend((chunk.len() as u64).to_le_bytes());
    file.extend(chunk);
    let error = read(&file).unwrap_err();
    assert!(matches!(error.fault, ReadFault::TooLong { .. }), "{error}");
}

/// The head of the file, the metadata and the head of the first chunk, byte for byte.
#[test]
fn every_byte_of_the_heads_may_be_wrong() {
    let whole = file(&messages(12)[..5]);
    for at in 0..500 {
        for value in [0, 1, 0x7f, 0xff] {
            let mut damaged = whole.clone();
            damaged[at] = value;
            // Either is right; a panic is not.
            drop(read(&damaged));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]
    #[test]
    fn cut_and_flipped_files_end(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8), cut: prop::sample::Index) {
        let mut damaged = file(&messages(12)[..20]);
        for (at, value) in &flips {
            let at = at.index(damaged.len());
            damaged[at] = *value;
        }
        damaged.truncate(cut.index(damaged.len() + 1));
        // Either is right; a panic is not.
        drop(read(&damaged));
    }
}
