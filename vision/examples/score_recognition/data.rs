//! The labelled photographs: landmarks to learn, queries, corners.

use nalgebra::{Matrix2, Point2};
use serde_json::Value;
use std::{collections::BTreeMap, error::Error, path::Path, sync::Arc};
use vision::{
    detect::{Quad, QuadKind},
    frame::GrayImage,
    geometry::Corners,
    learn::{TrainingView, learn, refit_thresholds, synthesis::views},
    model::{LandmarkId, LandmarkModel, ModelSet},
    params::Params,
    points::taught::view_points,
    recognise::{IconFeatures, features},
};

/// Views generated from each photograph.
const GENERATED: usize = 40;

/// A labelled quad of one photograph.
pub(crate) struct Query {
    pub(crate) file: String,
    pub(crate) image: Arc<GrayImage>,
    pub(crate) quad: Quad,
    pub(crate) landmark: Option<u64>,
    /// 0 for odd photographs, 1 for even ones.
    pub(crate) half: usize,
    /// Cropped to the landmark: nothing for the detector.
    pub(crate) whole_image: bool,
}

/// 0 for odd numbers in a file's name, 1 for even ones.
pub(crate) fn half(file: &str) -> usize {
    let digits: String =
        file.chars().rev().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect();
    // Digits are reversed: the first is the last of the number.
    digits.bytes().next().map_or(1, |d| usize::from((d - b'0').is_multiple_of(2)))
}

pub(crate) const HALVES: [&str; 2] = ["odd", "even"];

pub(crate) struct Taught {
    pub(crate) model: LandmarkModel,
    pub(crate) photograph: IconFeatures,
}

/// Every `teach` entry: its photograph and generated views; thresholds against all the others'
/// photographs.
pub(crate) fn teach(root: &Path, truth: &Value, p: &Params) -> Result<Vec<Taught>, Box<dyn Error>> {
    let mut all = Vec::new();
    for entry in list(&truth["teach"]) {
        let id: u64 = entry["landmark"].as_str().ok_or("landmark")?.parse()?;
        let image = load(&root.join(entry["file"].as_str().ok_or("file")?))?;
        let corners = whole(&image)?;
        let mut lesson = vec![TrainingView::photographed(&image, &corners, p)?];
        lesson.extend(views(&image, &corners, GENERATED, p, id));
        let photograph = features(lesson[0].icon.clone(), &p.recognise);
        let points = [view_points(&image, &corners)];
        all.push(Taught { model: learn(LandmarkId(id), &lesson, &[], p)?.with_points(&points), photograph });
    }
    Ok(all)
}

/// The models of the chosen landmarks, with thresholds fitted against each other only.
pub(crate) fn model_set(
    all: &[Taught],
    chosen: impl Fn(u64) -> bool,
    p: &Params,
) -> Result<ModelSet, Box<dyn Error>> {
    let chosen: Vec<&Taught> = all.iter().filter(|t| chosen(t.model.id.0)).collect();
    let fit = |t: &&Taught| {
        let others = chosen.iter().filter(|o| o.model.id != t.model.id);
        let negatives: Vec<IconFeatures> = others.map(|o| o.photograph.clone()).collect();
        Arc::new(refit_thresholds(&t.model, &negatives, p))
    };
    Ok(ModelSet::new(chosen.iter().map(fit).collect(), p)?)
}

pub(crate) fn queries(root: &Path, truth: &Value) -> Result<Vec<Query>, Box<dyn Error>> {
    let mut all = Vec::new();
    for entry in list(&truth["images"]) {
        let file = entry["file"].as_str().ok_or("file")?.to_owned();
        let image = Arc::new(load(&root.join(&file))?);
        let whole_image = entry["whole_image"] == Value::Bool(true);
        let mut add = |corners: Corners, landmark: &Value| -> Result<(), Box<dyn Error>> {
            let landmark = landmark.as_str().map(str::parse).transpose()?;
            let (image, half) = (Arc::clone(&image), half(&file));
            all.push(Query { file: file.clone(), image, quad: quad(corners), landmark, half, whole_image });
            Ok(())
        };
        if whole_image {
            add(whole(&image)?, &entry["landmark"])?;
        }
        for q in list(&entry["quads"]) {
            let corners: [[f64; 2]; 4] = serde_json::from_value(q["corners"].clone())?;
            add(Corners::from_unordered(corners.map(Point2::from))?, &q["landmark"])?;
        }
    }
    Ok(all)
}

/// Which corner is top-left is not known: all four rotations are tried.
pub(crate) fn quad(corners_px: Corners) -> Quad {
    Quad {
        corners_px,
        corner_covariance_px2: [Matrix2::identity(); 4],
        side_support: [1.0; 4],
        side_clipped: [false; 4],
        score: 1.0,
        kind: QuadKind::Full,
        upright_ambiguous: true,
        alternates: Vec::new(),
    }
}

/// Landmarks under two names, each to the lower of both.
pub(crate) fn same(truth: &Value) -> impl Fn(u64) -> u64 + use<> {
    let number = |v: &Value| v.as_str().and_then(|s| s.parse::<u64>().ok());
    let pairs: BTreeMap<u64, u64> = list(&truth["same"])
        .filter_map(|pair| Some((number(&pair[0])?, number(&pair[1])?)))
        .map(|(a, b)| (a.max(b), a.min(b)))
        .collect();
    move |id| pairs.get(&id).copied().unwrap_or(id)
}

pub(crate) fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

pub(crate) fn load(path: &Path) -> Result<GrayImage, Box<dyn Error>> {
    let grey = image::open(path)?.to_luma8();
    let (width, height) = (grey.width() as usize, grey.height() as usize);
    Ok(GrayImage::new(width, height, grey.into_raw())?)
}

pub(crate) fn whole(image: &GrayImage) -> Result<Corners, Box<dyn Error>> {
    let (right, bottom) = (image.width() as f64 - 0.5, image.height() as f64 - 0.5);
    Ok(Corners::try_from([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])?)
}
