//! Scores recognition on real photographs: `score_recognition DIR [PARAMS [KIND [STRANGERS...]]]`, where DIR holds a
//! `truth.json` in the evaluation format, PARAMS is JSON such as `{"icon":{"size":50}}` and KIND one of `hausdorff`,
//! `correlation`, `both` (default); with `VERBOSE` set every quad is printed. Further arguments are folders of images that
//! hold no landmark: what the detector finds there, and quads at random places, are all strangers. Every landmark is taught
//! from its one photograph and views generated from it. Each quad is looked for among all landmarks; then, as a stranger,
//! among the half that does not hold it. Odd photographs, by the number in their name, may be tuned on; even ones are for
//! the report: every figure has both columns.
#![expect(clippy::print_stdout, reason = "a program that prints a table")]

use nalgebra::{Matrix2, Point2};
use serde_json::Value;
use std::{collections::BTreeMap, error::Error, path::Path, sync::Arc, time::Instant};
use vision::{
    detect::{
        detect,
        quads::{Corners, Quad, QuadKind},
    },
    frame::GrayImage,
    geometry::polygon::iou,
    learn::{
        model::{LandmarkModel, View, learn, refit_thresholds},
        synthesis::views,
    },
    params::Params,
    pipeline::{MAX_RECOGNISED_QUADS, matched},
    points::{search::search, taught::view_points},
    recognise::{
        DistanceKind, IconFeatures, LandmarkId, ModelSet, Recognition, features, log10_false_alarms,
        verdict::{recognise, recognise_watched},
        watch::{Step, Watch},
    },
    seen_border::SeenBorder,
    trace::NoTrace,
};

/// Views generated from each photograph.
const GENERATED: usize = 40;

/// Random quads in each image without landmarks.
const RANDOM_QUADS: usize = 20;

/// A labelled quad of one photograph.
struct Query {
    file: String,
    image: Arc<GrayImage>,
    quad: Quad,
    landmark: Option<u64>,
    /// 0 for odd photographs, 1 for even ones.
    half: usize,
    /// Cropped to the landmark: nothing for the detector.
    whole_image: bool,
}

/// 0 for odd numbers in a file's name, 1 for even ones.
fn half(file: &str) -> usize {
    let digits: String =
        file.chars().rev().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect();
    // Digits are reversed: the first is the last of the number.
    digits.bytes().next().map_or(1, |d| usize::from((d - b'0').is_multiple_of(2)))
}

const HALVES: [&str; 2] = ["odd", "even"];

struct Taught {
    model: LandmarkModel,
    photograph: IconFeatures,
}

#[derive(Default)]
struct Score {
    right: usize,
    wrong: usize,
    missed: usize,
    ambiguous: usize,
    refused: usize,
    accepted: usize,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let root =
        Path::new(arguments.get(1).ok_or("usage: score_recognition DIR [PARAMS [KIND [STRANGERS...]]]")?);
    let p: Params = serde_json::from_str(arguments.get(2).map_or("{}", |json| json))?;
    let only: Option<DistanceKind> =
        arguments.get(3).map(|k| serde_json::from_value(k.as_str().into())).transpose()?;
    let start = Instant::now();
    let truth: Value = serde_json::from_str(&std::fs::read_to_string(root.join("truth.json"))?)?;
    let taught = teach(root, &truth, &p)?;
    let queries = queries(root, &truth)?;
    let same = same(&truth);
    println!(
        "{} landmarks taught in {:.1} s, {} quads, icon size {}",
        taught.len(),
        start.elapsed().as_secs_f64(),
        queries.len(),
        p.icon.size
    );
    let everything = model_set(&taught, |_| true, &p)?;
    let halves = [model_set(&taught, |id| id % 2 == 0, &p)?, model_set(&taught, |id| id % 2 == 1, &p)?];
    let kind = only.unwrap_or_default();
    let verbose = std::env::var_os("VERBOSE").is_some();
    for (half, name) in HALVES.into_iter().enumerate() {
        let queries: Vec<&Query> = queries.iter().filter(|q| q.half == half).collect();
        let start = Instant::now();
        let score = labelled(&queries, &everything, &same, (kind, verbose), &p);
        let ms = start.elapsed().as_secs_f64() * 1e3 / queries.len() as f64;
        let (strangers, strangers_accepted) = strangers(&queries, &halves, &same, (kind, verbose), &p);
        println!(
            "{kind:?}, {}: right {} wrong {} missed {} ambiguous {} ({:.3}) | strangers: refused {} accepted {} | of {strangers} \
             strangers to a half {strangers_accepted} accepted | {ms:.1} ms a quad",
            name,
            score.right,
            score.wrong,
            score.missed,
            score.ambiguous,
            score.right as f64 / (score.right + score.wrong + score.missed + score.ambiguous) as f64,
            score.refused,
            score.accepted
        );
    }
    detected(&queries, &everything, &same, (kind, verbose), &p);
    let fifty = model_set(&taught, |id| id % 6 == 0, &p)?;
    for folder in arguments.iter().skip(4) {
        for models in [&fifty, &everything] {
            strangers_in(Path::new(folder), models, kind, &p)?;
        }
    }
    Ok(())
}

