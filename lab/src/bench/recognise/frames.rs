//! Whole frames of a corridor whose posters are among the landmarks: names and processor time in
//! maps of several sizes, global and guided, and of SIFT with one index over all landmarks of one
//! of these maps.

use super::{
    super::peers::{HINT, Python, written},
    Args, MAP,
    guided::Guide,
    landmarks::{each_of, picture},
    scenes::Scenes,
    threads,
};
use crate::evaluate::statistics::median;
use cli::{clock::Clock, scratch, screen};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use vision::{
    detect::{DetectBuffers, detect_with},
    model::{LandmarkId, ModelSet},
    params::Params,
    pipeline::{FrameCamera, LandmarkDatabase, analyse_quads},
    recognise::{DistanceKind, Verdict},
    trace::{NoTrace, Stage, Trace},
};

/// The Python program.
const PROGRAM: &str = include_str!("../../../peers/sift.py");

/// Names that one method gave on all frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Named {
    /// Of the visible posters.
    pub(super) right: usize,
    pub(super) missed: usize,
    /// Names of landmarks that are not in the frame.
    pub(super) wrong: usize,
    /// Processor time a frame, median of each frame's least.
    pub(super) frame_ms: f64,
}

/// Frames in one map.
#[derive(Debug, Serialize)]
pub(super) struct InMap {
    pub(super) landmarks: usize,
    /// Global recognition in the whole map.
    pub(super) global: Named,
    /// The two parts of that, medians.
    pub(super) detection_ms: f64,
    pub(super) recognition_ms: f64,
    /// Guided recognition by a known pose.
    pub(super) guided: Named,
}

/// Frames by Waymark and by SIFT.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    pub(super) frames: usize,
    pub(super) visible: usize,
    pub(super) quads_per_frame: f64,
    pub(super) maps: Vec<InMap>,
    /// Among [`MAP`] landmarks.
    pub(super) sift: Option<Named>,
    pub(super) opencv: Option<String>,
    /// Waymark's times over SIFT's, in the map of as many landmarks.
    pub(super) global_ratio: Option<f64>,
    pub(super) guided_ratio: Option<f64>,
}

impl Scenes {
    fn named(&self, accepted: &[Vec<usize>], least_ms: &[f64]) -> Named {
        let mut named = Named { right: 0, missed: 0, wrong: 0, frame_ms: 0.0 };
        for ((accepted, wanted), present) in accepted.iter().zip(&self.wanted).zip(&self.present) {
            let right = wanted.iter().filter(|w| accepted.contains(w)).count();
            named.right += right;
            named.missed += wanted.len() - right;
            named.wrong += accepted.iter().filter(|a| !present.contains(a)).count();
        }
        named.frame_ms = median(&mut least_ms.to_vec()).unwrap_or(0.0);
        named
    }
}

/// Processor time up to the end of the stage before recognition, and of recognition.
struct Split {
    clock: Clock,
    recognition_ms: f64,
}

impl Trace for Split {
    fn finished(&mut self, stage: Stage) {
        if stage == Stage::Recognition {
            self.recognition_ms = self.clock.ms();
        }
    }
}

/// Names and least time of each frame.
struct Tally {
    accepted: Vec<Vec<usize>>,
    ms: Vec<f64>,
    recognition_ms: Vec<f64>,
}

impl Tally {
    fn new(frames: usize) -> Self {
        let never = vec![f64::INFINITY; frames];
        Self { accepted: vec![vec![]; frames], ms: never.clone(), recognition_ms: never }
    }

    fn put(&mut self, frame: usize, accepted: Vec<usize>, ms: f64) {
        (self.accepted[frame], self.ms[frame]) = (accepted, self.ms[frame].min(ms));
    }
}

/// One map with its tallies.
struct Timed<'a> {
    models: &'a ModelSet,
    guide: Guide,
    global: Tally,
    guided: Tally,
}

impl Timed<'_> {
    /// Recognises one frame both ways; returns the number of detected quads.
    fn frame(&mut self, i: usize, scenes: &Scenes, memory: &mut DetectBuffers, p: &Params) -> usize {
        let frame = &scenes.frames[i];
        let sizes = BTreeMap::new();
        let landmarks =
            LandmarkDatabase { models: self.models, sizes: &sizes, kind: DistanceKind::default() };
        let camera = FrameCamera::level(Some(&scenes.camera));
        let clock = Clock::start();
        let found = detect_with(memory, frame, &p.detect, &mut NoTrace);
        let mut split = Split { clock: Clock::start(), recognition_ms: 0.0 };
        let facts = analyse_quads(frame, found, camera, landmarks, p, &mut split);
        let ms = clock.ms();
        let least = &mut self.global.recognition_ms[i];
        *least = least.min(split.recognition_ms);
        let named = facts.quads.iter().filter_map(|q| q.recognition.as_ref()).filter_map(unique).collect();
        self.global.put(i, named, ms);
        let clock = Clock::start();
        let guided = self.guide.recognise(i, frame, &scenes.camera);
        let ms = clock.ms();
        self.guided.put(i, guided.observations.iter().filter_map(|s| index(s.landmark)).collect(), ms);
        facts.quads.len()
    }

    fn report(mut self, scenes: &Scenes) -> InMap {
        let mut detection: Vec<f64> =
            self.global.ms.iter().zip(&self.global.recognition_ms).map(|(all, part)| all - part).collect();
        InMap {
            landmarks: self.models.len(),
            global: scenes.named(&self.global.accepted, &self.global.ms),
            detection_ms: median(&mut detection).unwrap_or(0.0),
            recognition_ms: median(&mut self.global.recognition_ms).unwrap_or(0.0),
            guided: scenes.named(&self.guided.accepted, &self.guided.ms),
        }
    }
}

