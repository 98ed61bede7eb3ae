//! A model as bytes, and back. Little-endian, versioned, with a digest at the end. Bytes stored
//! under other parameters, by a later version or damaged are refused with a typed error. Features
//! derived from the icons (Harris points, buckets) are not stored.

use crate::{
    icon::{Icon, MAX_ICON_SIZE},
    learn::threshold_fit::add_negatives,
    model::{
        components::Components,
        exemplar::Exemplar,
        landmark_id::LandmarkId,
        landmark_model::{DistanceSamples, LandmarkModel, MAX_EXEMPLARS, MAX_VIEWS, ModelStatus},
        seen_from::SeenFrom,
        threshold::Threshold,
    },
    params::Params,
    points::taught::{MAX_LANDMARK_POINTS, POINT_BYTES, TaughtPoint},
};
use std::ops::Range;

/// Largest stored model, in bytes.
const MAX_BYTES: usize = MAX_EXEMPLARS * MAX_ICON_SIZE * MAX_ICON_SIZE
    + MAX_LANDMARK_POINTS * POINT_BYTES
    + Components::MAX_BYTES
    + 8 * 1024;
const MAGIC: [u8; 4] = *b"WMLM";
const VERSION: u16 = 5;
const DIGEST_BYTES: usize = 8;
/// Where the landmark's number is, in every format: after the magic, the version and the hash of
/// the parameters.
const ID_AT: Range<usize> = 14..22;

/// Why bytes are not a usable model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum StoredModelError {
    /// Too long, too short, or not beginning like a model.
    #[error("not a stored landmark model")]
    NotAModel,
    /// Written in a format this version does not read.
    #[error("stored in format {found}, this version reads {VERSION}")]
    Version {
        /// The format found.
        found: u16,
    },
    /// The digest does not match: the bytes were damaged.
    #[error("stored model is damaged")]
    Damaged,
    /// Trained under other parameters: its thresholds are invalid here.
    #[error("learnt under parameters {found:016x}, in use are {expected:016x}")]
    Params {
        /// Hash stored with the model.
        found: u64,
        /// Hash in use.
        expected: u64,
    },
    /// A field is out of its range.
    #[error("stored model: field {field} is malformed")]
    Malformed {
        /// Name of the field.
        field: &'static str,
    },
}

impl LandmarkModel {
    /// The model as bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(24 * 1024);
        out.extend(MAGIC);
        out.extend(VERSION.to_le_bytes());
        out.extend(self.params_hash.to_le_bytes());
        out.extend(self.id.0.to_le_bytes());
        for count in [self.views, self.generated_views, self.stable_points] {
            out.extend((count as u32).to_le_bytes());
        }
        for number in [self.total_variance, self.saliency_f, self.saliency, self.v_c, self.photographed_v_c] {
            out.extend(number.to_le_bytes());
        }
        out.push(SIDES.iter().position(|side| *side == self.seen_from).unwrap_or_default() as u8);
        out.push(self.eigenvalues.len() as u8);
        out.extend(self.eigenvalues.iter().flat_map(|value| value.to_le_bytes()));
        for evidence in [&self.correlation_evidence, &self.hausdorff_evidence, &self.likeness_evidence] {
            out.extend((evidence.others as u64).to_le_bytes());
            for distances in [&evidence.own, &evidence.nearest_others] {
                out.push(distances.len() as u8);
                out.extend(distances.iter().flat_map(|d| d.to_le_bytes()));
            }
        }
        out.push(self.exemplars.len() as u8);
        for exemplar in &self.exemplars {
            out.extend((exemplar.size() as u16).to_le_bytes());
            out.extend(exemplar.source_scale().to_le_bytes());
            out.extend(exemplar.pixels());
        }
        out.extend((self.points.len() as u16).to_le_bytes());
        self.points.iter().for_each(|p| p.write(&mut out));
        self.components.write(&mut out);
        out.extend(digest(&out).to_le_bytes());
        out
    }

    /// Reads a model stored by [`LandmarkModel::to_bytes`] under the same parameters. Thresholds
    /// and status follow from the stored evidence, under the rules (weights, caps, gates) of `p`.
    pub fn from_bytes(bytes: &[u8], p: &Params) -> Result<Self, StoredModelError> {
        if bytes.len() > MAX_BYTES || bytes.len() < MAGIC.len() + DIGEST_BYTES || !bytes.starts_with(&MAGIC) {
            return Err(StoredModelError::NotAModel);
        }
        let (content, stored_digest) = bytes.split_at(bytes.len() - DIGEST_BYTES);
        let mut reader = Reader { rest: &content[MAGIC.len()..] };
        let found = u16::from_le_bytes(reader.take("version")?);
        if found != VERSION {
            return Err(StoredModelError::Version { found });
        }
        if stored_digest != digest(content).to_le_bytes() {
            return Err(StoredModelError::Damaged);
        }
        let components;
        (reader.rest, components) = split_components(reader.rest)?;
        let (found, expected) = (u64::from_le_bytes(reader.take("params_hash")?), p.distance_hash());
        if found != expected {
            return Err(StoredModelError::Params { found, expected });
        }
        let mut model = reader.model(expected, p)?;
        model.components = components;
        model.points = reader.points()?;
        if !reader.rest.is_empty() {
            return Err(StoredModelError::Malformed { field: "length" });
        }
        Ok(add_negatives(&model, &[], p))
    }
}

