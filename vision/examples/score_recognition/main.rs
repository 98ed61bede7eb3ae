//! Scores recognition on real photographs: `score_recognition DIR [PARAMS [KIND [STRANGERS...]]]`,
//! where DIR holds a `truth.json` in the evaluation format, PARAMS is JSON such as
//! `{"icon":{"size":50}}` and KIND one of `hausdorff`, `correlation`, `both` (default); with
//! `VERBOSE` set every quad is printed. Further arguments are folders of images that hold no
//! landmark: what the detector finds there, and quads at random places, are all distractors. Every
//! landmark is taught from its one photograph and views generated from it. Each quad is looked for
//! among all landmarks; then, as a distractor, among the half that does not hold it. Odd
//! photographs, by the number in their name, may be tuned on; even ones are for the report: every
//! figure has both columns.
#![expect(clippy::disallowed_methods, clippy::disallowed_types, reason = "a program with files and a clock")]
#![expect(clippy::print_stdout, reason = "a program that prints a table")]

mod data;

use data::{HALVES, Query, load, model_set, quad, queries, same, teach};
use nalgebra::{Matrix2, Point2};
use serde_json::Value;
use std::{collections::BTreeMap, error::Error, path::Path, time::Instant};
use vision::{
    detect::{QuadKind, detect},
    geometry::{Corners, polygon::iou},
    model::{LandmarkId, ModelSet},
    params::Params,
    pipeline::{MAX_RECOGNISED_QUADS, matched_border},
    points::search::search,
    recognise::{
        DistanceKind, RecogniseStep, StepListener, Verdict, log10_false_alarms, recognise, recognise_watched,
    },
    seen_border::SeenBorder,
    trace::NoTrace,
};

/// Random quads in each image without landmarks.
const RANDOM_QUADS: usize = 20;

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
        let (distractors, distractors_accepted) = distractors(&queries, &halves, &same, (kind, verbose), &p);
        println!(
            "{kind:?}, {}: right {} wrong {} missed {} ambiguous {} ({:.3}) | distractors: refused {} accepted {} | of {distractors} \
             distractors to a half {distractors_accepted} accepted | {ms:.1} ms a quad",
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
            distractors_in(Path::new(folder), models, kind, &p)?;
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
        let word = match (q.landmark, v.verdict) {
            (Some(_), Verdict::Unique(id)) if is(id) => (&mut score.right, "right"),
            (Some(_), Verdict::Unique(_)) => (&mut score.wrong, "WRONG"),
            (Some(_), Verdict::Ambiguous(_)) => (&mut score.ambiguous, "ambiguous"),
            (Some(_), Verdict::Unknown) => (&mut score.missed, "missed"),
            (None, Verdict::Unique(_)) => (&mut score.accepted, "ACCEPTED"),
            (None, _) => (&mut score.refused, "refused"),
        };
        *word.0 += 1;
        if verbose {
            print!("{kind:?} {} {:?} {} conf {:.2}", q.file, q.landmark, word.1, v.confidence);
            for c in v.candidates.iter().take(3) {
                print!(" | {} {:.3?} r {:.2} {:?}", c.landmark.0, c.evidence, c.ratio, c.refusal);
            }
            println!();
        }
    }
    score
}

/// The same quads as distractors, each against the half of the landmarks that does not hold it:
/// asked and accepted.
fn distractors(
    queries: &[&Query],
    halves: &[ModelSet; 2],
    same: &impl Fn(u64) -> u64,
    (kind, verbose): (DistanceKind, bool),
    p: &Params,
) -> (usize, usize) {
    let (mut distractors, mut distractors_accepted) = (0, 0);
    for q in queries {
        for (parity, half) in halves.iter().enumerate() {
            if q.landmark.is_some_and(|l| same(l) % 2 == parity as u64) {
                continue;
            }
            distractors += 1;
            let v = recognise(&q.image, &q.quad, half, kind, p);
            let accepted = matches!(v.verdict, Verdict::Unique(_));
            distractors_accepted += usize::from(accepted);
            if verbose && accepted {
                println!("HALF {kind:?} {} {:?} accepted {:?}", q.file, q.landmark, v.candidates[0]);
            }
        }
    }
    (distractors, distractors_accepted)
}

/// Time of each step of recognition.
#[derive(Default)]
struct Steps {
    last: Option<Instant>,
    ms: BTreeMap<RecogniseStep, f64>,
}

impl StepListener for Steps {
    fn finished(&mut self, step: RecogniseStep) {
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

/// The same photographs with the quads that the detector finds. A detected quad belongs to the
/// labelled one it overlaps most, if by 0.3 at least: borders within it share less than the border
/// itself.
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
        let facts = detect(&*labelled[0].image, &p.detect, &mut NoTrace);
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
            let Verdict::Unique(id) = v.verdict else {
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
                        matched_border(quad, &v, p)
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

/// What the detector finds in every image in `folder`, and quads at random places of it: how many
/// are taken for a landmark.
fn distractors_in(
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
            if matches!(v.verdict, Verdict::Unique(_)) {
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