/// Every labelled quad with its true corners against all landmarks.
fn labelled(
    queries: &[&Query],
    models: &ModelSet,
    same: &impl Fn(u64) -> u64,
    (kind, verbose): (DistanceKind, bool),
    p: &Params,
) -> Score {
    let mut score = Score::default();
    for q in queries {
        let v = recognise(&q.image, &q.quad, models, kind, p);
        let is = |id: LandmarkId| q.landmark.is_some_and(|l| same(l) == same(id.0));
        let word = match (q.landmark, v.recognition) {
            (Some(_), Recognition::Unique(id)) if is(id) => (&mut score.right, "right"),
            (Some(_), Recognition::Unique(_)) => (&mut score.wrong, "WRONG"),
            (Some(_), Recognition::Ambiguous(_)) => (&mut score.ambiguous, "ambiguous"),
            (Some(_), Recognition::Unknown) => (&mut score.missed, "missed"),
            (None, Recognition::Unique(_)) => (&mut score.accepted, "ACCEPTED"),
            (None, _) => (&mut score.refused, "refused"),
        };
        *word.0 += 1;
        if verbose {
            print!("{kind:?} {} {:?} {} conf {:.2}", q.file, q.landmark, word.1, v.confidence);
            for c in v.candidates.iter().take(3) {
                print!(
                    " | {} C {:.3} H {:.2} L {:.2?} r {:.2} {:?}",
                    c.landmark.0, c.correlation, c.hausdorff, c.likeness, c.ratio, c.refusal
                );
            }
            println!();
        }
    }
    score
}

/// The same quads as strangers, each against the half of the landmarks that does not hold it: asked and accepted.
fn strangers(
    queries: &[&Query],
    halves: &[ModelSet; 2],
    same: &impl Fn(u64) -> u64,
    (kind, verbose): (DistanceKind, bool),
    p: &Params,
) -> (usize, usize) {
    let (mut strangers, mut strangers_accepted) = (0, 0);
    for q in queries {
        for (parity, half) in halves.iter().enumerate() {
            if q.landmark.is_some_and(|l| same(l) % 2 == parity as u64) {
                continue;
            }
            strangers += 1;
            let v = recognise(&q.image, &q.quad, half, kind, p);
            let accepted = matches!(v.recognition, Recognition::Unique(_));
            strangers_accepted += usize::from(accepted);
            if verbose && accepted {
                println!("HALF {kind:?} {} {:?} accepted {:?}", q.file, q.landmark, v.candidates[0]);
            }
        }
    }
    (strangers, strangers_accepted)
}

