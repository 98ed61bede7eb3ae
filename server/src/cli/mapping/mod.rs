//! Laser maps from files: `waymark map build`, `import` and `export`. Recordings are read here; the mapping itself is
//! `map::slam`.

mod carmen;
mod numbered;
mod own;
pub(crate) mod build;
pub(crate) mod draw;
mod geojson;
pub(crate) mod grid;
mod pgm;
mod outline;
pub(crate) mod import;
pub(crate) mod file;

use anyhow::Context as _;
use flate2::read::MultiGzDecoder;
use map::{laser::Scan, pose2::Pose2, slam::MAX_SCANS};
use std::{
    fs::File,
    io::{BufRead, BufReader, Read},
    path::Path,
};

/// Largest recording, unpacked.
pub(crate) const MAX_BYTES: u64 = 2 << 30;
/// Longest line of a recording.
pub(crate) const MAX_LINE_BYTES: u64 = 1 << 20;
/// Two records farther apart in time are a pause or a clock set anew: not counted as recorded time.
const MAX_PAUSE_S: f64 = 60.0;
/// A robot that was faster on the whole was not: the recording's times are wrong.
const MAX_SPEED_MPS: f64 = 5.0;

/// What a recording says of its laser where the file itself does not.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(crate) struct LaserArgs {
    /// Ranges from here on are "no return", metres.
    #[arg(long, default_value_t = 50.0)]
    pub(crate) max_range_m: f64,
    /// Angle of the fan, degrees, where the log gives none (CARMEN FLASER, numbered scans).
    #[arg(long, default_value_t = 180.0)]
    pub(crate) field_deg: f64,
}

/// One scan and the odometry of its moment.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Record {
    pub(crate) odom: Pose2,
    /// Where the robot truly was, or as well as somebody knows.
    pub(crate) truth: Option<Pose2>,
    pub(crate) time_s: Option<f64>,
    pub(crate) scan: Scan,
}

/// A whole recording, in order.
#[derive(Debug, Clone, Default)]
pub(crate) struct Recording {
    pub(crate) records: Vec<Record>,
}

impl Recording {
    /// Recorded time without pauses, if the recording has times that can be: some logs have times by which the robot would
    /// have driven like a car.
    pub(crate) fn duration_s(&self) -> Option<f64> {
        let times: Option<Vec<f64>> = self.records.iter().map(|r| r.time_s).collect();
        let steps = |t: &[f64]| Some((t[1] - t[0]).abs()).filter(|d| *d <= MAX_PAUSE_S);
        let duration_s: f64 = times?.windows(2).filter_map(steps).sum();
        let way = |r: &[Record]| r[0].odom.between(&r[1].odom).position().norm();
        let way_m: f64 = self.records.windows(2).map(way).sum();
        Some(duration_s).filter(|d| *d > 0.0 && way_m <= MAX_SPEED_MPS * d)
    }
}

/// A line that cannot be used.
#[derive(Debug, thiserror::Error, PartialEq)]
#[error("line {line}: {field}: {problem}")]
pub(crate) struct BadLine {
    /// Counts from 1.
    pub(crate) line: usize,
    /// Which part of it.
    pub(crate) field: String,
    /// What is wrong.
    pub(crate) problem: String,
}

/// Why a recording cannot be read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ReadError {
    /// The file.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// A line of it.
    #[error(transparent)]
    Line(#[from] BadLine),
    /// Neither CARMEN, numbered scans nor the project's own format.
    #[error("no scans: expected CARMEN FLASER or ROBOTLASER1 lines, numbered scans, or a Waymark recording")]
    Unknown,
    /// Too long.
    #[error("more than {MAX_SCANS} scans")]
    TooMany,
    /// Larger than [`MAX_BYTES`] when unpacked.
    #[error("more than {MAX_BYTES} bytes when unpacked")]
    TooLarge,
}

/// The words of one line, each taken once and named in errors.
pub(crate) struct Words<'a> {
    line: usize,
    words: std::str::SplitWhitespace<'a>,
}

impl<'a> Words<'a> {
    pub(crate) fn new(line: usize, text: &'a str) -> Self {
        Self { line, words: text.split_whitespace() }
    }

    pub(crate) fn bad(&self, field: &str, problem: impl Into<String>) -> BadLine {
        BadLine { line: self.line, field: field.to_owned(), problem: problem.into() }
    }

