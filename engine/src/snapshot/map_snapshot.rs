//! What the workers read: one immutable version of one map.

use super::{look_alike_classes::LookAlikeClasses, stored_model::StoredModel};
use map::{
    guided::{AssociateParams, ExpectParams},
    landmark_health::{HealthParams, LandmarkHealth},
    laser_fix::{LaserFixParams, WallIndex},
    localise::LocaliseParams,
    modality_stats::ModalityMap,
    place::LandmarkPlace,
    relocalise::GridBeliefParams,
    segments::LaserSegment,
    visibility::{VisibilityMap, VisibilitySettings},
};
use std::{collections::BTreeMap, f64::consts::FRAC_PI_4, sync::Arc};
use vision::{
    learn::LearnRules,
    model::{LandmarkId, ModelSet},
    params::{Params, preset::Preset},
    pose::LandmarkSize,
    recognise::DistanceKind,
};

/// One version of one map.
#[derive(Debug, Clone)]
pub struct MapSnapshot {
    /// Name of the map.
    pub name: String,
    /// Counts up with every change of the map.
    pub version: u64,
    /// A draft of another map: people work on it, and robots never see it.
    pub is_draft: bool,
    /// Every landmark of the map by number, learnt or not.
    pub landmarks: BTreeMap<LandmarkId, LandmarkInfo>,
    /// The sizes of those of them that have one.
    pub sizes: BTreeMap<LandmarkId, LandmarkSize>,
    /// The models that are matched: the active ones of `learnt`.
    pub models: ModelSet,
    /// The landmarks that have look-alikes, with thresholds as if they had none.
    pub look_alikes: Arc<LookAlikeClasses>,
    /// Every learnt model that can be read and fits the parameters, inactive ones included.
    pub learnt: BTreeMap<LandmarkId, StoredModel>,
    /// Models that are stored but must not be used, and why: damaged, or learnt under other
    /// parameters.
    pub unusable_models: BTreeMap<LandmarkId, String>,
    /// The walls: laser segments (map frame, m), free side on the left.
    pub walls: Arc<Vec<LaserSegment>>,
    /// Counts up whenever the walls are replaced.
    pub walls_version: i64,
    /// Index of the walls, for scan matching; later versions share it until the walls change.
    pub wall_index: Arc<WallIndex>,
    /// Modality statistics of the reference runs, by pose cell.
    pub modalities: Arc<ModalityMap>,
    /// Number of reference runs that `modalities` rests on, and a digest of which ones.
    pub reference_runs: (i64, i64),
    /// The camera and the limits that define "visible".
    pub visibility_settings: VisibilitySettings,
    /// The visibility area of each placed landmark, without those that are still computed.
    pub visibility: BTreeMap<LandmarkId, Arc<VisibilityMap>>,
    /// What is still computed of this version: until then it is absent, never out of date.
    pub pending: Pending,
    /// Which distance decides.
    pub distance: DistanceKind,
    /// The parameters the models were learnt under, with the map's own distance.
    pub params: Arc<Params>,
    /// The parameters of what computes poses.
    pub poses: Arc<PoseParams>,
}

/// Parameters of what computes poses in a map.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PoseParams {
    /// Fixes by landmarks.
    pub localise: LocaliseParams,
    /// Landmarks against their places.
    pub health: HealthParams,
    /// Landmarks that a pose expects.
    pub expect: ExpectParams,
    /// Which of them a quad is.
    pub associate: AssociateParams,
    /// Relocalisation.
    pub grid_belief: GridBeliefParams,
    /// Scans in walls.
    pub laser_fix: LaserFixParams,
}

impl MapSnapshot {
    /// A map without content.
    pub fn empty(name: impl Into<String>, version: u64) -> Self {
        Self {
            name: name.into(),
            version,
            is_draft: false,
            landmarks: BTreeMap::new(),
            sizes: BTreeMap::new(),
            models: ModelSet::default(),
            look_alikes: Arc::default(),
            learnt: BTreeMap::new(),
            unusable_models: BTreeMap::new(),
            walls: Arc::default(),
            walls_version: 0,
            wall_index: Arc::new(WallIndex::new([])),
            modalities: Arc::default(),
            reference_runs: (0, 0),
            visibility_settings: VisibilitySettings::default(),
            visibility: BTreeMap::new(),
            pending: Pending::default(),
            distance: DistanceKind::Both,
            params: Arc::default(),
            poses: Arc::default(),
        }
    }

    /// The same map under another preset: its detector, its decision, its distance.
    #[must_use]
    pub fn under(&self, preset: Preset) -> Self {
        let params = Arc::new(preset.over(&self.params));
        Self { params, distance: preset.distance(), ..self.clone() }
    }

    /// Whether a landmark is level rather than upright: under a ceiling, or on a floor.
    pub fn has_level_landmarks(&self) -> bool {
        let mut places = self.landmarks.values().filter_map(|info| info.place.as_ref());
        places.any(|place| place.tilt_rad.abs() > FRAC_PI_4)
    }
}

/// Data derived from a version that is computed after the version is published.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Pending {
    /// Visibility areas of some landmarks.
    pub visibility: bool,
    /// The look-alike classes.
    pub look_alikes: bool,
}

impl Pending {
    /// Whether anything is still computed.
    pub fn any(self) -> bool {
        self.visibility || self.look_alikes
    }
}

/// What is known of a landmark besides its appearance.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LandmarkInfo {
    /// Readable name, unique in the map.
    pub name: String,
    /// Width and height, if measured; without it there is no pose.
    pub size: Option<LandmarkSize>,
    /// Its place, if that and its size are known; without it there is no robot pose.
    pub place: Option<LandmarkPlace>,
    /// How far its place is trusted: a quarantined landmark corrects no pose.
    pub health: LandmarkHealth,
    /// Revision of the stored row and time of its last edit, ms since the Unix epoch: an equal pair
    /// and an equal health mean an equal row.
    pub stored: (i64, i64),
    /// Its own weights and gates.
    pub rules: LearnRules,
}

impl LandmarkInfo {
    /// Whether it may correct poses.
    pub fn is_trusted(&self) -> bool {
        self.health != LandmarkHealth::Quarantined
    }
}
