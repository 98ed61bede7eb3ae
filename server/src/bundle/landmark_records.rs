//! Files of a bundle about what is recognised: `landmarks.json`, `views.json`, `distractors.json`.

use super::{BundleError, LANDMARKS, invalid, map_records::parsed};
use crate::{
    learning_rules,
    store::{
        contents::{CropContents, LandmarkContents, ModelContents, ViewContents},
        landmark_placement::StoredCapture,
        landmarks::{LandmarkGeometry, ModelSummary, StoredPlace},
        pictures::hex,
    },
};
use map::landmark_health::LandmarkHealth;
use nalgebra::Matrix6;
use protos::{Name, api::LearningSettings};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use vision::{
    geometry::Corners,
    model::{LandmarkId, renumbered},
    pose::LandmarkSize,
};

/// Longest text of figures, gates or findings of a landmark, bytes.
const MAX_TEXT_BYTES: usize = 64 << 10;
/// Longest text of a look-alike, as the schema says.
const MAX_LOOKS_LIKE: usize = 1024;

/// A landmark of `landmarks.json`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LandmarkRecord {
    /// From 1, in their order; other files, look-alikes and models refer to it.
    pub(super) number: u64,
    pub(super) name: String,
    pub(super) size: Option<LandmarkSize>,
    /// The size was found with the place, from views.
    pub(super) size_from_views: bool,
    pub(super) place: Option<PlaceRecord>,
    health: LandmarkHealth,
    finding: Option<Value>,
    /// Its own weights and gates.
    learning: Option<LearningSettings>,
    created_ms: i64,
    pub(super) model: Option<ModelRecord>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlaceRecord {
    pub(super) x_m: f64,
    pub(super) y_m: f64,
    pub(super) z_m: f64,
    pub(super) theta_rad: f64,
    roll_rad: f64,
    tilt_rad: f64,
    /// Row by row, over (x, y, theta, z, width, height); `null` for a place by hand.
    covariance: Option<Vec<f64>>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ModelRecord {
    pub(super) file: String,
    /// Of the distance parameters, 16 hexadecimal digits.
    params_hash: String,
    is_active: bool,
    failed_gates: Value,
    looks_like: Option<Value>,
    facts: Value,
    views: u64,
    generated_views: u64,
    learnt_ms: i64,
}

/// A view of `views.json`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ViewRecord {
    /// Number of its landmark.
    pub(super) landmark: u64,
    pub(super) picture: String,
    pub(super) width_px: u32,
    pub(super) height_px: u32,
    pub(super) corners_px: [[f64; 2]; 4],
    pub(super) icon: String,
    pub(super) icon_scale: f64,
    created_ms: i64,
    capture: Option<StoredCapture>,
}

/// A quad of `distractors.json`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DistractorRecord {
    /// Of the picture that it was in, which need not be in the bundle.
    pub(super) picture_sha256: String,
    pub(super) corners_px: [[f64; 2]; 4],
    pub(super) icon: String,
    pub(super) icon_scale: f64,
}

/// Name of the file of a model.
pub(super) fn model_file(number: u64) -> String {
    format!("models/{number}.model")
}

fn model_record(number: u64, model: &ModelContents) -> Result<ModelRecord, serde_json::Error> {
    let ModelSummary { active, looks_like, reasons, facts, views, generated_views, learnt_ms } =
        &model.summary;
    Ok(ModelRecord {
        file: model_file(number),
        params_hash: hex(&model.params_hash),
        is_active: *active,
        failed_gates: parsed(reasons)?,
        looks_like: looks_like.as_deref().map(parsed).transpose()?,
        facts: parsed(facts)?,
        views: *views,
        generated_views: *generated_views,
        learnt_ms: *learnt_ms,
    })
}

