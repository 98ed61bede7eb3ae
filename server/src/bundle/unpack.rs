//! From a bundle to the contents of a map, all of it checked.

use super::{
    BundleError, DISTRACTORS, Fault, LANDMARKS, LANDMARKS_GEOJSON, MANIFEST, MAP, MAX_RECORD_BYTES,
    MODALITIES, UNDERLAY, VIEWS, VISIBILITY, WALLS,
    archive::Reader,
    invalid,
    landmark_records::{DistractorRecord, LandmarkRecord, ViewRecord, crop},
    map_records::{MapRecord, ModalitiesRecord, UnderlayRecord, WallsRecord, visibility_text},
    refused,
};
use crate::{
    config::Limits,
    store::{
        contents::{DistractorContents, LandmarkContents, MAX_CONTENTS_BYTES, MapContents, MapSettings},
        pictures::{self, Digest, hex},
    },
};
use image::{GenericImageView as _, ImageFormat, ImageReader};
use map::visibility::VisibilitySettings;
use serde::de::DeserializeOwned;
use std::{
    collections::{BTreeMap, BTreeSet},
    fs::File,
    io::Cursor,
};
use vision::frame::MAX_AREA_PX;

/// Largest side of an icon.
const MAX_ICON_SIDE: u32 = 1024;

/// A bundle whose every value is checked.
pub(super) struct Unpacked {
    pub(super) name: String,
    pub(super) contents: MapContents,
    pub(super) pictures: Pictures,
}

/// The pictures of a bundle, read one at a time.
pub(super) struct Pictures {
    reader: Reader,
    /// File and digest.
    files: Vec<(String, Digest)>,
}

impl Pictures {
    /// The next one.
    pub(super) fn next(&mut self) -> Option<Result<(Digest, Vec<u8>), BundleError>> {
        let (file, sha256) = self.files.pop()?;
        Some(self.reader.read(&file).map(|bytes| (sha256, bytes)))
    }
}

/// Reads a bundle.
pub(super) fn unpack(file: File, limits: &Limits) -> Result<Unpacked, BundleError> {
    let reader = Reader::open(file)?;
    let mut open = Opened { reader, limits, used: BTreeSet::new(), sizes: BTreeMap::new(), bytes: 0 };
    let contents = open.contents()?;
    let known =
        [DISTRACTORS, LANDMARKS, LANDMARKS_GEOJSON, MAP, MODALITIES, UNDERLAY, VIEWS, VISIBILITY, WALLS];
    for file in open.reader.manifest.files.keys() {
        if !known.contains(&file.as_str()) && !open.used.contains(file) {
            return Err(refused(Fault::BadPath, file, "no other file names this one"));
        }
    }
    let name = open.reader.manifest.map.clone();
    protos::Name::new(name.as_str()).map_err(|e| invalid(MANIFEST, "map", e))?;
    let digests = open.sizes.into_iter().map(|(file, (sha256, _))| (file, sha256)).collect();
    Ok(Unpacked { name, contents, pictures: Pictures { reader: open.reader, files: digests } })
}

struct Opened<'a> {
    reader: Reader,
    limits: &'a Limits,
    used: BTreeSet<String>,
    /// Digest and size of each picture that was looked at.
    sizes: BTreeMap<String, (Digest, [u32; 2])>,
    /// Of icons and models.
    bytes: usize,
}

