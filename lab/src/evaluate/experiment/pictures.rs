//! The textures of the experiments: generated posters and, where folders are given, photographs, in
//! three disjoint sets. A poster belongs to the set of its number modulo 3, a photograph to that of
//! its file's bytes (docs/EVALUATION.md): nobody chooses by eye.

use crate::evaluate::truth::Truth;
use anyhow::Context as _;
use cli::pictures;
use sim::{
    posters::poster,
    texture::{Edge, Texture},
};
use std::{
    path::{Path, PathBuf},
    sync::Arc,
};
use vision::{detect::pyramid, frame::GrayImage};

/// Largest number of pictures read from one folder.
const MAX_PHOTOGRAPHS: usize = 2000;
/// Photographs are reduced to about this many pixels a side: as fine as generated posters.
const SIDE_PX: usize = 640;
/// Numbers of posters of one seed: disjoint from the next seed's, and from the posters of tests and
/// demos.
const POSTERS_PER_SEED: u64 = 100_000;

/// One of the three sets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    Tune,
    Calibrate,
    Test,
}

impl Part {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Tune => "tune",
            Self::Calibrate => "calibrate",
            Self::Test => "test",
        }
    }

    fn number(self) -> u64 {
        self as u64
    }
}

pub(crate) fn part(text: &str) -> Result<Part, String> {
    let all = [Part::Tune, Part::Calibrate, Part::Test];
    all.into_iter().find(|p| p.name() == text).ok_or_else(|| "one of: tune, calibrate, test".to_owned())
}

/// A texture with its origin.
#[derive(Debug, Clone)]
pub(crate) struct Picture {
    pub(crate) name: String,
    pub(crate) texture: Arc<Texture>,
    pub(crate) photograph: bool,
}

/// Generated poster `index` of a set; other seeds, other posters.
pub(crate) fn generated(part: Part, seed: u64, index: usize) -> Picture {
    let number = seed.wrapping_add(1).wrapping_mul(POSTERS_PER_SEED).wrapping_add(index as u64);
    let number = number.wrapping_mul(3).wrapping_add(part.number());
    Picture { name: format!("poster {number}"), texture: Arc::new(poster(number)), photograph: false }
}

/// The photographs of a set from all folders, by name; of several of one landmark (`same`) only the
/// first.
pub(crate) fn photographs(folders: &[PathBuf], part: Part) -> anyhow::Result<Vec<Picture>> {
    let mut found = Vec::new();
    for folder in folders {
        for path in files(folder)? {
            let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
            if fnv(&bytes) % 3 != part.number() {
                continue;
            }
            let gray = pictures::read(&path).with_context(|| path.display().to_string())?;
            let name = path.strip_prefix(folder).unwrap_or(&path).display().to_string();
            found.push(Picture { name, texture: Arc::new(texture(&gray)), photograph: true });
        }
    }
    Ok(found)
}

/// `count` pictures: photographs for up to `share` of them, then generated posters.
pub(crate) fn mixed(
    photographs: &[Picture],
    share: f64,
    count: usize,
    poster: impl Fn(usize) -> Picture + Sync,
) -> Vec<Picture> {
    let taken = photographs.len().min((share * count as f64) as usize);
    let numbers: Vec<usize> = (0..count - taken).collect();
    let posters = super::of_each(&numbers, "drawing", |_, i| poster(*i));
    photographs[..taken].iter().cloned().chain(posters).collect()
}

/// Picture files of a folder; of one with a truth.json, those that are taught.
fn files(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut paths: Vec<PathBuf> = if folder.join("truth.json").is_file() {
        let truth = Truth::read(folder)?;
        let mut distinct: Vec<(PathBuf, String)> = Vec::new();
        for (path, name) in &truth.teach {
            if !distinct.iter().any(|(_, k)| truth.same_landmark(k, name)) {
                distinct.push((path.clone(), name.clone()));
            }
        }
        distinct.into_iter().map(|(path, _)| path).collect()
    } else {
        let entries =
            std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
        entries.filter_map(|e| e.ok().map(|e| e.path())).collect()
    };
    paths.retain(|path| pictures::is_picture(path));
    paths.sort();
    paths.truncate(MAX_PHOTOGRAPHS);
    anyhow::ensure!(!paths.is_empty(), "{} has no pictures", folder.display());
    Ok(paths)
}

fn texture(gray: &GrayImage) -> Texture {
    let small = pyramid::reduce(gray, pyramid::working_factor(gray, SIDE_PX));
    Texture::new(small.width(), small.height(), small.data().to_vec(), Edge::Clamp)
}

/// FNV-1a, 64 bits.
fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_disjoint_and_other_seeds_give_other_posters() {
        assert_eq!(fnv(b"foobar"), 0x8594_4171_f739_67e8); // from the authors' tables
        let number = |part, seed, index| -> u64 {
            let name = generated(part, seed, index).name;
            name.trim_start_matches("poster ").parse().unwrap()
        };
        for (i, name) in ["tune", "calibrate", "test"].into_iter().enumerate() {
            let part = part(name).unwrap();
            assert_eq!(number(part, 1, 0) % 3, i as u64);
            assert_ne!(number(part, 1, 0), number(part, 2, 0));
        }
        assert!(part("validate").is_err());
        assert_eq!(generated(Part::Test, u64::MAX, 7).texture, generated(Part::Test, u64::MAX, 7).texture);
    }
}
