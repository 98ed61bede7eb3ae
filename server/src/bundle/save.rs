//! From a stored map to a bundle in a temporary file. Pictures are read one at a time.

use super::{
    BundleError, DISTRACTORS, LANDMARKS, LANDMARKS_GEOJSON, MAP, MAX_FILES, MODALITIES, UNDERLAY, VIEWS,
    VISIBILITY, WALLS,
    archive::Writer,
    landmark_records::{DistractorRecord, LandmarkRecord, ViewRecord, model_file},
    map_records::{
        MapRecord, ModalitiesRecord, UnderlayRecord, WallsRecord, landmark_points, parsed, picture_file,
    },
};
use crate::store::{
    Store, StoreError,
    contents::{self, CropContents, MapContents, ModelContents, Numbers, in_other_map},
    kind::Kind,
    pictures::{self, Digest, hex},
    teaching::ATTEMPTS,
};
use map::visibility::VisibilitySettings;
use serde::Serialize;
use std::{
    collections::{BTreeMap, BTreeSet},
    fs::File,
    path::Path,
};
use tokio::runtime::Handle;
use vision::model::{LandmarkId, renumbered};

/// A bundle of a map, in a file of this folder that has no name and ends with its handle. `may_see`
/// says whether the map that it lies in may be named. Errors: `NotFound`, `PictureDamaged`,
/// `Damaged`, `Limit`; `Busy` while pictures keep being deleted.
pub(crate) async fn save(
    store: &Store,
    map: &str,
    folder: &Path,
    may_see: impl Fn(&str) -> bool + Send + Sync,
) -> Result<File, BundleError> {
    for _ in 0..ATTEMPTS {
        let (row, mut found) = contents::contents_of(store, map).await?;
        found.settings.location.link = found.settings.location.link.filter(|link| may_see(&link.parent));
        let (file, store, runtime) = (tempfile::tempfile_in(folder)?, store.clone(), Handle::current());
        let picture = move |sha256: &Digest| runtime.block_on(pictures::read(&store, sha256));
        let written = tokio::task::spawn_blocking(move || write(file, &row.name, &found, picture)).await;
        match written.map_err(std::io::Error::other)? {
            // Deleted since the contents were read.
            Err(BundleError::Store(StoreError::NotFound { what: Kind::Picture, .. })) => {}
            done => return done,
        }
    }
    Err(StoreError::Busy.into())
}

/// A stored text that is no JSON of its kind.
fn damaged(what: &str) -> impl Fn(serde_json::Error) -> BundleError + '_ {
    move |e| StoreError::Damaged { what: what.to_owned(), reason: e.to_string() }.into()
}

fn write(
    file: File,
    name: &str,
    map: &MapContents,
    picture: impl Fn(&Digest) -> Result<Vec<u8>, StoreError>,
) -> Result<File, BundleError> {
    let mut out = Writer::new(file);
    let numbers: Numbers = (1..).zip(&map.landmarks).map(|(n, l)| (l.number, LandmarkId(n))).collect();
    let models = models(map, &numbers)?;
    let icons = Icons::of(map)?;
    record(&mut out, DISTRACTORS, &distractors(map, &icons))?;
    for (file, png) in &icons.files {
        add(&mut out, file, png)?;
    }
    let landmarks = landmarks(map, &models).map_err(damaged("a landmark"))?;
    let points = landmarks.iter().filter_map(|l| {
        let place = l.place.as_ref()?;
        let size = l.size.map(|size| [size.width_m, size.height_m]);
        Some((l.name.as_str(), [place.x_m, place.y_m, place.z_m, place.theta_rad], size))
    });
    record(&mut out, LANDMARKS_GEOJSON, &landmark_points(points))?;
    record(&mut out, LANDMARKS, &landmarks)?;
    record(&mut out, MAP, &MapRecord::of(&map.settings).map_err(damaged("the map"))?)?;
    let modalities = ModalitiesRecord::of(&map.settings, &map.reference_runs);
    record(&mut out, MODALITIES, &modalities.map_err(damaged("modalities"))?)?;
    for (number, model) in &models {
        add(&mut out, &model_file(*number), &model.bytes)?;
    }
    for (file, sha256) in picture_files(map) {
        add(&mut out, &file, &picture(&sha256)?)?;
    }
    record(&mut out, UNDERLAY, &map.underlay.as_ref().map(UnderlayRecord::of))?;
    record(&mut out, VIEWS, &views(map, &icons).map_err(damaged("a view"))?)?;
    let visibility = map.settings.visibility.as_deref().map(parsed::<VisibilitySettings>).transpose();
    record(&mut out, VISIBILITY, &visibility.map_err(damaged("visibility settings"))?)?;
    record(&mut out, WALLS, &WallsRecord::of(&map.walls))?;
    Ok(out.finish(name)?)
}

