//! A server under load: in a process of its own, encrypted, while it also learns. The robots are a
//! second process. In: how many robots send how often. Out: shares of the frames, percentiles of
//! the time from the intended sending of a frame to its answer, processor time and memory of both
//! processes, and whether the server's counters add up with what was sent.

mod generator;
mod plan;
mod process;
mod report;
mod site;

pub(super) use generator::{Args as GeneratorArgs, run as generate};

use anyhow::Context as _;
use cli::{scratch, screen};
use plan::{Outcome, Phase, Plan};
use process::{ServerChild, Watch};
use server::config::{Config, RawConfig};
use site::{Lessons, Site};
use std::{path::PathBuf, process::Stdio, time::Duration};

/// Name of the subcommand that plays the robots.
pub(super) const GENERATOR: &str = "load-generator";
/// `waymark-lab bench load`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Robots, each with one camera and a certificate of its own.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1000))]
    robots: u32,
    /// Frames a second of each robot.
    #[arg(long, default_value_t = 4.0)]
    rate: f64,
    /// Length of a phase.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(5..=7200))]
    seconds: u32,
    /// Overload: between two phases as usual, half of the robots send so much more that all
    /// together send so many times as much as usual.
    #[arg(long)]
    factor: Option<f64>,
    /// Soak: so many minutes, with robots that come and go, refused messages and changes of the map
    /// mixed in.
    #[arg(long, conflicts_with = "factor")]
    minutes: Option<u32>,
    /// Landmarks of the lesson that runs all the time; 0: none.
    #[arg(long, default_value_t = 287)]
    lesson: u32,
    /// Distinct frames along the drive.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(2..=1000))]
    frames: u32,
    /// When frames are searched for all landmarks, the server's setting `search_frames`: otherwise
    /// expected landmarks alone answer them.
    #[arg(long, default_value = "unless_busy", value_parser = ["every", "unless_busy", "scheduled"])]
    search_frames: String,
    /// Age beyond which no work begins on a frame, ms.
    #[arg(long, default_value_t = 500)]
    deadline_ms: u32,
    /// Vision threads of the server; 0: one per core.
    #[arg(long, default_value_t = 0)]
    workers: u32,
    /// Seed of building and drive.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The server's program; the one beside this program by default.
    #[arg(long)]
    program: Option<PathBuf>,
    /// Print the figures as one JSON object, too.
    #[arg(long)]
    json: bool,
}

impl Args {
    fn phases(&self) -> Vec<Phase> {
        let seconds = f64::from(self.seconds);
        let usual = |name: &str, seconds| Phase { name: name.to_owned(), seconds, factor: 1.0 };
        match (self.factor, self.minutes) {
            (Some(factor), _) => vec![
                usual("before", seconds / 2.0),
                Phase { name: "overload".into(), seconds, factor },
                usual("after", seconds / 2.0),
            ],
            (None, Some(minutes)) => vec![usual("soak", 60.0 * f64::from(minutes))],
            (None, None) => vec![usual("load", seconds)],
        }
    }
}

/// Runs the benchmark.
pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    runtime.block_on(measured(args))
}

async fn measured(args: &Args) -> anyhow::Result<()> {
    let folder = scratch::Folder::new("load")?;
    let beside = std::env::current_exe()?.with_file_name(format!("waymark{}", std::env::consts::EXE_SUFFIX));
    let program = args.program.clone().unwrap_or(beside);
    let settings = [
        ("WAYMARK_LIMITS__FRAME_DEADLINE_MS", args.deadline_ms.to_string()),
        ("WAYMARK_SEARCH_FRAMES", args.search_frames.clone()),
        ("WAYMARK_WORKERS", args.workers.to_string()),
        ("WAYMARK_LIMITS__LANDMARKS", "2000".to_owned()),
    ];
    let server = ServerChild::start(&program, &folder.path().join("data"), &settings).await?;
    screen::say(&format!("memory ceiling of these settings: {} MB", ceiling_mb(args)?));
    let site = Site::new(&server, folder.path(), args.seed);
    site.teach().await?;
    let frames = site.render(args.frames as usize, args.rate)?;
    let robots = site.enrol(args.robots as usize).await?;
    let lessons = Lessons::begin(&site, args.lesson as usize).await?;
    let plan = Plan {
        endpoint: server.zenoh.clone(),
        authority: folder.path().join("data").join("tls").join("authority.pem"),
        folder: frames,
        frames: args.frames as usize,
        seed: args.seed,
        rate_hz: args.rate,
        robots,
        phases: args.phases(),
        has_faults: args.minutes.is_some(),
    };
    let before = site.counters().await?;
    let file = folder.path().join("plan.json");
    std::fs::write(&file, serde_json::to_vec(&plan)?)?;
    let watch = Watch::begin(server.id());
    let outcome = generated(&file, &plan, &site, args.minutes.is_some()).await?;
    let seen = watch.end().await;
    let counters = site.counters().await?.since(&before);
    let lessons = lessons.end().await?;
    report::print(args, &plan, &outcome, &seen, &counters, &lessons);
    if args.json {
        screen::say(&serde_json::to_string(&report::figures(&plan, &outcome, &seen, &counters))?);
    }
    server.stop().await
}

/// The most memory that the server's settings allow, MB.
fn ceiling_mb(args: &Args) -> anyhow::Result<usize> {
    let raw = RawConfig { workers: args.workers as usize, ..RawConfig::default() };
    Ok(Config::try_from(raw)?.memory_ceiling_mb())
}

/// Lets the other process play the robots, and changes the map meanwhile if there are faults.
async fn generated(
    file: &std::path::Path,
    plan: &Plan,
    site: &Site<'_>,
    has_faults: bool,
) -> anyhow::Result<Outcome> {
    let mut child = tokio::process::Command::new(std::env::current_exe()?)
        .args(["bench", GENERATOR])
        .arg(file)
        .stdout(Stdio::piped())
        .kill_on_drop(true)
        .spawn()
        .context("the robots' process does not start")?;
    let mut stdout = child.stdout.take().context("its output")?;
    let reading = async {
        let mut text = Vec::new();
        tokio::io::AsyncReadExt::read_to_end(&mut stdout, &mut text).await?;
        anyhow::Ok(text)
    };
    let faults = async {
        if !has_faults {
            std::future::pending::<()>().await;
        }
        loop {
            tokio::time::sleep(Duration::from_secs(5)).await;
            if let Err(error) = site.disturb().await {
                return anyhow::Result::<Vec<u8>>::Err(error);
            }
        }
    };
    let text = tokio::select! {
        text = reading => text?,
        failed = faults => failed?,
    };
    anyhow::ensure!(child.wait().await?.success(), "the robots' process has failed");
    let outcome: Outcome = serde_json::from_slice(&text).context("the robots' figures")?;
    anyhow::ensure!(outcome.robots.len() == plan.robots.len(), "a robot without figures");
    Ok(outcome)
}
