//! What commands show: results on standard output, everything else on standard error.

use comfy_table::{ContentArrangement, presets};
use indicatif::{ProgressBar, ProgressStyle};
use std::{
    ffi::OsStr,
    io::{IsTerminal, Write as _},
};

/// Escape sequences of terminals.
const BOLD: &str = "\x1b[1m";
const PLAIN: &str = "\x1b[0m";

/// One result line on standard output. A closed pipe (`| head`) ends the program quietly.
pub fn say(line: &str) {
    if writeln!(std::io::stdout(), "{line}").is_err() {
        std::process::exit(0);
    }
}

/// One line on standard error.
pub fn complain(line: &str) {
    // With standard error gone there is nobody left to tell.
    writeln!(std::io::stderr(), "{line}").ok();
}

/// Whether text on a stream may have colours: a terminal, and nobody asked for none
/// (<https://no-color.org>).
pub fn has_colour(stream: &impl IsTerminal) -> bool {
    may_colour(stream.is_terminal(), std::env::var_os("NO_COLOR").as_deref())
}

fn may_colour(is_terminal: bool, no_color: Option<&OsStr>) -> bool {
    is_terminal && no_color.is_none_or(OsStr::is_empty)
}

/// A progress bar of `steps`, on a terminal only.
pub fn progress(steps: usize, what: &'static str) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}");
    ProgressBar::new(steps as u64)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        .with_message(what)
}

/// `1 quad`, `2 quads`.
pub fn counted(count: u64, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

/// Rows under headings: aligned columns on a terminal; elsewhere a line for each row, cells between
/// tabs, no headings.
#[derive(Debug, Clone)]
pub struct Table {
    headings: Vec<&'static str>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// With a row for each value.
    pub fn of<T, const N: usize>(
        headings: [&'static str; N],
        values: &[T],
        row: impl Fn(&T) -> [String; N],
    ) -> Self {
        Self { headings: headings.to_vec(), rows: values.iter().map(|value| row(value).to_vec()).collect() }
    }

    /// As it is shown on standard output.
    pub fn text(&self) -> String {
        if std::io::stdout().is_terminal() {
            self.aligned(has_colour(&std::io::stdout()))
        } else {
            self.tabbed()
        }
    }

    fn tabbed(&self) -> String {
        self.rows.iter().map(|row| row.join("\t")).collect::<Vec<_>>().join("\n")
    }

    fn aligned(&self, has_colour: bool) -> String {
        let mut table = comfy_table::Table::new();
        table.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled);
        table.set_header(self.headings.iter().map(|heading| heading.to_uppercase()));
        for row in &self.rows {
            table.add_row(row);
        }
        // Cells have a space on both sides.
        let mut lines: Vec<String> =
            table.lines().map(|line| line.strip_prefix(' ').unwrap_or(&line).trim_end().to_owned()).collect();
        if has_colour && let Some(heading) = lines.first_mut() {
            *heading = format!("{BOLD}{heading}{PLAIN}");
        }
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_for_terminals_and_for_those_who_want_them() {
        assert!(may_colour(true, None) && may_colour(true, Some(OsStr::new(""))));
        assert!(!may_colour(true, Some(OsStr::new("1"))) && !may_colour(false, None));
    }

    #[test]
    fn a_table_is_aligned_for_people_and_tabbed_for_programs() {
        let table = Table::of(["name", "views"], &[("door", 2), ("a-long-name", 11)], |(name, views)| {
            [(*name).to_owned(), views.to_string()]
        });
        assert_eq!(table.tabbed(), "door\t2\na-long-name\t11");
        let text = table.aligned(false);
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with("NAME") && lines[1].starts_with("door") && lines.len() == 3, "{text}");
        let column = |line: &str, word: &str| line.find(word).unwrap();
        assert_eq!(column(lines[1], "2"), column(lines[2], "11"));
        assert!(!text.contains('\x1b') && table.aligned(true).starts_with("\x1b[1mNAME"));
    }
}
