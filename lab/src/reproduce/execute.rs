//! Runs the commands of the rows, each once though several rows read its report, in a process of
//! its own with the arguments that are printed. The report of each is kept in the folder: a later
//! start of the same build reads it instead.

use super::{
    Args,
    figures::{self, Figures, Outcome, RowFigures, Run},
    machine,
    row::{Command, Row},
    rows,
};
use anyhow::Context as _;
use cli::screen;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process,
    time::Instant,
};
use vision::params::preset::Preset;

/// Expected of a smoke test, whichever it is.
const QUICK_S: u32 = 10;
/// Most characters of a reason.
const MAX_REASON: usize = 120;
/// Most characters of a file name.
const MAX_NAME: usize = 120;

/// One command to run.
#[derive(Debug)]
pub(super) struct Planned {
    words: Vec<String>,
    sets: &'static [&'static str],
    /// Expected.
    pub(super) seconds: u32,
}

/// What a command printed, or why it did not.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Report {
    build: String,
    words: Vec<String>,
    seconds: f64,
    printed: Result<Value, String>,
}

/// The arguments after `waymark-lab`.
pub(super) fn words(line: &str, preset: Option<Preset>) -> Vec<String> {
    let preset = preset.filter(|preset| *preset != Preset::Default);
    let preset = preset.map_or_else(Vec::new, |preset| vec!["--preset", preset.word()]);
    std::iter::once("evaluate")
        .chain(line.split_whitespace())
        .chain(preset)
        .chain(["--json"])
        .map(str::to_owned)
        .collect()
}

/// The command as it is shown.
fn shown(words: &[String]) -> String {
    let words = words.iter().filter(|word| *word != "--json").cloned().collect::<Vec<_>>();
    format!("waymark-lab {}", words.join(" "))
}

fn chosen<'a>(only: &'a [&str]) -> impl Iterator<Item = &'static Row> + 'a {
    rows().filter(|row| only.is_empty() || only.contains(&row.id))
}

/// The runs of a command under the presets that are asked for.
fn runs(command: &Command, preset: Option<Preset>, quick: bool) -> Vec<(Option<Preset>, Vec<String>)> {
    let line = if quick { command.quick } else { command.full };
    let runs =
        command.presets.runs().iter().filter(|run| run.is_none() || preset.is_none() || **run == preset);
    runs.map(|run| (*run, words(line, *run))).collect()
}

/// All commands in the order of the rows, each once.
pub(super) fn plan(preset: Option<Preset>, only: &[&str], quick: bool) -> Vec<Planned> {
    let mut plan: Vec<Planned> = Vec::new();
    for command in chosen(only).flat_map(|row| row.commands) {
        for (_, words) in runs(command, preset, quick) {
            if plan.iter().all(|planned| planned.words != words) {
                let seconds = if quick { QUICK_S } else { command.seconds };
                plan.push(Planned { words, sets: command.sets, seconds });
            }
        }
    }
    plan
}

/// Runs what is not known yet, and gathers the figures.
pub(super) fn all(args: &Args) -> anyhow::Result<Figures> {
    let program = std::env::current_exe()?;
    let build = machine::digest(&program)?;
    let folder = args.out.join("reports");
    fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let plan = plan(args.preset, &args.only, args.quick);
    let mut reports = BTreeMap::new();
    let mut progress = Progress::new(&plan);
    for planned in &plan {
        let path = folder.join(file_name(&planned.words));
        let kept = kept(&path, &build, &planned.words);
        progress.starts(planned, kept.is_some());
        let report = match kept {
            Some(report) => report,
            None => run(&program, &build, planned, &args.data),
        };
        if report.printed.is_ok() {
            fs::write(&path, serde_json::to_vec(&report)?).with_context(|| path.display().to_string())?;
        }
        progress.ends(planned, &report);
        reports.insert(planned.words.clone(), report);
    }
    let minutes = reports.values().map(|report| report.seconds).sum::<f64>() / 60.0;
    let rows = chosen(&args.only).map(|row| row_figures(row, args, &reports)).collect();
    let (commit, changed) = machine::commit();
    Ok(Figures {
        date: machine::date(),
        commit,
        changed,
        processor: machine::processor(),
        cores: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        minutes,
        quick: args.quick,
        rows,
    })
}

