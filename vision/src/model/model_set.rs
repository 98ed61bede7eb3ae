//! The landmarks that one version of a map recognises: immutable, in the order of their ids, all
//! learnt under the parameters in use. The caller chooses which models are good enough.

use crate::{
    model::{landmark_id::LandmarkId, landmark_model::LandmarkModel},
    params::Params,
    points::{index::PointIndex, taught::TaughtPoint},
    recognise::{
        alignment::aligner::SamplingGrids,
        features::signature::{SIGNATURE_BYTES, Signature, likeness},
    },
};
use fearless_simd::{Level, dispatch};
use std::{collections::BTreeMap, sync::Arc};

/// Most landmarks of one set.
pub const MAX_LANDMARKS: usize = 100_000;

/// Why models do not make a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ModelSetError {
    /// Trained under other parameters: its thresholds are invalid here.
    #[error("landmark {} was learnt under parameters {found:016x}, in use are {expected:016x}", id.0)]
    ForeignParams {
        /// The landmark.
        id: LandmarkId,
        /// Hash of the model.
        found: u64,
        /// Hash of the parameters in use.
        expected: u64,
    },
    /// Two models of one landmark.
    #[error("landmark {} has two models", id.0)]
    Duplicate {
        /// The landmark.
        id: LandmarkId,
    },
    /// More than [`MAX_LANDMARKS`].
    #[error("{count} landmarks, at most {MAX_LANDMARKS} are possible")]
    TooMany {
        /// Models given.
        count: usize,
    },
}

/// Models by rising id.
#[derive(Debug, Clone, Default)]
pub struct ModelSet {
    models: Vec<Arc<LandmarkModel>>,
    /// Not recognised; see [`ModelSet::with_rivals`].
    rivals: Vec<Arc<LandmarkModel>>,
    params_hash: u64,
    /// Signatures of all exemplars, contiguous: the scan reads memory once.
    signatures: Vec<[i8; SIGNATURE_BYTES]>,
    /// Owner of each signature: index of the model and of its exemplar.
    owners: Vec<(u32, u8)>,
    /// Sampling grids for alignment with the exemplars.
    lattices: Arc<SamplingGrids>,
    /// The points of all models, then of all rivals.
    points: Arc<PointIndex>,
}

/// Longest short list.
pub const MAX_SHORT_LIST: usize = 64;

/// An entry of the short list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Listed {
    /// Index of the model in [`ModelSet::iter`].
    pub model: usize,
    /// Index of the most similar exemplar.
    pub exemplar: usize,
    /// Likeness of the signatures, -1 to 1.
    pub likeness: f32,
}

impl ModelSet {
    /// Checks and orders `models`, to be used with the parameters `p`.
    pub fn new(models: Vec<Arc<LandmarkModel>>, p: &Params) -> Result<Self, ModelSetError> {
        Self::with_rivals(models, Vec::new(), p)
    }

    /// Of `all` landmarks those in use; as rivals those that are not, because a distance does not
    /// separate them from others.
    pub fn in_use(all: impl Iterator<Item = Arc<LandmarkModel>>, p: &Params) -> Result<Self, ModelSetError> {
        let (active, others): (Vec<_>, Vec<_>) = all.partition(|m| m.is_active());
        let rivals = others.into_iter().filter(|m| m.overlaps_others()).collect();
        Self::with_rivals(active, rivals, p)
    }