fn split_components(content: &[u8]) -> Result<(&[u8], Components), StoredModelError> {
    Components::split(content).ok_or(StoredModelError::Malformed { field: "components" })
}

/// The components in the bytes of a model of whatever parameters.
pub fn components(bytes: &[u8]) -> Result<Components, StoredModelError> {
    Ok(split_components(whole_content(bytes)?)?.1)
}

/// Bytes of the model of a landmark as those of the same model of another one, of whatever
/// parameters. Done twice, with the first number the second time, it gives the first bytes.
pub fn renumbered(bytes: &[u8], id: LandmarkId) -> Result<Vec<u8>, StoredModelError> {
    let mut made = whole_content(bytes)?.to_vec();
    made[ID_AT].copy_from_slice(&id.0.to_le_bytes());
    made.extend(digest(&made).to_le_bytes());
    Ok(made)
}

/// What is before the digest of a model of this format, up to the number of its landmark at least.
fn whole_content(bytes: &[u8]) -> Result<&[u8], StoredModelError> {
    if bytes.len() > MAX_BYTES || bytes.len() < ID_AT.end + DIGEST_BYTES || !bytes.starts_with(&MAGIC) {
        return Err(StoredModelError::NotAModel);
    }
    let (content, stored_digest) = bytes.split_at(bytes.len() - DIGEST_BYTES);
    if stored_digest != digest(content).to_le_bytes() {
        return Err(StoredModelError::Damaged);
    }
    let found = u16::from_le_bytes([bytes[MAGIC.len()], bytes[MAGIC.len() + 1]]);
    if found != VERSION {
        return Err(StoredModelError::Version { found });
    }
    Ok(content)
}

/// Sides by their byte.
const SIDES: [SeenFrom; 3] = [SeenFrom::Front, SeenFrom::Left, SeenFrom::Right];

/// Reads bytes in order; every read is checked.
struct Reader<'a> {
    rest: &'a [u8],
}

