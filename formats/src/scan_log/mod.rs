//! Logs of laser scans with odometry, from files: CARMEN, numbered scans, and the project's own
//! format.

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

/// Reads a log of any known format; `.gz` is unpacked. A last line that cannot be used, as of a log
/// that was cut while it was written, is left out and told; any other one is an error.
pub fn read(path: &Path, laser: &LaserDefaults) -> Result<ScanLog, ReadError> {
    let mut format: Option<Format> = None;
    let mut recording = ScanLog::default();
    let mut last: Option<BadLine> = None;
    lines(path, |line, text| {
        if text.is_empty() || text.starts_with('#') {
            return Ok(());
        }
        if let Some(bad) = last.take() {
            return Err(bad.into());
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
            Some(Format::Carmen) => carmen::record(line, text, laser),
            Some(Format::Recording(head)) => head.record(line, text).map(Some),
            Some(Format::Numbered(numbered)) => numbered.record(line, text, laser).map(Some),
            None => Ok(None),
        };
        let record = match record {
            Ok(record) => record,
            Err(bad) if recording.records.is_empty() => return Err(bad.into()),
            Err(bad) => {
                last = Some(bad);
                return Ok(());
            }
        };
        if recording.records.len() >= MAX_SCANS {
            return Err(ReadError::TooMany);
        }
        recording.records.extend(record);
        Ok(())
    })?;
    recording.cut = last;
    if recording.records.is_empty() { Err(ReadError::Unknown) } else { Ok(recording) }
}

#[cfg(test)]
mod tests;
