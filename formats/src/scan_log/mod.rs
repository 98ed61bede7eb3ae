//! Logs of laser scans with odometry, from files: CARMEN, numbered scans, and the project's own format.

mod carmen;
mod entry;
mod numbered;
mod recording;
mod text;

pub use entry::{LaserDefaults, LogEntry, ScanLog};
pub use text::{BadLine, LineTokens, MAX_BYTES, MAX_LINE_BYTES, ReadError, lines};

use map::slam::MAX_SCANS;
use std::path::Path;

/// The format of a log; its first line that is neither empty nor a comment decides.
enum Format {
    Carmen,
    Recording(Box<recording::Recording>),
    Numbered(numbered::Numbered),
}

/// Reads a log of any known format; `.gz` is unpacked.
pub fn read(path: &Path, laser: &LaserDefaults) -> Result<ScanLog, ReadError> {
    let mut format: Option<Format> = None;
    let mut recording = ScanLog::default();
    lines(path, |line, text| {
        if text.is_empty() || text.starts_with('#') {
            return Ok(());
        }
        if format.is_none() {
            format = Some(match text.chars().next() {
                Some('{') => Format::Recording(Box::new(recording::Recording::head(line, text)?)),
                Some('0'..='9') => Format::Numbered(numbered::Numbered::default()),
                _ => Format::Carmen,
            });
            if matches!(format, Some(Format::Recording(_))) {
                return Ok(());
            }
        }
        let record = match &mut format {
            Some(Format::Carmen) => carmen::record(line, text, laser)?,
            Some(Format::Recording(head)) => Some(head.record(line, text)?),
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

#[cfg(test)]
mod tests;
