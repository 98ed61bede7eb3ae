//! `waymark-lab reproduce`: every figure of accuracy, measured by the commands that are printed
//! beside it, and the tables of docs/EVALUATION.md and README.md from them.
//!
//! `row` says what a row is, `paper_rows`, `set_rows` and `further_rows` list them; `execute` runs
//! their commands; `figures` takes the numbers from the reports; `comparison` says where the
//! paper's preset is better; `documents` writes them.

mod figures;
mod row;
mod paper_rows;
mod further_rows;
mod set_rows;
mod machine;
mod execute;
mod comparison;
mod table;
mod documents;

use anyhow::Context as _;
use cli::screen;
use row::Row;
use std::path::PathBuf;
use vision::params::preset::Preset;

/// `waymark-lab reproduce`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Only this preset, `default` or `paper`; both if absent.
    #[arg(long, value_name = "NAME")]
    preset: Option<Preset>,
    /// Folder of figures.json, table.md and the report of each command. What it holds of the same
    /// build is kept: an interrupted run goes on.
    #[arg(long, value_name = "DIR", default_value = "reproduced")]
    out: PathBuf,
    /// Only these rows.
    #[arg(long, value_name = "IDS", value_delimiter = ',', value_parser = id)]
    only: Vec<&'static str>,
    /// Few views of few landmarks, to see that all works; no figure counts.
    #[arg(long)]
    quick: bool,
    /// Folder of the sets made by others; what it lacks is not measured, and counted at the end.
    #[arg(long, value_name = "DIR", env = "WAYMARK_DATA", default_value = "../shared/data")]
    data: PathBuf,
    /// Store the figures of a whole run in docs/results and write the tables of the documents from
    /// them. Nothing is run.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["check", "only", "quick", "preset"])]
    render: Option<PathBuf>,
    /// Compare the tables of the documents with the stored figures. Nothing is run.
    #[arg(long, conflicts_with_all = ["only", "quick", "preset"])]
    check: bool,
}

/// All rows in the order of the table.
fn rows() -> impl Iterator<Item = &'static Row> {
    paper_rows::ROWS.iter().chain(&set_rows::SETS).chain(&further_rows::BEYOND)
}

fn id(text: &str) -> Result<&'static str, String> {
    let known = || rows().map(|row| row.id);
    known()
        .find(|id| id.eq_ignore_ascii_case(text))
        .ok_or_else(|| format!("none of {}", known().collect::<Vec<_>>().join(", ")))
}

/// Measures and stores; or writes or compares the documents.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    if args.check {
        return documents::check();
    }
    if let Some(file) = &args.render {
        return documents::render(file);
    }
    anyhow::ensure!(
        args.quick || !cfg!(debug_assertions),
        "this is a debug build, which would take days: cargo run --release -p lab -- reproduce"
    );
    let figures = execute::all(args)?;
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let text = table::evaluation(&figures);
    for (name, content) in
        [("figures.json", serde_json::to_string_pretty(&figures)? + "\n"), ("table.md", text.clone())]
    {
        let path = args.out.join(name);
        std::fs::write(&path, content).with_context(|| path.display().to_string())?;
    }
    screen::say(text.trim_end());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cli;
    use clap::Parser as _;

    #[test]
    fn every_command_is_one_that_the_program_takes() {
        for command in rows().flat_map(|row| row.commands) {
            for line in [command.full, command.quick] {
                for preset in command.presets.runs() {
                    let words = execute::words(line, *preset);
                    let parsed = Cli::try_parse_from(std::iter::once("waymark-lab".to_owned()).chain(words));
                    let error = parsed.err().map(|error| error.to_string());
                    assert!(error.is_none(), "{line}: {error:?}");
                }
            }
        }
    }

    #[test]
    fn rows_have_ids_of_their_own_and_the_readme_shows_figures_that_exist() {
        let ids: std::collections::BTreeSet<&str> = rows().map(|row| row.id).collect();
        assert_eq!(ids.len(), rows().count());
        for n in 1..=14 {
            assert!(ids.contains(format!("E{n}").as_str()), "E{n}");
        }
        for highlight in &row::HIGHLIGHTS {
            let row = rows().find(|row| row.id == highlight.row).unwrap();
            let mut figures = row.commands.iter().flat_map(|command| command.figures);
            assert!(figures.any(|figure| figure.name == highlight.figure), "{highlight:?}");
        }
        assert!(rows().flat_map(|row| row.commands).all(|command| !command.figures.is_empty()));
        assert_eq!((id("e10").unwrap(), id("E15").is_err()), ("E10", true));
    }

    /// Both presets on two idle cores.
    #[test]
    fn the_whole_is_planned_to_take_at_most_two_hours() {
        let seconds: u32 = execute::plan(None, &[], false).iter().map(|planned| planned.seconds).sum();
        assert!(seconds <= 2 * 3600, "{seconds} s");
    }
}