fn row_figures(row: &Row, args: &Args, reports: &BTreeMap<Vec<String>, Report>) -> RowFigures {
    let of = |command: &Command| {
        let runs = runs(command, args.preset, args.quick);
        let run = |(preset, words): (Option<Preset>, Vec<String>)| {
            let report = reports.get(&words)?;
            let figures = report.printed.as_ref().map_err(Clone::clone);
            let figures = figures.and_then(|printed| {
                figures::measured(command, printed).map_err(|error| shortened(&format!("{error:#}")))
            });
            let seed = words.iter().skip_while(|word| *word != "--seed").nth(1).and_then(|n| n.parse().ok());
            let stated =
                report.printed.as_ref().ok().and_then(|printed| figures::find(printed, "0/seed")?.as_u64());
            Some(Run {
                command: shown(&words),
                preset,
                seed: seed.or(stated),
                seconds: report.seconds,
                outcome: figures.map_or_else(Outcome::NotMeasured, Outcome::Figures),
            })
        };
        runs.into_iter().filter_map(run).collect::<Vec<_>>()
    };
    RowFigures {
        id: row.id.to_owned(),
        title: row.title.to_owned(),
        paper: row.paper.to_owned(),
        runs: row.commands.iter().flat_map(of).collect(),
    }
}

/// The report of the same command by the same build.
fn kept(path: &Path, build: &str, words: &[String]) -> Option<Report> {
    let report: Report = serde_json::from_slice(&fs::read(path).ok()?).ok()?;
    (report.build == build && report.words == words).then_some(report)
}

fn file_name(words: &[String]) -> PathBuf {
    let name: String = words[1..words.len() - 1].join("_");
    let plain = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let mut name: String = name.chars().map(plain).collect();
    if name.len() > MAX_NAME {
        // What is cut off differs between commands: a digest stands for it.
        let digest = words.iter().flat_map(|word| word.bytes());
        let digest = digest.fold(0_u64, |sum, byte| sum.wrapping_mul(31).wrapping_add(u64::from(byte)));
        name = format!("{}-{digest:016x}", &name[..MAX_NAME]);
    }
    PathBuf::from(name + ".json")
}

fn run(program: &Path, build: &str, planned: &Planned, data: &Path) -> Report {
    let start = Instant::now();
    let absent: Vec<&str> = planned.sets.iter().filter(|set| !data.join(set).is_dir()).copied().collect();
    let printed = if absent.is_empty() {
        printed(program, &planned.words, data).map_err(|error| shortened(&format!("{error:#}")))
    } else {
        Err(format!("set {} absent", absent.join(", ")))
    };
    let seconds = start.elapsed().as_secs_f64();
    Report { build: build.to_owned(), words: planned.words.clone(), seconds, printed }
}

/// The JSON objects that a command prints, as a list.
fn printed(program: &Path, words: &[String], data: &Path) -> anyhow::Result<Value> {
    let mut command = process::Command::new(program);
    if data.is_dir() {
        command.current_dir(data);
    }
    let done = command.args(words).stdin(process::Stdio::null()).output().context("cannot start it")?;
    if !done.status.success() {
        let text = String::from_utf8_lossy(&done.stderr).into_owned();
        let said = text.lines().find(|line| line.contains("error:")).or_else(|| text.lines().next_back());
        anyhow::bail!("{}: {}", done.status, said.unwrap_or_default());
    }
    let objects = serde_json::Deserializer::from_slice(&done.stdout).into_iter().collect::<Result<_, _>>();
    objects.map(Value::Array).context("its report is no JSON")
}

fn shortened(text: &str) -> String {
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    line.chars().take(MAX_REASON).collect()
}

/// How far the work is, on standard error.
struct Progress {
    at: usize,
    count: usize,
    /// Expected of what is to be done, and of what was run, with how long that took.
    left_s: f64,
    planned_s: f64,
    taken_s: f64,
}

impl Progress {
    fn new(plan: &[Planned]) -> Self {
        let left_s = plan.iter().map(|planned| f64::from(planned.seconds)).sum();
        Self { at: 0, count: plan.len(), left_s, planned_s: 0.0, taken_s: 0.0 }
    }

    fn left_minutes(&self) -> f64 {
        let pace = if self.planned_s > 0.0 { self.taken_s / self.planned_s } else { 1.0 };
        self.left_s * pace / 60.0
    }

    fn starts(&mut self, planned: &Planned, is_kept: bool) {
        self.at += 1;
        let (at, count, command) = (self.at, self.count, shown(&planned.words));
        screen::complain(&if is_kept {
            format!("{at} of {count}, kept: {command}")
        } else {
            format!("{at} of {count}, about {:.0} min left: {command}", self.left_minutes().ceil())
        });
        self.left_s -= f64::from(planned.seconds);
        if !is_kept {
            self.planned_s += f64::from(planned.seconds);
        }
    }

    fn ends(&mut self, planned: &Planned, report: &Report) {
        match &report.printed {
            Ok(_) => self.taken_s += report.seconds,
            Err(reason) => {
                self.planned_s -= f64::from(planned.seconds);
                screen::complain(&format!("  not measured: {reason}"));
            }
        }
    }
}
