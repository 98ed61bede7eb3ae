//! `waymark-lab evaluate recognition`: teaches a server of its own from a labelled set over HTTP,
//! then sends the other pictures over zenoh. Counts right, wrong and missed names and distractors
//! refused and accepted; measures time.

use super::{
    statistics::median,
    truth::{Truth, TruthImage},
};
use anyhow::Context as _;
use cli::{scratch, screen};
use client::{
    Capture, Delivery, LandmarkRegion, MapClient, RobotClient, RobotOptions,
    api::{Distance, Job, JobState, LandmarkStatus, NewMap},
    quad_corners,
    v1::{Answer, QuadAnswer, Verdict},
};
use serde::Serialize;
use server::Server;
use std::{collections::BTreeMap, path::PathBuf, time::Duration};
use vision::{
    geometry::{Corners, polygon},
    params::preset::Preset,
    recognise::DistanceKind,
};

/// An answer belongs to a labelled quad from this overlap on, or if it lies inside it (an inner
/// border).
const IOU_SAME: f64 = 0.5;
const INNER_SHARE: f64 = 0.9;
const MAP: &str = "evaluation";
/// Default of the settings.
const FLEET: &str = "default";
const ROBOT: &str = "evaluation";
const CAMERA: &str = "photographs";
/// Longest wait for one answer.
const ANSWER_TIMEOUT: Duration = Duration::from_mins(1);

/// `waymark-lab evaluate recognition`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder in the evaluation format (with a truth.json that has `teach`).
    set: PathBuf,
    /// Generated views for each taught picture; default: the server's choice.
    #[arg(long)]
    generated_views: Option<u32>,
    /// Detector and decision of the map.
    #[arg(long, value_name = "NAME", default_value = "default")]
    preset: Preset,
    /// The distance that decides: both, correlation or hausdorff; otherwise that of the preset.
    #[arg(long, value_parser = cli::arg_parsers::distance)]
    distance: Option<DistanceKind>,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    /// Name every labelled quad with a wrong or no name, with its nearest match candidates.
    #[arg(long)]
    misses: bool,
}

/// Outcomes of the labelled quads of one group.
#[derive(Debug, Default, Clone, Serialize)]
struct Tally {
    right: usize,
    wrong: usize,
    missed: usize,
    distractors_refused: usize,
    distractors_accepted: usize,
}

/// The figures of one set.
#[derive(Debug, Serialize)]
struct Report {
    set: String,
    taught: usize,
    /// Landmarks with an active model.
    active: usize,
    learn_s: f64,
    images: usize,
    #[serde(flatten)]
    tally: Tally,
    /// Median time from receipt to answer.
    ms_per_image: f64,
    /// Unique answers where nothing is labelled.
    unlabelled_accepted: usize,
    unreadable: usize,
    /// Crops that fill their picture and so have no border to detect; left out.
    crops_left_out: usize,
    by_stratum: BTreeMap<String, Tally>,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let truth = Truth::read(&args.set)?;
    anyhow::ensure!(!truth.teach.is_empty(), "{} has nothing to teach", args.set.display());
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let report = runtime.block_on(evaluate(&truth, args))?;
    if args.json {
        screen::say(&serde_json::to_string(&report)?);
    } else {
        screen::say(&table(&report));
    }
    Ok(())
}

async fn evaluate(truth: &Truth, args: &Args) -> anyhow::Result<Report> {
    let folder = scratch::Folder::new("evaluate")?;
    let server = Server::start(scratch::private_server(folder.path(), args.preset)?).await?;
    let maps = MapClient::new(&format!("http://{}", server.http_addr))?;
    let mut report = Report {
        set: truth.name.clone(),
        taught: truth.teach.len(),
        active: 0,
        learn_s: 0.0,
        images: 0,
        tally: Tally::default(),
        ms_per_image: 0.0,
        unlabelled_accepted: 0,
        unreadable: 0,
        crops_left_out: 0,
        by_stratum: BTreeMap::new(),
    };
    teach(truth, args, &maps, &mut report).await?;
    maps.put_robot(ROBOT, MAP).await?;
    let options =
        RobotOptions { delivery: Delivery::Every, ..RobotOptions::new(&server.zenoh_endpoint, FLEET, ROBOT) };
    let robot = RobotClient::connect(&options).await?;
    let mut latencies_ms = Vec::new();
    let progress = screen::progress(truth.images.len(), "recognising");
    for image in &truth.images {
        progress.inc(1);
        if image.whole_image {
            report.crops_left_out += 1;
            continue;
        }
        let Ok(bytes) = std::fs::read(&image.path) else {
            report.unreadable += 1;
            screen::complain(&format!("cannot read {}", image.path.display()));
            continue;
        };
        let capture = Capture::encoded(bytes)?.with_deadline_ms(ANSWER_TIMEOUT.as_millis() as u32);
        let answer = robot.recognise(CAMERA, capture, ANSWER_TIMEOUT).await?;
        if let Some(rejection) = &answer.rejection {
            report.unreadable += 1;
            screen::complain(&format!("{}: {} ({})", image.file, rejection.detail, rejection.code));
            continue;
        }
        report.images += 1;
        latencies_ms.push(answer.latency_ms);
        score(truth, image, &answer, args, &mut report);
    }
    progress.finish_and_clear();
    report.ms_per_image = median(&mut latencies_ms).unwrap_or(0.0);
    robot.close().await?;
    server.stop().await;
    Ok(report)
}