impl LandmarkRecord {
    /// `model` is renumbered.
    pub(super) fn of(
        number: u64,
        landmark: &LandmarkContents,
        model: Option<&ModelContents>,
    ) -> Result<Self, serde_json::Error> {
        let LandmarkGeometry { size, place, size_from_views } = landmark.geometry;
        let place = place.map(|p: StoredPlace| PlaceRecord {
            x_m: p.x_m,
            y_m: p.y_m,
            z_m: p.z_m,
            theta_rad: p.theta_rad,
            roll_rad: p.roll_rad,
            tilt_rad: p.tilt_rad,
            covariance: p.covariance.map(|c| (0..36).map(|i| c[(i / 6, i % 6)]).collect()),
        });
        Ok(Self {
            number,
            name: landmark.name.clone(),
            size,
            size_from_views,
            place,
            health: landmark.health,
            finding: landmark.finding.as_deref().map(parsed).transpose()?,
            learning: landmark.learning.as_deref().map(parsed).transpose()?,
            created_ms: landmark.created_ms,
            model: model.map(|model| model_record(number, model)).transpose()?,
        })
    }

    /// The landmark without views, checked; `model` gives the bytes of a file.
    pub(super) fn checked(
        self,
        model: impl FnOnce(&str) -> Result<Vec<u8>, BundleError>,
    ) -> Result<LandmarkContents, BundleError> {
        let number = self.number;
        let at = |field: &str, why: String| {
            invalid(LANDMARKS, format!("[{}].{field}", number.saturating_sub(1)), why)
        };
        Name::new(self.name.as_str()).map_err(|e| at("name", e.to_string()))?;
        let geometry =
            geometry(self.size, self.place, self.size_from_views).map_err(|(f, why)| at(f, why))?;
        let finding = self.finding.map(|value| value.to_string());
        if finding.as_ref().is_some_and(|text| text.len() > MAX_TEXT_BYTES) {
            return Err(at("finding", format!("at most {MAX_TEXT_BYTES} bytes")));
        }
        let learning = self.learning.map(|own| learning_rules::text(&own)).transpose();
        let learning = learning.map_err(|(field, why)| at(&format!("learning.{field}"), why))?;
        let model = match self.model {
            None => None,
            Some(record) => {
                let bytes = model(&record.file)?;
                Some(
                    record
                        .checked(number, bytes)
                        .map_err(|(field, why)| at(&format!("model.{field}"), why))?,
                )
            }
        };
        Ok(LandmarkContents {
            number: LandmarkId(number),
            name: self.name,
            geometry,
            health: self.health,
            finding,
            learning,
            created_ms: self.created_ms,
            views: Vec::new(),
            model,
        })
    }
}