/// Time of each step of recognition.
#[derive(Default)]
struct Steps {
    last: Option<Instant>,
    ms: BTreeMap<Step, f64>,
}

impl Watch for Steps {
    fn finished(&mut self, step: Step) {
        let now = Instant::now();
        let last = self.last.replace(now).unwrap_or(now);
        *self.ms.entry(step).or_default() += (now - last).as_secs_f64() * 1e3;
    }
}

/// What the detector and recognition make of the photographs of one half.
#[derive(Default)]
struct Detected {
    images: usize,
    known: usize,
    found: usize,
    wrong: usize,
    quads: usize,
    detection_s: f64,
    recognition_s: f64,
    steps: Steps,
    corner_errors_px: Vec<f64>,
    /// Of each quad with the right name: see [`normalised_square`].
    squares: Vec<f64>,
    confidences: Vec<(f64, bool)>,
}

/// The same photographs with the quads that the detector finds. A detected quad belongs to the labelled one it
/// overlaps most, if by 0.3 at least: borders within it share less than the border itself.
fn detected(
    queries: &[Query],
    models: &ModelSet,
    same: &impl Fn(u64) -> u64,
    (kind, verbose): (DistanceKind, bool),
    p: &Params,
) {
    let mut images: Vec<Vec<&Query>> = Vec::new();
    for q in queries.iter().filter(|q| !q.whole_image) {
        match images.last_mut().filter(|last| last[0].file == q.file) {
            Some(last) => last.push(q),
            None => images.push(vec![q]),
        }
    }
    let mut scores: [Detected; 2] = Default::default();
    for labelled in images {
        let score = &mut scores[labelled[0].half];
        let start = Instant::now();
        let facts = detect(&labelled[0].image, &p.detect, &mut NoTrace);
        score.detection_s += start.elapsed().as_secs_f64();
        let mut named = vec![false; labelled.len()];
        for quad in facts.iter().filter(|q| q.kind == QuadKind::Full).take(MAX_RECOGNISED_QUADS) {
            score.quads += 1;
            let start = Instant::now();
            score.steps.last = Some(start);
            let v = recognise_watched(&labelled[0].image, quad, models, kind, p, &mut score.steps);
            score.recognition_s += start.elapsed().as_secs_f64();
            let overlap = |q: &Query| iou(quad.corners_px.points(), q.quad.corners_px.points());
            let nearest =
                (0..labelled.len()).max_by(|a, b| overlap(labelled[*a]).total_cmp(&overlap(labelled[*b])));
            let hit = nearest.filter(|i| overlap(labelled[*i]) > 0.3);
            let Recognition::Unique(id) = v.recognition else {
                if verbose && hit.is_some_and(|i| labelled[i].landmark.is_some()) {
                    println!(
                        "REFUSED {} {:?} {:?}",
                        labelled[0].file,
                        labelled[hit.unwrap_or(0)].landmark,
                        v.candidates.first()
                    );
                }
                continue;
            };
            let right = hit.is_some_and(|i| labelled[i].landmark.is_some_and(|l| same(l) == same(id.0)));
            score.confidences.push((v.confidence, right));
            match hit {
                Some(i) if right => {
                    named[i] = true;
                    if let Some(SeenBorder { corners_px: corners, covariance_px2: covariance, .. }) =
                        matched(quad, &v, p)
                    {
                        let truth = (0..4).map(|r| labelled[i].quad.corners_px.rotated(r));
                        let nearest = truth
                            .min_by(|a, b| corners.furthest_px(a).total_cmp(&corners.furthest_px(b)))
                            .unwrap_or(corners);
                        score.corner_errors_px.push(corners.furthest_px(&nearest));
                        score.squares.push(normalised_square(&corners, &nearest, &covariance));
                    }
                }
                _ => {
                    score.wrong += 1;
                    println!("DETECTED WRONG {} {:?} {:?}", labelled[0].file, v.candidates[0], v.points);
                }
            }
        }
        score.images += 1;
        score.known += labelled.iter().filter(|q| q.landmark.is_some()).count();
        score.found += named.iter().filter(|n| **n).count();
        for (q, _) in
            labelled.iter().zip(&named).filter(|(q, named)| verbose && !**named && q.landmark.is_some())
        {
            println!("MISSED {} {:?}", q.file, q.landmark);
        }
    }
    for (score, name) in scores.into_iter().zip(HALVES) {
        print_detected(score, name, kind);
    }
}

