//! Text files line by line and token by token, with errors that name line and field.

use flate2::read::MultiGzDecoder;
use map::{pose2::Pose2, slam::MAX_SCANS};
use std::{
    fs::File,
    io::{BufRead, BufReader, Read},
    path::Path,
};

/// Largest file, unpacked.
pub const MAX_BYTES: u64 = 2 << 30;
/// Longest line.
pub const MAX_LINE_BYTES: u64 = 1 << 20;

/// A line that cannot be used.
#[derive(Debug, Clone, thiserror::Error, PartialEq)]
#[error("line {line}: {field}: {problem}")]
pub struct BadLine {
    /// Counts from 1.
    pub line: usize,
    /// Which part of it.
    pub field: String,
    /// What is wrong.
    pub problem: String,
}

/// Why a file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// A line of it.
    #[error(transparent)]
    Line(#[from] BadLine),
    /// Not one of the formats.
    #[error("no scans: expected CARMEN FLASER or ROBOTLASER1 lines, numbered scans, or a Waymark recording")]
    Unknown,
    /// Too long.
    #[error("more than {MAX_SCANS} scans")]
    TooMany,
    /// Larger than [`MAX_BYTES`] when unpacked.
    #[error("more than {MAX_BYTES} bytes when unpacked")]
    TooLarge,
}

/// The tokens of one line, each taken once and named in errors.
pub struct LineTokens<'a> {
    line: usize,
    words: std::str::SplitWhitespace<'a>,
}

impl<'a> LineTokens<'a> {
    /// Splits a line at white space; `line` counts from 1.
    pub fn new(line: usize, text: &'a str) -> Self {
        Self { line, words: text.split_whitespace() }
    }

    /// An error at `field` of this line.
    pub fn bad(&self, field: &str, problem: impl Into<String>) -> BadLine {
        BadLine { line: self.line, field: field.to_owned(), problem: problem.into() }
    }

    /// The next token.
    pub fn word(&mut self, field: &str) -> Result<&'a str, BadLine> {
        self.words.next().ok_or_else(|| self.bad(field, "missing"))
    }

    /// The next token as a finite number.
    pub fn number(&mut self, field: &str) -> Result<f64, BadLine> {
        let word = self.word(field)?;
        match word.parse::<f64>() {
            Ok(v) if v.is_finite() => Ok(v),
            _ => Err(self.bad(field, format!("`{word}` is no finite number"))),
        }
    }

    /// The next token as a count of at most `most`.
    pub fn count(&mut self, field: &str, most: usize) -> Result<usize, BadLine> {
        let word = self.word(field)?;
        match word.parse::<usize>() {
            Ok(v) if v <= most => Ok(v),
            Ok(v) => Err(self.bad(field, format!("{v} is more than {most}"))),
            Err(_) => Err(self.bad(field, format!("`{word}` is no count"))),
        }
    }

    /// The next three tokens as x, y (metres) and theta (radians).
    pub fn pose(&mut self, field: &str) -> Result<Pose2, BadLine> {
        let pose = Pose2::new(self.number(field)?, self.number(field)?, self.number(field)?);
        pose.check().map_err(|e| self.bad(field, e.to_string()))?;
        Ok(pose)
    }

    /// The next `n` tokens as ranges, metres. Infinite ones, and those that are no number, are
    /// beams without a return.
    pub fn ranges(&mut self, n: usize) -> Result<Vec<f32>, BadLine> {
        let range = |i: usize| {
            let word = self.word(&format!("range {i}"))?;
            let bad = |_form| self.bad(&format!("range {i}"), format!("`{word}` is no number"));
            word.parse::<f64>().map(|range| range as f32).map_err(bad)
        };
        (0..n).map(range).collect()
    }
}

/// Calls `each` with every line (from 1) of a text file, unpacked if its name ends in `.gz`.
pub fn lines(
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
        // Numbers and keywords are ASCII; letters of another encoding are in comments.
        let text = String::from_utf8_lossy(&buffer);
        each(line, text.trim_start_matches('\u{feff}').trim())?;
    }
    Ok(())
}