async fn teach(truth: &Truth, args: &Args, maps: &MapClient, report: &mut Report) -> anyhow::Result<()> {
    let distance = args.distance.map(Distance::from);
    maps.create_map(&NewMap { distance, ..NewMap::new(MAP) }).await?;
    let progress = screen::progress(truth.teach.len(), "teaching");
    for (path, landmark) in &truth.teach {
        if maps.landmark(MAP, landmark).await.is_err() {
            maps.add_landmark(MAP, landmark, None, None).await?;
        }
        let image = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        maps.upload_view(MAP, landmark, image, LandmarkRegion::WholeImage).await?;
        progress.inc(1);
    }
    progress.finish_and_clear();
    let start = std::time::Instant::now();
    let job = maps.learn(MAP, None, args.generated_views).await?;
    let bar = screen::progress(1000, "learning");
    let job = maps
        .wait_for_job(job, Duration::from_hours(2), |job: &Job| {
            bar.set_position((job.progress * 1000.0) as u64);
        })
        .await?;
    bar.finish_and_clear();
    anyhow::ensure!(job.state == JobState::Done, "learning ended as {:?}: {}", job.state, job.message);
    report.learn_s = start.elapsed().as_secs_f64();
    let landmarks = maps.landmarks(MAP).await?;
    report.active = landmarks.iter().filter(|l| l.status == LandmarkStatus::Active).count();
    if args.misses {
        for landmark in landmarks.iter().filter(|l| l.status != LandmarkStatus::Active) {
            screen::complain(&format!("not active: {} {:?}", landmark.name, landmark.failed_gates));
        }
    }
    Ok(())
}

fn belongs(labelled: &Corners, quad: &QuadAnswer) -> bool {
    quad_corners(quad).is_some_and(|corners| is_on(labelled, &corners))
}

/// Whether a quad of an answer shows a labelled one or an inner border of it.
pub(crate) fn is_on(labelled: &Corners, quad: &Corners) -> bool {
    let (a, b) = (labelled.points(), quad.points());
    polygon::iou(a, b) >= IOU_SAME || polygon::intersection_area(a, b) >= INNER_SHARE * quad.area_px2()
}

fn score(truth: &Truth, image: &TruthImage, answer: &Answer, args: &Args, report: &mut Report) {
    let unique: Vec<&QuadAnswer> = answer.quads.iter().filter(|q| q.verdict() == Verdict::Unique).collect();
    for labelled in &image.quads {
        let named: Vec<&QuadAnswer> =
            unique.iter().copied().filter(|q| belongs(&labelled.corners, q)).collect();
        let names: Vec<&str> = named.iter().map(|q| q.landmark.as_str()).collect();
        let tally = count(truth, labelled.landmark.as_deref(), &names);
        if args.misses && tally.right + tally.distractors_refused == 0 {
            explain(image, labelled.landmark.as_deref(), &labelled.corners, answer);
        }
        report.tally.add(&tally);
        report.by_stratum.entry(image.stratum.clone()).or_default().add(&tally);
    }
    for quad in unique {
        if !image.quads.iter().any(|labelled| belongs(&labelled.corners, quad)) {
            report.unlabelled_accepted += 1;
            if args.misses {
                screen::complain(&format!(
                    "{}: {} named where nothing is labelled",
                    image.file, quad.landmark
                ));
            }
        }
    }
}

/// One labelled quad against the landmarks named on it.
fn count(truth: &Truth, landmark: Option<&str>, names: &[&str]) -> Tally {
    let mut tally = Tally::default();
    match landmark {
        None if names.is_empty() => tally.distractors_refused = 1,
        None => tally.distractors_accepted = 1,
        Some(_) if names.is_empty() => tally.missed = 1,
        Some(landmark) if names.iter().all(|name| truth.same_landmark(name, landmark)) => tally.right = 1,
        Some(_) => tally.wrong = 1,
    }
    tally
}

impl Tally {
    fn add(&mut self, other: &Tally) {
        self.right += other.right;
        self.wrong += other.wrong;
        self.missed += other.missed;
        self.distractors_refused += other.distractors_refused;
        self.distractors_accepted += other.distractors_accepted;
    }

    fn line(&self) -> String {
        format!(
            "right {}, wrong {}, missed {}; distractors refused {}, accepted {}",
            self.right, self.wrong, self.missed, self.distractors_refused, self.distractors_accepted
        )
    }
}

fn explain(image: &TruthImage, landmark: Option<&str>, labelled: &Corners, answer: &Answer) {
    let near = answer.quads.iter().filter(|q| belongs(labelled, q));
    let mut text = format!("{} is {landmark:?}:", image.file);
    let mut is_named = false;
    for quad in near {
        is_named = true;
        let candidates: Vec<String> = quad
            .candidates
            .iter()
            .take(3)
            .map(|c| {
                format!(
                    "{} ratio {:.2?} C {:.2?} H {:.1?} {}",
                    c.landmark, c.ratio, c.correlation, c.hausdorff, c.refusal
                )
            })
            .collect();
        text.push_str(&[" [", quad.verdict().as_str_name(), " ", &candidates.join("; "), "]"].concat());
    }
    if !is_named {
        text += " no quad there";
    }
    screen::complain(&text);
}

fn table(report: &Report) -> String {
    let mut lines = vec![
        format!(
            "{}: {} landmarks taught, {} active, learnt in {:.1} s",
            report.set, report.taught, report.active, report.learn_s
        ),
        format!("  {} images, median {:.1} ms from receipt to answer", report.images, report.ms_per_image),
        format!("  all: {}", report.tally.line()),
        format!("  accepted where nothing is labelled: {}", report.unlabelled_accepted),
        format!("  crops without a border, left out: {}", report.crops_left_out),
    ];
    lines.extend(report.by_stratum.iter().map(|(name, tally)| format!("  {name}: {}", tally.line())));
    lines.join("\n")
}