fn print_detected(mut s: Detected, name: &str, kind: DistanceKind) {
    s.corner_errors_px.sort_by(f64::total_cmp);
    let at = |share: f64| s.corner_errors_px.get((share * s.corner_errors_px.len() as f64) as usize).copied();
    let gap: f64 = s.confidences.iter().map(|(c, right)| c - f64::from(u8::from(*right))).sum::<f64>()
        / s.confidences.len().max(1) as f64;
    println!(
        "{kind:?}, detected quads, {name}: {} of {} landmarks found ({:.3}), {} wrong, {} quads asked | a photograph: \
             {:.1} ms detection, {:.1} ms recognition | worst corner median {:.2} px, 90 % {:.2} px | confidence less accuracy {gap:.4}",
        s.found,
        s.known,
        s.found as f64 / s.known as f64,
        s.wrong,
        s.quads,
        s.detection_s * 1e3 / s.images as f64,
        s.recognition_s * 1e3 / s.images as f64,
        at(0.5).unwrap_or(f64::NAN),
        at(0.9).unwrap_or(f64::NAN),
    );
    s.squares.sort_by(f64::total_cmp);
    let square =
        |share: f64| s.squares.get((share * s.squares.len() as f64) as usize).copied().unwrap_or(f64::NAN);
    println!(
        "    normalised square of corner errors: 25 % {:.1}, median {:.1}, 75 % {:.1}",
        square(0.25),
        square(0.5),
        square(0.75)
    );
    for (step, ms) in &s.steps.ms {
        println!("    {}: {:.1} ms a photograph", step.name(), ms / s.images as f64);
    }
}

/// Mean square of the coordinates' errors over their variances: 1 where the covariances are right.
fn normalised_square(found: &Corners, truth: &Corners, covariance: &[Matrix2<f64>; 4]) -> f64 {
    let each = found.points().iter().zip(truth.points()).zip(covariance).map(|((f, t), c)| {
        let off = f - t;
        c.try_inverse().map_or(f64::INFINITY, |inverse| off.dot(&(inverse * off)))
    });
    each.sum::<f64>() / 8.0
}

/// What the detector finds in every image in `folder`, and quads at random places of it: how many are taken for a landmark.
fn strangers_in(
    folder: &Path,
    models: &ModelSet,
    kind: DistanceKind,
    p: &Params,
) -> Result<(), Box<dyn Error>> {
    let mut files: Vec<_> =
        std::fs::read_dir(folder)?.map(|f| f.map(|f| f.path())).collect::<Result<_, _>>()?;
    files.sort();
    let (mut asked, mut accepted, mut seconds, mut images) = (0, 0, 0.0, 0);
    let mut nearest: Vec<f64> = Vec::new();
    for file in files {
        let Ok(image) = load(&file) else { continue };
        images += 1;
        let mut state = 1_u64;
        let mut roll = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        let mut quads = detect(&image, &p.detect, &mut NoTrace);
        quads.retain(|q| q.kind == QuadKind::Full);
        for _ in 0..RANDOM_QUADS {
            let (w, h) = (image.width() as f64 - 1.0, image.height() as f64 - 1.0);
            let side = (0.1 + 0.5 * roll()) * w.min(h);
            let (x, y) = (roll() * (w - 1.3 * side), roll() * (h - 1.3 * side));
            let mut corner = |dx: f64, dy: f64| {
                Point2::new(x + side * (dx + 0.3 * roll()), y + side * (dy + 0.3 * roll()))
            };
            let points = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            quads.extend(Corners::new(points).ok().map(quad));
        }
        for quad in quads {
            asked += 1;
            let start = Instant::now();
            let v = recognise(&image, &quad, models, kind, p);
            seconds += start.elapsed().as_secs_f64();
            let found = search(&image, &quad, models.points(), |i| {
                models.at(i).map_or(&[][..], |m| m.points.as_slice())
            });
            nearest.extend(found.first().map(|f| log10_false_alarms(&f.evidence, models.len())));
            if matches!(v.recognition, Recognition::Unique(_)) {
                accepted += 1;
                println!("STRANGER {} {:?} {:?}", file.display(), v.candidates[0], v.points);
            }
        }
    }
    nearest.sort_by(f64::total_cmp);
    nearest.truncate(3);
    println!(
        "{}, N = {}: {asked} quads of {images} images, {accepted} accepted | {:.2} ms a quad | least log10 of false alarms {nearest:.1?}",
        folder.display(),
        models.len(),
        seconds * 1e3 / f64::from(asked.max(1))
    );
    Ok(())
}

