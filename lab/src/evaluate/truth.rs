//! The evaluation format: a folder with `truth.json` and pictures (see docs/EVALUATION.md), read
//! and checked.

use super::reviewed::{Reviewed, ReviewedQuad};
use serde::Deserialize;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};
use vision::geometry::{Corners, CornersError};

/// Why a data set cannot be scored.
#[derive(Debug, thiserror::Error)]
pub(crate) enum TruthError {
    #[error("cannot read {path}")]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{path} is not in the evaluation format")]
    Parse { path: PathBuf, source: serde_json::Error },
    #[error("{path}: labels of {file}")]
    Corners { path: PathBuf, file: String, source: CornersError },
}

/// How much of a labelled quad is visible.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum QuadState {
    #[default]
    Full,
    Truncated,
    Occluded,
}

impl QuadState {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Truncated => "truncated",
            Self::Occluded => "occluded",
        }
    }
}

/// One labelled quad.
#[derive(Debug, Clone)]
pub(crate) struct TruthQuad {
    /// From the landmark's own top-left; any start corner if the set's notes say so.
    pub(crate) corners: Corners,
    /// `None`: a distractor.
    pub(crate) landmark: Option<String>,
    pub(crate) state: QuadState,
    /// Class of the object, if the set states it.
    pub(crate) class: Option<String>,
    /// A detector must find it; otherwise it is neither missed nor false.
    pub(crate) counted: bool,
    /// Between its normal and the direction to the camera, if the set states it.
    pub(crate) view_angle_rad: Option<f64>,
}

impl TruthQuad {
    /// Whether a detector must find it: it counts and is wholly in view.
    pub(crate) fn counts(&self) -> bool {
        self.counted && self.state == QuadState::Full
    }
}

/// One picture with its labels.
#[derive(Debug, Clone)]
pub(crate) struct TruthImage {
    pub(crate) path: PathBuf,
    pub(crate) file: String,
    pub(crate) stratum: String,
    pub(crate) quads: Vec<TruthQuad>,
    /// Other real quads, neither missed nor false.
    pub(crate) others: Vec<Corners>,
    /// No other real quad is in the picture.
    pub(crate) quads_complete: bool,
    /// A crop: one landmark fills the whole picture.
    pub(crate) whole_image: bool,
    /// Quads that are known to be false.
    pub(crate) false_quads: Vec<Corners>,
}

/// A data set.
#[derive(Debug, Clone)]
pub(crate) struct Truth {
    pub(crate) name: String,
    pub(crate) images: Vec<TruthImage>,
    /// Pictures to teach from: file and landmark; the whole picture is the landmark.
    pub(crate) teach: Vec<(PathBuf, String)>,
    same: BTreeMap<String, String>,
}

impl Truth {
    /// Reads `folder/truth.json`.
    pub(crate) fn read(folder: &Path) -> Result<Self, TruthError> {
        let path = folder.join("truth.json");
        let text = std::fs::read(&path).map_err(|source| TruthError::Read { path: path.clone(), source })?;
        let raw: RawTruth = serde_json::from_slice(&text)
            .map_err(|source| TruthError::Parse { path: path.clone(), source })?;
        let images =
            raw.images.into_iter().map(|image| image.checked(folder, &path)).collect::<Result<_, _>>()?;
        // One picture under several names: each name stands for the least of its group.
        let mut same = BTreeMap::new();
        for group in raw.same {
            let Some(least) = group.iter().min().cloned() else { continue };
            for name in group {
                same.insert(name, least.clone());
            }
        }
        let teach = raw.teach.into_iter().map(|t| (folder.join(t.file), t.landmark)).collect();
        Ok(Self { name: raw.name, images, teach, same })
    }

    /// The same with the quads of a reviewed list.
    pub(crate) fn with_reviewed(mut self, list: &Reviewed) -> Self {
        for image in &mut self.images {
            for quad in list.quads(&image.file) {
                if quad.real { &mut image.others } else { &mut image.false_quads }.push(quad.corners);
            }
        }
        self
    }

    /// The pictures of a reviewed list in `folder`, with its quads alone.
    pub(crate) fn of_reviewed(name: &str, folder: &Path, list: &Reviewed) -> Self {
        let image = |(file, quads): (&str, &[ReviewedQuad])| {
            let of = |real: bool| quads.iter().filter(move |t| t.real == real).map(|t| t.corners);
            let quad = |corners: Corners| TruthQuad {
                corners,
                landmark: None,
                state: QuadState::Full,
                class: None,
                counted: false,
                view_angle_rad: None,
            };
            TruthImage {
                path: folder.join(file),
                file: file.to_owned(),
                stratum: "all".to_owned(),
                quads: of(true).map(quad).collect(),
                others: vec![],
                quads_complete: false,
                whole_image: false,
                false_quads: of(false).collect(),
            }
        };
        let images = list.pictures().map(image).collect();
        Self { name: name.to_owned(), images, teach: vec![], same: BTreeMap::new() }
    }

    /// Whether two names mean the same picture.
    pub(crate) fn same_landmark(&self, a: &str, b: &str) -> bool {
        let canonical = |name: &str| self.same.get(name).map_or(name.to_owned(), Clone::clone);
        canonical(a) == canonical(b)
    }
}

#[derive(Deserialize)]
struct RawTruth {
    name: String,
    #[serde(default)]
    teach: Vec<RawTeach>,
    #[serde(default)]
    same: Vec<Vec<String>>,
    images: Vec<RawImage>,
}

#[derive(Deserialize)]
struct RawTeach {
    file: String,
    landmark: String,
}

#[derive(Deserialize)]
struct RawImage {
    file: String,
    #[serde(default)]
    stratum: String,
    #[serde(default)]
    quads: Vec<RawQuad>,
    #[serde(default)]
    others: Vec<[[f64; 2]; 4]>,
    #[serde(default)]
    quads_complete: bool,
    #[serde(default)]
    whole_image: bool,
}

#[derive(Deserialize)]
struct RawQuad {
    corners: [[f64; 2]; 4],
    landmark: Option<String>,
    #[serde(default)]
    state: QuadState,
    kind: Option<String>,
    view_angle_rad: Option<f64>,
    #[serde(default = "yes")]
    counted: bool,
}

fn yes() -> bool {
    true
}

impl RawImage {
    fn checked(self, folder: &Path, path: &Path) -> Result<TruthImage, TruthError> {
        let checked = |corners: [[f64; 2]; 4]| {
            Corners::try_from(corners).map_err(|source| TruthError::Corners {
                path: path.to_owned(),
                file: self.file.clone(),
                source,
            })
        };
        let mut quads = Vec::with_capacity(self.quads.len());
        for quad in self.quads {
            let corners = checked(quad.corners)?;
            let RawQuad { landmark, state, kind, counted, view_angle_rad, .. } = quad;
            quads.push(TruthQuad { corners, landmark, state, class: kind, counted, view_angle_rad });
        }
        let others = self.others.into_iter().map(checked).collect::<Result<_, _>>()?;
        Ok(TruthImage {
            path: folder.join(&self.file),
            file: self.file,
            stratum: if self.stratum.is_empty() { "all".to_owned() } else { self.stratum },
            quads,
            others,
            quads_complete: self.quads_complete,
            whole_image: self.whole_image,
            false_quads: vec![],
        })
    }
}