impl Opened<'_> {
    fn contents(&mut self) -> Result<MapContents, BundleError> {
        let (pipeline, learning, location) = self.record::<MapRecord>(MAP)?.checked()?;
        let (fusion_mode, areas, reference_runs) = self.record::<ModalitiesRecord>(MODALITIES)?.checked()?;
        let visibility = visibility_text(self.record::<Option<VisibilitySettings>>(VISIBILITY)?)?;
        let walls = self.record::<WallsRecord>(WALLS)?.checked()?;
        let underlay = match self.record::<Option<UnderlayRecord>>(UNDERLAY)? {
            None => None,
            Some(record) => Some(record.checked(|file, size_px| self.picture(file, size_px))?),
        };
        Ok(MapContents {
            settings: MapSettings { pipeline, learning, location, fusion_mode, areas, visibility },
            landmarks: self.landmarks()?,
            distractors: self.distractors()?,
            walls,
            underlay,
            reference_runs,
        })
    }

    /// A file of records.
    fn record<T: DeserializeOwned>(&mut self, name: &str) -> Result<T, BundleError> {
        let bytes = self.file(name, MAX_RECORD_BYTES)?;
        let mut json = serde_json::Deserializer::from_slice(&bytes);
        let value = serde_path_to_error::deserialize(&mut json)
            .map_err(|e| invalid(name, e.path().to_string(), e.inner().to_string()))?;
        json.end().map_err(|e| invalid(name, "end", e))?;
        Ok(value)
    }

    fn file(&mut self, name: &str, max: u64) -> Result<Vec<u8>, BundleError> {
        match self.reader.manifest.files.get(name) {
            None => Err(refused(Fault::Missing, name, "the bundle has no such file")),
            Some(file) if file.bytes > max => {
                Err(refused(Fault::TooLarge, name, format!("it has more than {max} bytes")))
            }
            Some(_) => {
                self.used.insert(name.to_owned());
                self.reader.read(name)
            }
        }
    }

    /// A file that is in memory with the contents.
    fn held(&mut self, name: &str, length: impl Fn(&[u8]) -> usize) -> Result<Vec<u8>, BundleError> {
        let bytes = self.file(name, self.limits.upload_bytes as u64)?;
        self.bytes += length(&bytes);
        if self.bytes > MAX_CONTENTS_BYTES {
            let why = format!("icons and models have more than {MAX_CONTENTS_BYTES} bytes");
            return Err(refused(Fault::TooLarge, name, why));
        }
        Ok(bytes)
    }

    fn landmarks(&mut self) -> Result<Vec<LandmarkContents>, BundleError> {
        let records: Vec<LandmarkRecord> = self.record(LANDMARKS)?;
        let (mut landmarks, mut names) = (Vec::new(), BTreeSet::new());
        for (number, record) in (1..).zip(records) {
            if record.number != number || !names.insert(record.name.clone()) {
                let why = "numbers rise from 1, and names are there once";
                return Err(invalid(LANDMARKS, format!("[{}]", number - 1), why));
            }
            landmarks.push(record.checked(|file| self.held(file, <[u8]>::len))?);
        }
        let views: Vec<ViewRecord> = self.record(VIEWS)?;
        let mut seen = BTreeSet::new();
        for (index, record) in views.into_iter().enumerate() {
            let at = |(field, why): (&str, String)| invalid(VIEWS, format!("[{index}].{field}"), why);
            let of = usize::try_from(record.landmark).ok().and_then(|n| n.checked_sub(1));
            let Some(landmark) = of.and_then(|n| landmarks.get_mut(n)) else {
                return Err(at(("landmark", "there is no landmark of this number".to_owned())));
            };
            let (sha256, kind) = self.picture(&record.picture, [record.width_px, record.height_px])?;
            let icon = self.icon(&record.icon)?;
            let crop = crop(sha256, record.corners_px, icon, record.icon_scale).map_err(at)?;
            if !seen.insert((record.landmark, sha256, crop.corners_px.map(|c| c.map(f64::to_bits)))) {
                return Err(at(("corners_px", "the same view is there twice".to_owned())));
            }
            landmark.views.push(record.checked(crop, kind).map_err(at)?);
        }
        Ok(landmarks)
    }

    fn distractors(&mut self) -> Result<Vec<DistractorContents>, BundleError> {
        let records: Vec<DistractorRecord> = self.record(DISTRACTORS)?;
        let mut all = Vec::new();
        for (index, record) in records.into_iter().enumerate() {
            let at = |(field, why): (&str, String)| invalid(DISTRACTORS, format!("[{index}].{field}"), why);
            let digest = from_hex(&record.picture_sha256)
                .ok_or_else(|| at(("picture_sha256", "64 hexadecimal digits".to_owned())))?;
            let icon = self.icon(&record.icon)?;
            let crop = crop(digest, record.corners_px, icon, record.icon_scale).map_err(at)?;
            all.push(DistractorContents { crop });
        }
        Ok(all)
    }

    /// Side and grey levels of an icon.
    fn icon(&mut self, name: &str) -> Result<(u32, Vec<u8>), BundleError> {
        let bad = |why: String| refused(Fault::InvalidValue, name, why);
        let bytes = self.file(name, self.limits.upload_bytes as u64)?;
        let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
        let mut bound = image::Limits::default();
        (bound.max_image_width, bound.max_image_height) = (Some(MAX_ICON_SIDE), Some(MAX_ICON_SIDE));
        reader.limits(bound);
        let decoded = reader.decode().map_err(|e| bad(e.to_string()))?;
        let (width, height) = decoded.dimensions();
        let image::DynamicImage::ImageLuma8(grey) = decoded else {
            return Err(bad("an icon is grey, with 8 bits a pixel".to_owned()));
        };
        if width != height || width == 0 {
            return Err(bad("an icon is a square".to_owned()));
        }
        self.bytes += grey.len();
        if self.bytes > MAX_CONTENTS_BYTES {
            let why = format!("icons and models have more than {MAX_CONTENTS_BYTES} bytes");
            return Err(refused(Fault::TooLarge, name, why));
        }
        Ok((width, grey.into_raw()))
    }

    /// Digest and kind of the file of a picture, which has this size, upright.
    fn picture(&mut self, name: &str, size_px: [u32; 2]) -> Result<(Digest, String), BundleError> {
        let bad = |why: &str| refused(Fault::InvalidValue, name, why);
        let parts = name.strip_prefix("pictures/").and_then(|rest| rest.split_once('.'));
        let (digits, kind) = parts.ok_or_else(|| bad("pictures/DIGEST.png or .jpeg"))?;
        if !self.sizes.contains_key(name) {
            let bytes = self.file(name, self.limits.upload_bytes as u64)?;
            let sha256 = pictures::digest(&bytes);
            if hex(&sha256) != digits || engine::picture::kind(&bytes) != Some(kind) {
                return Err(bad("its name is not its digest and kind"));
            }
            let reader = ImageReader::new(Cursor::new(&bytes)).with_guessed_format()?;
            let (width, height) = reader.into_dimensions().map_err(|e| bad(&e.to_string()))?;
            let pixels = u64::from(width) * u64::from(height);
            if pixels > self.limits.upload_pixels.min(MAX_AREA_PX) as u64 {
                return Err(refused(
                    Fault::TooLarge,
                    name,
                    format!("{width} x {height} pixels are too many"),
                ));
            }
            self.sizes.insert(name.to_owned(), (sha256, [width, height]));
        }
        let (sha256, [width, height]) = self.sizes.get(name).copied().unwrap_or_default();
        // A camera that was held upright states a turn.
        if size_px != [width, height] && size_px != [height, width] {
            return Err(bad("it does not have the size that is said of it"));
        }
        Ok((sha256, kind.to_owned()))
    }
}

fn from_hex(digits: &str) -> Option<Digest> {
    let mut digest = Digest::default();
    if digits.len() != 2 * digest.len() || !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
        return None;
    }
    for (byte, pair) in digest.iter_mut().zip(digits.as_bytes().chunks_exact(2)) {
        *byte = u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()?;
    }
    Some(digest)
}