type FieldFault = (&'static str, String);

fn geometry(
    size: Option<LandmarkSize>,
    place: Option<PlaceRecord>,
    size_from_views: bool,
) -> Result<LandmarkGeometry, FieldFault> {
    let sides = LandmarkSize::MIN_M..=LandmarkSize::MAX_M;
    if size.is_some_and(|s| !sides.contains(&s.width_m) || !sides.contains(&s.height_m)) {
        return Err(("size", format!("{} to {} m", sides.start(), sides.end())));
    }
    let covariance = |values: Vec<f64>| {
        let numbers: Result<[f64; 36], _> = values.try_into();
        numbers
            .map(|n| Matrix6::from_row_slice(&n))
            .map_err(|_count| ("place.covariance", "36 numbers".to_owned()))
    };
    let place = place
        .map(|p| {
            Ok::<_, FieldFault>(StoredPlace {
                x_m: p.x_m,
                y_m: p.y_m,
                z_m: p.z_m,
                theta_rad: p.theta_rad,
                roll_rad: p.roll_rad,
                tilt_rad: p.tilt_rad,
                covariance: p.covariance.map(covariance).transpose()?,
            })
        })
        .transpose()?;
    let metre = LandmarkSize { width_m: 1.0, height_m: 1.0 };
    let tried = LandmarkGeometry { size: Some(size.unwrap_or(metre)), place, size_from_views };
    if place.is_some() && tried.landmark_place().is_none() {
        return Err(("place", "a number is out of range, or the covariance is none".to_owned()));
    }
    Ok(LandmarkGeometry { size, place, size_from_views })
}

impl ModelRecord {
    fn checked(self, number: u64, bytes: Vec<u8>) -> Result<ModelContents, FieldFault> {
        let same = renumbered(&bytes, LandmarkId(number)).map_err(|e| ("file", e.to_string()))?;
        if same != bytes {
            return Err(("file", "it is the model of another landmark".to_owned()));
        }
        let hash = u64::from_str_radix(&self.params_hash, 16).ok().filter(|_| self.params_hash.len() == 16);
        let hash = hash.ok_or_else(|| ("params_hash", "16 hexadecimal digits".to_owned()))?;
        let text = |field, value: &Value, max: usize| {
            let text = value.to_string();
            if text.len() <= max { Ok(text) } else { Err((field, format!("at most {max} bytes"))) }
        };
        if !self.failed_gates.is_array() || !self.facts.is_object() {
            return Err(("facts", "`failed_gates` is a list, `facts` an object".to_owned()));
        }
        let count = |field, n: u64| i64::try_from(n).map(|_| n).map_err(|e| (field, e.to_string()));
        let looks_like =
            self.looks_like.map(|value| text("looks_like", &value, MAX_LOOKS_LIKE)).transpose()?;
        Ok(ModelContents {
            bytes,
            // The digits are of the bytes in their order.
            params_hash: hash.to_be_bytes(),
            summary: ModelSummary {
                active: self.is_active,
                looks_like,
                reasons: text("failed_gates", &self.failed_gates, MAX_TEXT_BYTES)?,
                facts: text("facts", &self.facts, MAX_TEXT_BYTES)?,
                views: count("views", self.views)?,
                generated_views: count("generated_views", self.generated_views)?,
                learnt_ms: self.learnt_ms,
            },
        })
    }
}

impl ViewRecord {
    pub(super) fn of(landmark: u64, view: &ViewContents, icon: String) -> Result<Self, serde_json::Error> {
        Ok(Self {
            landmark,
            picture: super::map_records::picture_file(&view.crop.image_sha256, &view.image_kind),
            width_px: view.size_px[0],
            height_px: view.size_px[1],
            corners_px: view.crop.corners_px,
            icon,
            icon_scale: view.crop.icon_scale,
            created_ms: view.created_ms,
            capture: view.capture.as_deref().map(parsed).transpose()?,
        })
    }

    /// The view of this crop and kind of picture. Errors: the field.
    pub(super) fn checked(self, crop: CropContents, image_kind: String) -> Result<ViewContents, FieldFault> {
        if let Some(capture) = &self.capture {
            capture.check().map_err(|e| ("capture", format!("{}: {}", e.field, e.detail)))?;
        }
        let capture = self.capture.map(|capture| serde_json::to_string(&capture)).transpose();
        Ok(ViewContents {
            crop,
            image_kind,
            size_px: [self.width_px, self.height_px],
            created_ms: self.created_ms,
            capture: capture.map_err(|e| ("capture", e.to_string()))?,
        })
    }
}

/// A crop, checked.
pub(super) fn crop(
    image_sha256: [u8; 32],
    corners_px: [[f64; 2]; 4],
    (icon_side, icon): (u32, Vec<u8>),
    icon_scale: f64,
) -> Result<CropContents, FieldFault> {
    Corners::try_from(corners_px).map_err(|e| ("corners_px", e.to_string()))?;
    if !(icon_scale > 0.0 && icon_scale.is_finite()) {
        return Err(("icon_scale", "greater than 0".to_owned()));
    }
    Ok(CropContents { image_sha256, corners_px, icon_side, icon, icon_scale })
}
