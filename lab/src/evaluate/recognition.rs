//! `waymark-lab evaluate recognition`: a server of its own is taught from a labelled set over HTTP, then recognises the
//! other pictures sent over zenoh. Right, wrong and missed identities, strangers refused and accepted, time.

use super::{
    statistics::median,
    truth::{Truth, TruthImage},
};
use anyhow::Context as _;
use client::{
    Capture, Delivery, LandmarkRegion, MapClient, RobotClient, RobotOptions,
    api::{Distance, Job, JobState, LandmarkStatus, NewMap},
    quad_corners,
    v1::{Answer, QuadAnswer, Verdict},
};
use serde::Serialize;
use server::{
    Server,
    cli::{scratch, screen},
};
use std::{collections::BTreeMap, path::PathBuf, time::Duration};
use vision::{
    geometry::{Corners, polygon},
    recognise::DistanceKind,
};

/// An answer belongs to a labelled quad from this overlap on, or when it lies inside it (an inner border).
const IOU_SAME: f64 = 0.5;
const INNER_SHARE: f64 = 0.9;
const MAP: &str = "evaluation";
/// As the settings have it.
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
    /// Generated views for each taught picture; left out, the server chooses.
    #[arg(long)]
    generated_views: Option<u32>,
    /// The distance that decides: both, correlation or hausdorff.
    #[arg(long, value_parser = server::cli::arg_parsers::distance)]
    distance: Option<DistanceKind>,
    /// End with one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    /// Name every labelled quad that was not answered rightly, with the nearest candidates.
    #[arg(long)]
    misses: bool,
}

/// What became of the labelled quads of one group.
#[derive(Debug, Default, Clone, Serialize)]
struct Tally {
    right: usize,
    wrong: usize,
    missed: usize,
    strangers_refused: usize,
    strangers_accepted: usize,
}

/// The figures of one set.
#[derive(Debug, Serialize)]
struct Report {
    set: String,
    taught: usize,
    /// Landmarks whose model passed its gates and is in use.
    active: usize,
    learn_s: f64,
    images: usize,
    #[serde(flatten)]
    tally: Tally,
    /// Median time from receipt to answer.
    ms_per_image: f64,
    /// Unique answers on things that nobody labelled.
    unlabelled_accepted: usize,
    unreadable: usize,
    /// Crops that fill their picture: they have no border to detect.
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
    let server = Server::start(scratch::private_server(folder.path())?).await?;
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
    let distance = args.distance.map(Distance::from).unwrap_or_default();
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
    let Some(corners) = quad_corners(quad) else { return false };
    let (a, b) = (labelled.points(), corners.points());
    polygon::iou(a, b) >= IOU_SAME || polygon::intersection_area(a, b) >= INNER_SHARE * corners.area_px2()
}

fn score(truth: &Truth, image: &TruthImage, answer: &Answer, args: &Args, report: &mut Report) {
    let unique: Vec<&QuadAnswer> = answer.quads.iter().filter(|q| q.verdict() == Verdict::Unique).collect();
    for labelled in &image.quads {
        let named: Vec<&QuadAnswer> =
            unique.iter().copied().filter(|q| belongs(&labelled.corners, q)).collect();
        let names: Vec<&str> = named.iter().map(|q| q.landmark.as_str()).collect();
        let tally = count(truth, labelled.landmark.as_deref(), &names);
        if args.misses && tally.right + tally.strangers_refused == 0 {
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
                    "{}: {} seen where nothing is labelled",
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
        None if names.is_empty() => tally.strangers_refused = 1,
        None => tally.strangers_accepted = 1,
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
        self.strangers_refused += other.strangers_refused;
        self.strangers_accepted += other.strangers_accepted;
    }

    fn line(&self) -> String {
        format!(
            "right {}, wrong {}, missed {}; strangers refused {}, accepted {}",
            self.right, self.wrong, self.missed, self.strangers_refused, self.strangers_accepted
        )
    }
}

fn explain(image: &TruthImage, landmark: Option<&str>, labelled: &Corners, answer: &Answer) {
    let near = answer.quads.iter().filter(|q| belongs(labelled, q));
    let mut text = format!("{} is {landmark:?}:", image.file);
    let mut seen = false;
    for quad in near {
        seen = true;
        let candidates: Vec<String> = quad
            .candidates
            .iter()
            .take(3)
            .map(|c| {
                format!(
                    "{} ratio {:.2} C {:.2} H {:.1?} {}",
                    c.landmark, c.ratio, c.correlation, c.hausdorff, c.refusal
                )
            })
            .collect();
        text.push_str(&[" [", quad.verdict().as_str_name(), " ", &candidates.join("; "), "]"].concat());
    }
    if !seen {
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