/// Every `teach` entry: its photograph and generated views; thresholds against all the others' photographs.
fn teach(root: &Path, truth: &Value, p: &Params) -> Result<Vec<Taught>, Box<dyn Error>> {
    let mut all = Vec::new();
    for entry in list(&truth["teach"]) {
        let id: u64 = entry["landmark"].as_str().ok_or("landmark")?.parse()?;
        let image = load(&root.join(entry["file"].as_str().ok_or("file")?))?;
        let corners = whole(&image)?;
        let mut lesson = vec![View::photographed(&image, &corners, p)?];
        lesson.extend(views(&image, &corners, GENERATED, p, id));
        let photograph = features(lesson[0].icon.clone(), &p.recognise);
        let points = [view_points(&image, &corners)];
        all.push(Taught { model: learn(LandmarkId(id), &lesson, &[], p)?.with_points(&points), photograph });
    }
    Ok(all)
}

/// The models of the chosen landmarks, with thresholds fitted against each other only.
fn model_set(all: &[Taught], chosen: impl Fn(u64) -> bool, p: &Params) -> Result<ModelSet, Box<dyn Error>> {
    let chosen: Vec<&Taught> = all.iter().filter(|t| chosen(t.model.id.0)).collect();
    let fit = |t: &&Taught| {
        let others = chosen.iter().filter(|o| o.model.id != t.model.id);
        let negatives: Vec<IconFeatures> = others.map(|o| o.photograph.clone()).collect();
        Arc::new(refit_thresholds(&t.model, &negatives, p))
    };
    Ok(ModelSet::new(chosen.iter().map(fit).collect(), p)?)
}

fn queries(root: &Path, truth: &Value) -> Result<Vec<Query>, Box<dyn Error>> {
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
fn quad(corners_px: Corners) -> Quad {
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
fn same(truth: &Value) -> impl Fn(u64) -> u64 + use<> {
    let number = |v: &Value| v.as_str().and_then(|s| s.parse::<u64>().ok());
    let pairs: BTreeMap<u64, u64> = list(&truth["same"])
        .filter_map(|pair| Some((number(&pair[0])?, number(&pair[1])?)))
        .map(|(a, b)| (a.max(b), a.min(b)))
        .collect();
    move |id| pairs.get(&id).copied().unwrap_or(id)
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn load(path: &Path) -> Result<GrayImage, Box<dyn Error>> {
    let grey = image::open(path)?.to_luma8();
    let (width, height) = (grey.width() as usize, grey.height() as usize);
    Ok(GrayImage::new(width, height, grey.into_raw())?)
}

fn whole(image: &GrayImage) -> Result<Corners, Box<dyn Error>> {
    let (right, bottom) = (image.width() as f64 - 0.5, image.height() as f64 - 0.5);
    Ok(Corners::try_from([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])?)
}