    /// `models` beside `rivals`: landmarks of the map that are not recognised, because others look
    /// like them, but that may be visible. Where the points of a rival agree, too, no landmark is
    /// identified.
    pub fn with_rivals(
        mut models: Vec<Arc<LandmarkModel>>,
        mut rivals: Vec<Arc<LandmarkModel>>,
        p: &Params,
    ) -> Result<Self, ModelSetError> {
        let count = models.len() + rivals.len();
        if count > MAX_LANDMARKS {
            return Err(ModelSetError::TooMany { count });
        }
        let expected = p.distance_hash();
        if let Some(m) = models.iter().chain(&rivals).find(|m| m.params_hash != expected) {
            return Err(ModelSetError::ForeignParams { id: m.id, found: m.params_hash, expected });
        }
        models.sort_by_key(|m| m.id);
        rivals.sort_by_key(|m| m.id);
        let mut ids: Vec<LandmarkId> = models.iter().chain(&rivals).map(|m| m.id).collect();
        ids.sort_unstable();
        if let Some(pair) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(ModelSetError::Duplicate { id: pair[0] });
        }
        let exemplars = || {
            models.iter().enumerate().flat_map(|(m, model)| {
                model.exemplars.iter().enumerate().map(move |(e, exemplar)| (m, e, exemplar))
            })
        };
        let signatures = exemplars().map(|(_, _, exemplar)| *exemplar.signature.values()).collect();
        let owners = exemplars().map(|(m, e, _)| (m as u32, e as u8)).collect();
        let lattices = Arc::new(SamplingGrids::new(p.icon.size, &p.recognise.correlation));
        let all: Vec<&[TaughtPoint]> = models.iter().chain(&rivals).map(|m| m.points.as_slice()).collect();
        let points = Arc::new(PointIndex::new(all.into_iter()));
        Ok(Self { models, rivals, params_hash: expected, signatures, owners, lattices, points })
    }

    /// A set with the model of `id` alone.
    pub fn only(&self, id: LandmarkId) -> Option<Self> {
        let model = self.get(id)?.clone();
        let signatures: Vec<_> = model.exemplars.iter().map(|e| *e.signature.values()).collect();
        let owners = (0..signatures.len()).map(|e| (0, e as u8)).collect();
        let points = Arc::new(PointIndex::new(std::iter::once(model.points.as_slice())));
        let lattices = self.lattices.clone();
        Some(Self {
            models: vec![model],
            rivals: Vec::new(),
            params_hash: self.params_hash,
            signatures,
            owners,
            lattices,
            points,
        })
    }

    /// Number of landmarks (N).
    pub fn len(&self) -> usize {
        self.models.len()
    }

    /// No landmark at all.
    pub fn is_empty(&self) -> bool {
        self.models.is_empty()
    }

    /// The model of `id`.
    pub fn get(&self, id: LandmarkId) -> Option<&Arc<LandmarkModel>> {
        self.models.binary_search_by_key(&id, |m| m.id).ok().map(|i| &self.models[i])
    }

    /// Every model, by rising id.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Arc<LandmarkModel>> {
        self.models.iter()
    }

    /// The `count` models whose exemplars are most like `signature`, best first; of equal ones the
    /// lower id. At most [`MAX_SHORT_LIST`].
    pub fn short_list(&self, signature: &Signature, count: usize) -> Vec<Listed> {
        dispatch!(Level::new(), _s => self.scan(signature, count))
    }

    #[expect(
        clippy::inline_always,
        reason = "an instruction set holds only in what is inlined where it was chosen"
    )]
    #[inline(always)]
    fn scan(&self, signature: &Signature, count: usize) -> Vec<Listed> {
        let count = count.min(MAX_SHORT_LIST);
        let mut best: Vec<Listed> = Vec::with_capacity(count + 1);
        let mut enough = f32::NEG_INFINITY;
        for (values, (model, exemplar)) in self.signatures.iter().zip(&self.owners) {
            let likeness = likeness(values, signature.values());
            if likeness <= enough {
                continue;
            }
            let (model, exemplar) = (*model as usize, usize::from(*exemplar));
            // Exemplars of one model follow each other.
            if let Some(at) = best.iter().position(|l| l.model == model) {
                if best[at].likeness >= likeness {
                    continue;
                }
                best.remove(at);
            }
            let at = best.partition_point(|l| l.likeness >= likeness);
            best.insert(at, Listed { model, exemplar, likeness });
            best.truncate(count);
            enough =
                if best.len() == count { best.last().map_or(f32::INFINITY, |l| l.likeness) } else { enough };
        }
        best
    }

    /// The model at `index` of [`ModelSet::iter`].
    pub fn at(&self, index: usize) -> Option<&Arc<LandmarkModel>> {
        self.models.get(index)
    }

    /// The landmark at `index` of [`Self::points`]: a model, or from [`Self::len`] on a rival.
    pub(crate) fn at_point_index(&self, index: usize) -> Option<&Arc<LandmarkModel>> {
        self.models.get(index).or_else(|| self.rivals.get(index - self.models.len()))
    }

    /// The points of all models, by their index, then of all rivals.
    pub fn points(&self) -> &PointIndex {
        &self.points
    }

    /// Sampling grids for alignment.
    pub(crate) fn lattices(&self) -> &SamplingGrids {
        &self.lattices
    }

    /// Memory that the set and its models take, in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.memory_parts().values().sum()
    }

    /// The same by purpose.
    pub fn memory_parts(&self) -> BTreeMap<&'static str, usize> {
        let mut parts: BTreeMap<&'static str, usize> = BTreeMap::new();
        for model in self.models.iter().chain(&self.rivals) {
            for (part, bytes) in model.memory_parts() {
                *parts.entry(part).or_default() += bytes;
            }
        }
        let signatures = self.signatures.len() * SIGNATURE_BYTES;
        let other =
            self.owners.len() * size_of::<(u32, u8)>() + self.models.len() * size_of::<Arc<LandmarkModel>>();
        for (part, bytes) in
            [("signatures", signatures), ("point index", self.points.memory_bytes()), ("other", other)]
        {
            *parts.entry(part).or_default() += bytes;
        }
        parts
    }

    /// [`Params::distance_hash`] of the parameters that the set is for; 0 for a set made by
    /// `default()`.
    pub fn params_hash(&self) -> u64 {
        self.params_hash
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        model::{
            landmark_model::{Gate, GateFailure, ModelStatus},
            threshold::ThresholdError,
        },
        recognise::fixture::trained_models,
    };

    #[test]
    fn the_short_list_equals_a_full_comparison() {
        let p = Params::default();
        let set = ModelSet::new(trained_models(6, &p), &p).unwrap();
        for asked in set.iter().flat_map(|m| m.exemplars.iter()) {
            // Oracle: every exemplar of every model, sorted.
            let mut all: Vec<(f32, usize)> = set
                .iter()
                .enumerate()
                .map(|(i, m)| {
                    let each = m.exemplars.iter();
                    let each = each.map(|e| likeness(e.signature.values(), asked.signature.values()));
                    (each.fold(-2.0, f32::max), i)
                })
                .collect();
            all.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            for count in [0, 1, 3, 6, 9] {
                let listed = set.short_list(&asked.signature, count);
                let found: Vec<(f32, usize)> = listed.iter().map(|l| (l.likeness, l.model)).collect();
                assert_eq!(found, all[..count.min(6)]);
                for l in listed {
                    let exemplar = &set.at(l.model).unwrap().exemplars[l.exemplar];
                    let again = likeness(exemplar.signature.values(), asked.signature.values());
                    assert!((again - l.likeness).abs() < 1e-9);
                }
            }
        }
        assert!(ModelSet::default().short_list(&set.at(0).unwrap().exemplars[0].signature, 3).is_empty());
    }

    #[test]
    fn the_short_list_is_bounded() {
        let p = Params::default();
        let one = Arc::clone(&trained_models(1, &p)[0]);
        let many = |count: u64| {
            let named = |id| Arc::new(LandmarkModel { id: LandmarkId(id), ..(*one).clone() });
            ModelSet::new((0..count).map(named).collect(), &p).unwrap()
        };
        let asked = &one.exemplars[0].signature;
        for (landmarks, listed) in [(MAX_SHORT_LIST, MAX_SHORT_LIST), (MAX_SHORT_LIST + 1, MAX_SHORT_LIST)] {
            assert_eq!(many(landmarks as u64).short_list(asked, usize::MAX).len(), listed);
        }
    }

    #[test]
    fn sets_are_checked_and_ordered() {
        let p = Params::default();
        let mut models = trained_models(3, &p);
        let ids = |set: &ModelSet| set.iter().map(|m| m.id.0).collect::<Vec<_>>();
        models.reverse();
        let set = ModelSet::new(models.clone(), &p).unwrap();
        assert_eq!((ids(&set), set.len(), set.params_hash()), (vec![1, 2, 3], 3, p.distance_hash()));
        assert_eq!(set.get(LandmarkId(2)).unwrap().id, LandmarkId(2));
        assert!(set.get(LandmarkId(4)).is_none());

        let mut foreign = (*models[0]).clone();
        foreign.params_hash ^= 1;
        let mixed = vec![Arc::clone(&models[1]), Arc::new(foreign)];
        assert!(matches!(
            ModelSet::new(mixed, &p),
            Err(ModelSetError::ForeignParams { id: LandmarkId(3), .. })
        ));
        let twice = ModelSet::new(vec![Arc::clone(&models[1]); 2], &p);
        assert_eq!(twice.unwrap_err(), ModelSetError::Duplicate { id: LandmarkId(2) });
        let [a, b, c] = [0, 1, 2].map(|i| Arc::clone(&models[i]));
        let mut inactive = (*b).clone();
        let fails = |gate| GateFailure { gate, value: 0.0, limit: 0.0 };
        let rivals = |inactive: &LandmarkModel| {
            let all = [a.clone(), Arc::new(inactive.clone())];
            ModelSet::in_use(all.into_iter(), &p).unwrap().rivals.len()
        };
        inactive.status = ModelStatus::Candidate(vec![fails(Gate::Saliency)]);
        assert_eq!(rivals(&inactive), 0, "no look-alikes");
        let overlap = fails(Gate::LikenessThreshold(ThresholdError::Overlap));
        inactive.status = ModelStatus::Candidate(vec![fails(Gate::Saliency), overlap]);
        assert_eq!(rivals(&inactive), 1);
        let with_rival = ModelSet::with_rivals(vec![a], vec![b.clone()], &p).unwrap();
        assert_eq!((ids(&with_rival), with_rival.len()), (vec![3], 1), "a rival is not in use");
        let both = ModelSet::with_rivals(vec![b.clone(), c], vec![b], &p);
        assert_eq!(both.unwrap_err(), ModelSetError::Duplicate { id: LandmarkId(2) });
        let at_limit = ModelSet::new(vec![Arc::clone(&models[1]); MAX_LANDMARKS], &p);
        assert!(matches!(at_limit, Err(ModelSetError::Duplicate { .. })));
        let beyond = ModelSet::new(vec![Arc::clone(&models[1]); MAX_LANDMARKS + 1], &p);
        assert_eq!(beyond.unwrap_err(), ModelSetError::TooMany { count: MAX_LANDMARKS + 1 });
    }
}
