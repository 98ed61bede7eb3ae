//! Any bytes as a bundle, by changes of a real one from a seed: at any place with the right seal,
//! and in one of its files with the right digests, so that changes reach what is behind both.
//! `WAYMARK_RUNS` says how many; the other stored bytes are fuzz targets.

use super::{super::unpack::unpack, *};
use crate::store::pictures::hex;
use sha2::{Digest as _, Sha256};
use std::io::Cursor;
use vision::random::Random;
use zip::ZipArchive;

const RUNS: u64 = 600;
/// In place of a number or a word.
const TOKENS: [&str; 12] =
    ["1e39", "1e309", "-1", "0", "NaN", "null", "9007199254740993", "[]", "{}", "\"\"", "true", "5e-324"];

/// Name and bytes of each file but the manifest.
fn files(bundle: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut zip = ZipArchive::new(Cursor::new(bundle)).unwrap();
    let mut all = Vec::new();
    for index in 0..zip.len() {
        let mut entry = zip.by_index(index).unwrap();
        let (name, mut bytes) = (entry.name().unwrap().into_owned(), Vec::new());
        entry.read_to_end(&mut bytes).unwrap();
        if name != "bundle.json" {
            all.push((name, bytes));
        }
    }
    all
}

fn below(random: &mut Random, n: usize) -> usize {
    (random.next_u64() % n.max(1) as u64) as usize
}

/// One to four bytes changed, taken out or put in.
fn damaged(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=below(random, 4) {
        let at = below(random, bytes.len());
        match below(random, 4) {
            0 if !bytes.is_empty() => bytes[at] ^= 1 << below(random, 8),
            1 if !bytes.is_empty() => bytes[at] = random.next_u64() as u8,
            2 if !bytes.is_empty() => drop(bytes.drain(at..(at + 1 + below(random, 40)).min(bytes.len()))),
            _ => bytes.insert(at, random.next_u64() as u8),
        }
    }
    bytes
}

/// A value of JSON replaced by another.
fn misstated(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let text = String::from_utf8_lossy(bytes).into_owned();
    let begins: Vec<usize> = text.match_indices([':', ',', '[']).map(|(at, _)| at + 1).collect();
    let Some(begin) = begins.get(below(random, begins.len())).copied() else { return damaged(bytes, random) };
    let rest = &text[begin..];
    let length = rest.find([',', ']', '}']).unwrap_or(rest.len());
    let token = TOKENS[below(random, TOKENS.len())];
    [&text[..begin], token, &rest[length..]].concat().into_bytes()
}

/// Any place changed; the seal is that of the changed bytes.
fn resealed(bundle: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = damaged(&bundle[..bundle.len() - 64], random);
    let seal = hex(&Sha256::digest(&bytes));
    bytes.extend(seal.as_bytes());
    bytes
}

/// One file changed; manifest and seal are those of the changed file.
fn rewritten(files: &[(String, Vec<u8>)], random: &mut Random) -> File {
    let (changed, is_value) = (below(random, files.len()), below(random, 4) > 0);
    let mut writer = Writer::new(tempfile::tempfile().unwrap());
    for (index, (name, bytes)) in files.iter().enumerate() {
        let is_json = name.contains("json");
        let bytes = match (index == changed, is_json && is_value) {
            (false, _) => bytes.clone(),
            (true, true) => misstated(bytes, random),
            (true, false) => damaged(bytes, random),
        };
        writer.add(name, &bytes).unwrap();
    }
    writer.finish("a").unwrap()
}

#[tokio::test]
async fn any_bytes_as_a_bundle_are_refused_or_read() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    filled_with_pictures(&store).await;
    let bundle = saved(&store, "a", dir.path()).await;
    let files = files(&bundle);
    let runs = std::env::var("WAYMARK_RUNS").ok().and_then(|text| text.parse().ok()).unwrap_or(RUNS);
    let (mut random, mut refused, mut inside) = (Random::new(14), 0, 0);
    let limits = Limits::default();
    for run in 0..runs {
        let given = match run % 4 {
            0 => file(&resealed(&bundle, &mut random)),
            _ => rewritten(&files, &mut random),
        };
        match unpack(given, &limits) {
            Ok(_) => {}
            Err(BundleError::Refused { fault, file, why }) => {
                assert!(!file.is_empty() && !why.is_empty(), "{fault:?}");
                refused += 1;
                inside += u64::from(matches!(fault, Fault::InvalidValue));
            }
            Err(other) => panic!("run {run}: {other}"),
        }
    }
    assert!(refused > runs / 2 && inside > runs / 10, "{refused} of {runs} refused, {inside} for a value");
}