/// Runs all methods in turn on the same frames.
pub(super) fn run(
    args: &Args,
    first: u64,
    scenes: &Scenes,
    maps: &[ModelSet],
    p: &Params,
) -> anyhow::Result<Report> {
    let folder = scratch::Folder::new("bench")?;
    let mut sift = if args.no_peers { None } else { start(args, first, scenes, MAP, folder.path()) };
    let opencv = sift.as_ref().map(|(_, version)| version.clone());
    let n = scenes.frames.len();
    let timed = |models| {
        let guide = Guide::new(scenes, models, args.seed)?;
        Ok(Timed { models, guide, global: Tally::new(n), guided: Tally::new(n) })
    };
    let mut maps: Vec<Timed<'_>> = maps.iter().map(timed).collect::<anyhow::Result<_>>()?;
    let mut by_sift = Tally::new(n);
    let (mut memory, mut quads) = (DetectBuffers::default(), 0);
    let progress = screen::progress(args.rounds as usize * n, "frames");
    for round in 0..args.rounds {
        for i in 0..n {
            for (number, map) in maps.iter_mut().enumerate() {
                let found = map.frame(i, scenes, &mut memory, p);
                quads += if (round, number) == (0, 0) { found } else { 0 };
            }
            if let Some((running, _)) = &mut sift {
                match running.ask::<Answer>(&i.to_string()) {
                    Ok(answer) => by_sift.put(i, answer.accepted, answer.ms),
                    Err(why) => {
                        screen::complain(&format!("OpenCV is left out from here on: {why}"));
                        sift = None;
                    }
                }
            }
            progress.inc(1);
        }
    }
    progress.finish_and_clear();
    let maps: Vec<InMap> = maps.into_iter().map(|map| map.report(scenes)).collect();
    let sift = sift.map(|_| scenes.named(&by_sift.accepted, &by_sift.ms));
    let like = maps.iter().find(|m| m.landmarks == MAP);
    let ratio = |of: fn(&InMap) -> &Named| Some(of(like?).frame_ms / sift.as_ref()?.frame_ms);
    Ok(Report {
        frames: n,
        visible: scenes.wanted.iter().map(Vec::len).sum(),
        quads_per_frame: quads as f64 / n as f64,
        global_ratio: ratio(|m| &m.global),
        guided_ratio: ratio(|m| &m.guided),
        maps,
        sift,
        opencv,
    })
}

fn unique(verdict: &vision::recognise::RecognitionResult) -> Option<usize> {
    match verdict.verdict {
        Verdict::Unique(id) => index(id),
        Verdict::Unknown | Verdict::Ambiguous(_) => None,
    }
}

/// Ids count from 1.
fn index(id: LandmarkId) -> Option<usize> {
    usize::try_from(id.0).ok()?.checked_sub(1)
}

#[derive(Deserialize)]
struct Ready {
    version: String,
}

#[derive(Deserialize)]
struct Answer {
    ms: f64,
    accepted: Vec<usize>,
}

fn start(
    args: &Args,
    first: u64,
    scenes: &Scenes,
    landmarks: usize,
    folder: &std::path::Path,
) -> Option<(Python, String)> {
    let started = || {
        let pictures = each_of(landmarks, threads(), "drawing", |i| Ok(picture(first, i)?))
            .map_err(|e| e.to_string())?;
        let mut files = vec![landmarks.to_string().into()];
        files.extend(written(&pictures, folder, "landmark")?);
        files.extend(written(&scenes.frames, folder, "frame")?);
        screen::complain("OpenCV learns the landmarks");
        Python::start::<Ready>(&args.python, PROGRAM, &files)
    };
    match started() {
        Ok((python, ready)) => Some((python, ready.version)),
        Err(why) => {
            screen::complain(&format!("OpenCV is left out: {why}. To have it: {HINT}"));
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{super::scenes::number, *};
    use sim::building::Building;
    use std::sync::Arc;

    #[test]
    fn right_missed_and_wrong_names_are_counted() {
        let scenes = Scenes {
            frames: vec![],
            steps: vec![],
            building: Arc::new(Building::corridor(1)),
            camera: *sim::camera::Camera::vga().intrinsics(),
            wanted: vec![vec![1, 2], vec![], vec![3]],
            present: vec![vec![1, 2, 5], vec![], vec![3]],
        };
        // The first frame names one of two, one cut by the border, and one that is not there.
        let named = scenes.named(&[vec![2, 5, 9], vec![4], vec![3]], &[1.0, 5.0, 3.0]);
        assert_eq!(named, Named { right: 2, missed: 1, wrong: 2, frame_ms: 3.0 });
    }

    #[test]
    fn a_posters_name_gives_its_number() {
        assert_eq!((number("poster-12"), number("door-3")), (Some(12), None));
    }
}