    pub(crate) fn word(&mut self, field: &str) -> Result<&'a str, BadLine> {
        self.words.next().ok_or_else(|| self.bad(field, "missing"))
    }

    pub(crate) fn number(&mut self, field: &str) -> Result<f64, BadLine> {
        let word = self.word(field)?;
        match word.parse::<f64>() {
            Ok(v) if v.is_finite() => Ok(v),
            _ => Err(self.bad(field, format!("`{word}` is no finite number"))),
        }
    }

    pub(crate) fn count(&mut self, field: &str, most: usize) -> Result<usize, BadLine> {
        let word = self.word(field)?;
        match word.parse::<usize>() {
            Ok(v) if v <= most => Ok(v),
            Ok(v) => Err(self.bad(field, format!("{v} is more than {most}"))),
            Err(_) => Err(self.bad(field, format!("`{word}` is no count"))),
        }
    }

    pub(crate) fn pose(&mut self, field: &str) -> Result<Pose2, BadLine> {
        let pose = Pose2::new(self.number(field)?, self.number(field)?, self.number(field)?);
        pose.check().map_err(|e| self.bad(field, e.to_string()))?;
        Ok(pose)
    }

    /// `n` ranges; what is no number is no return.
    pub(crate) fn ranges(&mut self, n: usize) -> Result<Vec<f32>, BadLine> {
        (0..n).map(|i| Ok(self.number(&format!("range {i}"))? as f32)).collect()
    }
}

/// Calls `each` with every line (from 1) of a text file, unpacked if its name ends in `.gz`.
pub(crate) fn lines(
    path: &Path,
    mut each: impl FnMut(usize, &str) -> Result<(), ReadError>,
) -> Result<(), ReadError> {
    let file = File::open(path)?;
    let packed = path.extension().is_some_and(|e| e == "gz");
    let bytes: Box<dyn Read> = if packed { Box::new(MultiGzDecoder::new(file)) } else { Box::new(file) };
    let mut reader = BufReader::new(bytes.take(MAX_BYTES + 1));
    let (mut buffer, mut total) = (Vec::new(), 0);
    for line in 1.. {
        buffer.clear();
        let taken = reader.by_ref().take(MAX_LINE_BYTES + 1).read_until(b'\n', &mut buffer)? as u64;
        total += taken;
        if taken == 0 {
            break;
        }
        if total > MAX_BYTES {
            return Err(ReadError::TooLarge);
        }
        let bad = |problem: String| BadLine { line, field: "text".to_owned(), problem };
        if taken > MAX_LINE_BYTES {
            return Err(bad(format!("longer than {MAX_LINE_BYTES} bytes")).into());
        }
        let text = std::str::from_utf8(&buffer).map_err(|e| bad(e.to_string()))?;
        each(line, text.trim())?;
    }
    Ok(())
}

/// Which format a recording has; the first line that says so decides.
enum Format {
    Carmen,
    Own(Box<own::Own>),
    Numbered(numbered::Numbered),
}

/// Reads a recording of any known format.
pub(crate) fn read(path: &Path, laser: &LaserArgs) -> Result<Recording, ReadError> {
    let mut format: Option<Format> = None;
    let mut recording = Recording::default();
    lines(path, |line, text| {
        if text.is_empty() || text.starts_with('#') {
            return Ok(());
        }
        if format.is_none() {
            format = Some(match text.chars().next() {
                Some('{') => Format::Own(Box::new(own::Own::head(line, text)?)),
                Some('0'..='9') => Format::Numbered(numbered::Numbered::default()),
                _ => Format::Carmen,
            });
            if matches!(format, Some(Format::Own(_))) {
                return Ok(());
            }
        }
        let record = match &mut format {
            Some(Format::Carmen) => carmen::record(line, text, laser)?,
            Some(Format::Own(own)) => Some(own.record(line, text)?),
            Some(Format::Numbered(numbered)) => Some(numbered.record(line, text, laser)?),
            None => None,
        };
        if recording.records.len() >= MAX_SCANS {
            return Err(ReadError::TooMany);
        }
        recording.records.extend(record);
        Ok(())
    })?;
    if recording.records.is_empty() { Err(ReadError::Unknown) } else { Ok(recording) }
}

/// Reads a recording, and its name with it in an error.
pub(crate) fn open(path: &Path, laser: &LaserArgs) -> anyhow::Result<Recording> {
    read(path, laser).with_context(|| path.display().to_string())
}

#[cfg(test)]
mod tests;