impl Reader<'_> {
    fn model(&mut self, params_hash: u64, p: &Params) -> Result<LandmarkModel, StoredModelError> {
        let id = LandmarkId(u64::from_le_bytes(self.take("id")?));
        let views = self.count("views", MAX_VIEWS)?;
        let generated_views = self.count("generated_views", views)?;
        let stable_points = self.count("stable_points", usize::from(u16::MAX))?;
        let total_variance = self.number("total_variance")?;
        let saliency_f = self.number("saliency_f")?;
        let saliency = self.number("saliency")?;
        let (v_c, photographed_v_c) = (self.number("v_c")?, self.number("photographed_v_c")?);
        let seen_from = SIDES[self.byte("seen_from", SIDES.len() - 1)?];
        let eigenvalues = (0..self.byte("eigenvalues", crate::learn::pca::MODES)?)
            .map(|_| self.number("eigenvalues"))
            .collect::<Result<_, _>>()?;
        let (correlation_evidence, hausdorff_evidence) = (self.evidence()?, self.evidence()?);
        let likeness_evidence = self.evidence()?;
        let n = self.byte("exemplars", MAX_EXEMPLARS)?;
        let icons = (0..n).map(|_| self.icon(p)).collect::<Result<Vec<_>, _>>()?;
        if icons.is_empty() {
            return Err(StoredModelError::Malformed { field: "exemplars" });
        }
        Ok(LandmarkModel {
            id,
            params_hash,
            views,
            generated_views,
            exemplars: icons.iter().map(Exemplar::new).collect(),
            eigenvalues,
            total_variance,
            correlation: Threshold::NEVER,
            hausdorff: Threshold::NEVER,
            likeness: Threshold::NEVER,
            correlation_evidence,
            hausdorff_evidence,
            likeness_evidence,
            saliency_f,
            stable_points,
            saliency,
            v_c,
            photographed_v_c,
            seen_from,
            components: Components::default(),
            status: ModelStatus::Candidate(vec![]),
            waived: vec![],
            points: vec![],
        })
    }

    fn points(&mut self) -> Result<Vec<TaughtPoint>, StoredModelError> {
        let count = usize::from(u16::from_le_bytes(self.take("points")?));
        if count > MAX_LANDMARK_POINTS {
            return Err(StoredModelError::Malformed { field: "points" });
        }
        (0..count).map(|_| self.take("points").map(|b| TaughtPoint::read(&b))).collect()
    }

    fn evidence(&mut self) -> Result<DistanceSamples, StoredModelError> {
        const MAX_OTHERS: u64 = 10_000_000;
        let others = u64::from_le_bytes(self.take("others")?);
        let own = self.distances("own", MAX_VIEWS)?;
        let nearest_others = self.distances("nearest_others", DistanceSamples::MAX_NEAREST)?;
        let stored = nearest_others.len() as u64;
        if others > MAX_OTHERS || stored != others.min(DistanceSamples::MAX_NEAREST as u64) {
            return Err(StoredModelError::Malformed { field: "others" });
        }
        Ok(DistanceSamples { own, nearest_others, others: others as usize })
    }

    fn distances(&mut self, field: &'static str, most: usize) -> Result<Vec<f32>, StoredModelError> {
        let n = self.byte(field, most)?;
        let distances =
            (0..n).map(|_| self.take(field).map(f32::from_le_bytes)).collect::<Result<Vec<_>, _>>()?;
        let valid = distances.iter().all(|d| *d >= 0.0) && distances.is_sorted();
        if valid { Ok(distances) } else { Err(StoredModelError::Malformed { field }) }
    }

    fn icon(&mut self, p: &Params) -> Result<Icon, StoredModelError> {
        let malformed = StoredModelError::Malformed { field: "icon" };
        let size = usize::from(u16::from_le_bytes(self.take("icon")?));
        let source_scale = f64::from_le_bytes(self.take("icon")?);
        if size != p.icon.size || self.rest.len() < size * size {
            return Err(malformed);
        }
        let (pixels, rest) = self.rest.split_at(size * size);
        self.rest = rest;
        Icon::new(size, pixels.iter().map(|g| f32::from(*g)).collect(), source_scale)
            .map_err(|_unnamed| malformed)
    }

    /// A finite number, 0 or more.
    fn number(&mut self, field: &'static str) -> Result<f64, StoredModelError> {
        let number = f64::from_le_bytes(self.take(field)?);
        if number.is_finite() && number >= 0.0 {
            Ok(number)
        } else {
            Err(StoredModelError::Malformed { field })
        }
    }

    fn count(&mut self, field: &'static str, most: usize) -> Result<usize, StoredModelError> {
        let count = u32::from_le_bytes(self.take(field)?) as usize;
        if count <= most { Ok(count) } else { Err(StoredModelError::Malformed { field }) }
    }

    fn byte(&mut self, field: &'static str, most: usize) -> Result<usize, StoredModelError> {
        let [count] = self.take(field)?;
        if usize::from(count) <= most {
            Ok(usize::from(count))
        } else {
            Err(StoredModelError::Malformed { field })
        }
    }

    fn take<const N: usize>(&mut self, field: &'static str) -> Result<[u8; N], StoredModelError> {
        let (first, rest) = self.rest.split_first_chunk().ok_or(StoredModelError::Malformed { field })?;
        self.rest = rest;
        Ok(*first)
    }
}

/// FNV-1a, 64 bits: detects damage, not tampering.
pub(crate) fn digest(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}
