//! Rendered sets of pictures of one object, each with its true camera: what
//! `waymark camera calibrate` answers.
//!
//! A set is a folder with a `truth.json`: `fx` (px), `kind`, `size_m` (width, height) and `views`
//! with a `file` each.

use crate::evaluate::{
    experiment::of_each,
    statistics::{median, quantile},
};
use anyhow::Context as _;
use cli::pictures;
use protos::api::CalibrationConstraintsBody;
use serde::{Deserialize, Serialize};
use server::calibrating::{CalibrationConstraints, calibrated_from_pictures};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};
use vision::{frame::GrayImage, pose::LandmarkSize};

/// A focal length within this share of the true one counts as right.
const RIGHT: f64 = 0.015;
/// An error beyond so many stated standard deviations was not announced.
const SILENT_SIGMAS: f64 = 3.0;

#[derive(Debug, Deserialize)]
struct Truth {
    fx: f64,
    kind: String,
    size_m: [f64; 2],
    views: Vec<View>,
}

#[derive(Debug, Deserialize)]
struct View {
    file: PathBuf,
}

/// The answer to one set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct RenderedSet {
    name: String,
    kind: String,
    fx_px: f64,
    answer: Answer,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Answer {
    /// Error and stated standard deviation of the focal length, as shares of the true one.
    Camera { error: f64, sigma: f64, warnings: usize },
    /// Why there is none.
    Refused { reason: String },
}

/// The folders below `folder` that hold a `truth.json`, by the number in their names.
pub(super) fn folders(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut all: Vec<PathBuf> = std::fs::read_dir(folder)
        .with_context(|| format!("cannot read {}", folder.display()))?
        .map(|entry| entry.map(|e| e.path()))
        .collect::<Result<_, _>>()?;
    all.retain(|path| path.join("truth.json").is_file());
    let number = |path: &PathBuf| name(path).parse::<u64>().unwrap_or(u64::MAX);
    all.sort_by_key(|path| (number(path), path.clone()));
    anyhow::ensure!(!all.is_empty(), "{}: no folder in it has a truth.json", folder.display());
    Ok(all)
}

fn name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

/// Calibrates from each set.
pub(super) fn evaluated(folders: &[PathBuf]) -> anyhow::Result<Vec<RenderedSet>> {
    of_each(folders, "sets", |_, folder| one(folder)).into_iter().collect()
}

fn one(folder: &Path) -> anyhow::Result<RenderedSet> {
    let file = folder.join("truth.json");
    let text = std::fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
    let truth: Truth =
        serde_json::from_slice(&text).with_context(|| format!("{} has no camera", file.display()))?;
    let images: Vec<GrayImage> = truth
        .views
        .iter()
        .map(|v| pictures::read(&folder.join(&v.file)).with_context(|| v.file.display().to_string()))
        .collect::<Result<_, _>>()?;
    let [width_m, height_m] = truth.size_m;
    let known = CalibrationConstraints::from(CalibrationConstraintsBody::default());
    let answer = match calibrated_from_pictures(&images, LandmarkSize { width_m, height_m }, &known) {
        Ok(found) => Answer::Camera {
            error: found.report.intrinsics.fx_px / truth.fx - 1.0,
            sigma: found.report.fx_sigma_px / truth.fx,
            warnings: found.report.warnings.len(),
        },
        Err(error) => Answer::Refused { reason: reason(&error.to_string()) },
    };
    Ok(RenderedSet { name: name(folder), kind: truth.kind, fx_px: truth.fx, answer })
}

/// The name that a refusal begins with, or all of it.
fn reason(text: &str) -> String {
    text.split_once(':').map_or(text, |(name, _)| name).to_owned()
}

/// Lines for people.
pub(super) fn lines(sets: &[RenderedSet]) -> Vec<String> {
    let mut kinds: Vec<&str> = sets.iter().map(|s| s.kind.as_str()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let mut lines = vec![summary("all", sets.iter())];
    if kinds.len() > 1 {
        lines.extend(kinds.iter().map(|kind| summary(kind, sets.iter().filter(|s| s.kind == *kind))));
    }
    for set in sets {
        lines.push(match &set.answer {
            Answer::Camera { error, sigma, warnings } => format!(
                "    {:<6} {:<8} fx {:7.1}: {:+.2} %, stated {:.2} % ({:.1} sigma){}",
                set.name,
                set.kind,
                set.fx_px,
                100.0 * error,
                100.0 * sigma,
                error.abs() / sigma,
                if *warnings > 0 { ", with cautions" } else { "" }
            ),
            Answer::Refused { reason } => format!("    {:<6} {:<8} refused: {reason}", set.name, set.kind),
        });
    }
    lines
}

/// Shares of all sets, refusals among them.
fn summary<'a>(what: &str, sets: impl Iterator<Item = &'a RenderedSet>) -> String {
    let (mut errors, mut sigmas, mut refused) = (vec![], vec![], BTreeMap::<&str, usize>::new());
    let (mut silent, mut count) = (0, 0);
    for set in sets {
        count += 1;
        match &set.answer {
            Answer::Camera { error, sigma, .. } => {
                silent += usize::from(error.abs() > SILENT_SIGMAS * sigma);
                errors.push(error.abs());
                sigmas.push(*sigma);
            }
            Answer::Refused { reason } => *refused.entry(reason).or_default() += 1,
        }
    }
    let right = errors.iter().filter(|e| **e <= RIGHT).count();
    let why: Vec<String> = refused.iter().map(|(reason, n)| format!("{n} {reason}")).collect();
    let percent = |of: Option<f64>| of.map_or_else(|| "-".to_owned(), |v| format!("{:.2}", 100.0 * v));
    format!(
        "  {what}: {count} sets, {:.3} within {} %, {silent} beyond {SILENT_SIGMAS} sigma unannounced, {} refused{}; error \
         of fx in percent: median {}, 90 % {}; stated: median {}",
        right as f64 / f64::from(count.max(1)),
        100.0 * RIGHT,
        refused.values().sum::<usize>(),
        if why.is_empty() { String::new() } else { format!(" ({})", why.join(", ")) },
        percent(median(&mut errors)),
        percent(quantile(&mut errors, 0.9)),
        percent(median(&mut sigmas)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_all_sets_and_unannounced_errors_are_counted() {
        let set = |answer| RenderedSet { name: "1".into(), kind: "canvas".into(), fx_px: 600.0, answer };
        let camera = |error, sigma| set(Answer::Camera { error, sigma, warnings: 0 });
        let refused = reason("border_unclear: 3 of 9 lines agree");
        let sets = [
            camera(0.001, 0.002),
            camera(-0.014, 0.002),
            camera(0.05, 0.02),
            set(Answer::Refused { reason: refused }),
        ];
        let text = lines(&sets).join("\n");
        assert!(text.contains("4 sets, 0.500 within 1.5 %, 1 beyond 3 sigma"), "{text}");
        assert!(text.contains("1 refused (1 border_unclear)") && text.contains("median 1.40"), "{text}");
    }

    #[test]
    fn sets_come_by_number_and_a_folder_without_sets_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert!(folders(folder.path()).unwrap_err().to_string().contains("truth.json"));
        for name in ["10", "9", "other"] {
            std::fs::create_dir(folder.path().join(name)).unwrap();
            std::fs::write(folder.path().join(name).join("truth.json"), "{}").unwrap();
        }
        let names: Vec<String> = folders(folder.path()).unwrap().iter().map(|p| name(p)).collect();
        assert_eq!(names, ["9", "10", "other"]);
        assert!(one(&folder.path().join("9")).unwrap_err().to_string().contains("has no camera"));
    }
}
