//! Parameters from icon to verdict.

use crate::recognise::{
    alignment::align_params::AlignParams,
    features::{
        correlation::CorrelationParams, descriptor::DescriptorParams, harris::HarrisParams,
        hausdorff::HausdorffParams,
    },
};
use serde::{Deserialize, Serialize};

/// Parameters of points, descriptors, distances and the decision.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecogniseParams {
    /// Harris points.
    pub harris: HarrisParams,
    /// The 7-component descriptor.
    pub descriptor: DescriptorParams,
    /// C^r.
    pub correlation: CorrelationParams,
    /// H^r.
    pub hausdorff: HausdorffParams,
    /// The decision.
    pub verdict: VerdictParams,
    /// Landmarks without a border.
    pub texture: TextureParams,
}

/// The search for landmarks that a frame shows without a border
/// (`docs/method/25-recognition-by-points.md`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TextureParams {
    /// Whether the points of the whole frame vote for landmarks, where the map's distance is `both`
    /// and points decide. It also names the same picture in another frame.
    pub search: bool,
    /// Only while fewer quads than this have a name, or where up is not known: two names support a
    /// robot's pose, which needs the mounting of its camera.
    pub enough: usize,
}

impl Default for TextureParams {
    fn default() -> Self {
        Self { search: false, enough: 2 }
    }
}

/// Parameters of the decision.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VerdictParams {
    /// The nearest landmark is the answer only while its ratio is below this share of the
    /// runner-up's (method 10: 0.7).
    pub margin: f64,
    /// Candidates below this ratio are verified by alignment; 0 turns verification off.
    pub verify_reach: f64,
    /// After alignment a distance is accepted below this share of tau, because alignment favours
    /// the template.
    pub verified_share: f64,
    /// Length of the short list; the picture is aligned with each.
    pub short_list: usize,
    /// Smallest likeness of a signature on the short list, -1 to 1.
    pub min_signature: f32,
    /// Largest difference of that likeness to the first one's.
    pub signature_gap: f32,
    /// Number of landmarks up to which tau of the likeness is used unchanged.
    pub crowd: usize,
    /// Beyond it tau shrinks by this share with every factor of e: the more landmarks, the nearer
    /// the nearest one is to any distractor. On 732 quads of other buildings among 267 landmarks,
    /// the number of distractors below a ratio grows by e with 0.08 of ratio.
    pub crowd_share: f64,
    /// A landmark whose likeness uses more than this share of its tau...
    pub doubtful_share: f64,
    /// ... is refused where more than this share of the buckets contradicts, 0 to 1.
    pub max_contradicting: f64,
    /// Beyond the frame the picture must be at least this much like the learnt one, -1 to 1...
    pub min_content_likeness: f64,
    /// ... in at least this many buckets. A landmark with less content is not used.
    pub min_content: f64,
    /// From this likeness beyond the frame on...
    pub sure_content_likeness: f64,
    /// ... in this many buckets, neither of the paper's distances is required: saturation changes
    /// them strongly.
    pub sure_content: f64,
    /// Landmarks that are verified at most.
    pub max_verified: usize,
    /// Whether points decide before the icons (`both`); quads without point evidence are left to
    /// the icons. See `docs/method/25-recognition-by-points.md`.
    pub points: bool,
    /// Landmarks with more points than this are never accepted by their icons alone. One with
    /// fewer, whose icon agrees, is ambiguous, with
    /// [`Plain`](crate::recognise::decision::result::MatchRefusal::Plain): the robot's pose may
    /// identify it.
    pub max_icon_points: usize,
    /// Parameters of the alignment.
    pub align: AlignParams,
}

impl Default for VerdictParams {
    fn default() -> Self {
        Self {
            margin: 0.7,
            verify_reach: 1.5,
            verified_share: 0.8,
            short_list: 8,
            min_signature: 0.3,
            signature_gap: 0.35,
            crowd: 300,
            crowd_share: 0.08,
            doubtful_share: 0.85,
            max_contradicting: 0.12,
            min_content_likeness: 0.45,
            min_content: 1.5,
            sure_content_likeness: 0.6,
            sure_content: 4.0,
            max_verified: 2,
            points: true,
            max_icon_points: 40,
            align: AlignParams::default(),
        }
    }
}

/// Smallest share of tau, in the largest maps.
pub(crate) const LEAST_TAU_SHARE: f64 = 0.5;

impl VerdictParams {
    /// The share of tau of the likeness that holds among `landmarks`: as many distractors are
    /// accepted by a large map as by one of `crowd` landmarks.
    pub fn tau_share(&self, landmarks: usize) -> f64 {
        let crowds = landmarks.max(1) as f64 / self.crowd.max(1) as f64;
        (1.0 - self.crowd_share * crowds.ln().max(0.0)).clamp(LEAST_TAU_SHARE, 1.0)
    }
}