fn add(out: &mut Writer, name: &str, bytes: &[u8]) -> Result<(), BundleError> {
    if out.len() >= MAX_FILES {
        return Err(StoreError::Limit { what: "files in a bundle", max: MAX_FILES }.into());
    }
    Ok(out.add(name, bytes)?)
}

fn record(out: &mut Writer, name: &str, value: &impl Serialize) -> Result<(), BundleError> {
    let text = serde_json::to_vec_pretty(value).map_err(std::io::Error::other)?;
    add(out, name, &text)
}

/// The models, each with the number of its landmark in the bundle.
fn models(map: &MapContents, numbers: &Numbers) -> Result<BTreeMap<u64, ModelContents>, BundleError> {
    let mut models = BTreeMap::new();
    for landmark in &map.landmarks {
        let (Some(model), Some(number)) = (&landmark.model, numbers.get(&landmark.number)) else { continue };
        renumbered(&model.bytes, *number).map_err(|e| StoreError::Damaged {
            what: format!("the model of landmark `{}`", landmark.name),
            reason: e.to_string(),
        })?;
        models.insert(number.0, in_other_map(model, *number, numbers));
    }
    Ok(models)
}

fn landmarks(
    map: &MapContents,
    models: &BTreeMap<u64, ModelContents>,
) -> Result<Vec<LandmarkRecord>, serde_json::Error> {
    let landmarks = (1..).zip(&map.landmarks);
    landmarks.map(|(number, landmark)| LandmarkRecord::of(number, landmark, models.get(&number))).collect()
}

fn views(map: &MapContents, icons: &Icons) -> Result<Vec<ViewRecord>, serde_json::Error> {
    let of = |(number, landmark): (u64, &contents::LandmarkContents)| {
        let view = |view| ViewRecord::of(number, view, icons.name(&view.crop));
        landmark.views.iter().map(view).collect::<Vec<_>>()
    };
    (1..).zip(&map.landmarks).flat_map(of).collect()
}

fn distractors(map: &MapContents, icons: &Icons) -> Vec<DistractorRecord> {
    let record = |distractor: &contents::DistractorContents| DistractorRecord {
        picture_sha256: hex(&distractor.crop.image_sha256),
        corners_px: distractor.crop.corners_px,
        icon: icons.name(&distractor.crop),
        icon_scale: distractor.crop.icon_scale,
    };
    map.distractors.iter().map(record).collect()
}

fn picture_files(map: &MapContents) -> BTreeSet<(String, Digest)> {
    let views = map.landmarks.iter().flat_map(|landmark| &landmark.views);
    let views = views.map(|view| (view.crop.image_sha256, view.image_kind.as_str()));
    let underlay = map.underlay.iter().map(|row| (row.image_sha256, row.image_kind.as_str()));
    views.chain(underlay).map(|(sha256, kind)| (picture_file(&sha256, kind), sha256)).collect()
}

/// Icons as PNG, by the name of their file, which is of their digest.
struct Icons {
    files: BTreeMap<String, Vec<u8>>,
    /// Name by the digest of the grey levels.
    names: BTreeMap<Digest, String>,
}

impl Icons {
    fn of(map: &MapContents) -> Result<Self, BundleError> {
        let mut icons = Self { files: BTreeMap::new(), names: BTreeMap::new() };
        let views = map.landmarks.iter().flat_map(|landmark| &landmark.views).map(|view| &view.crop);
        for crop in views.chain(map.distractors.iter().map(|distractor| &distractor.crop)) {
            let side = crop.icon_side as usize;
            let png = engine::picture::png(side, side, &crop.icon)
                .map_err(|e| StoreError::Damaged { what: "an icon".to_owned(), reason: e.to_string() })?;
            let name = format!("icons/{}.png", hex(&pictures::digest(&png)));
            icons.names.insert(pictures::digest(&crop.icon), name.clone());
            icons.files.insert(name, png);
        }
        Ok(icons)
    }

    fn name(&self, crop: &CropContents) -> String {
        self.names.get(&pictures::digest(&crop.icon)).cloned().unwrap_or_default()
    }
}
