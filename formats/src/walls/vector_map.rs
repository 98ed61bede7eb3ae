//! Vector maps as text: `x1, y1, x2, y2` in metres, one wall a line, the free side on the left.

use super::map_file::{MAX_WALLS, Wall};
use crate::scan_log::{LineTokens, ReadError, lines};
use map::segments::MIN_SEGMENT_M;
use std::{fmt::Write as _, path::Path};

/// Reads the walls; those shorter than a segment of the map may be are left out.
pub(super) fn read(path: &Path) -> Result<Vec<Wall>, ReadError> {
    let mut walls = Vec::new();
    lines(path, |line, text| {
        if text.is_empty() || text.starts_with('#') {
            return Ok(());
        }
        let text = text.replace(',', " ");
        let mut tokens = LineTokens::new(line, &text);
        let mut number = |field| tokens.number(field);
        let wall = Wall::between([number("x1")?, number("y1")?], [number("x2")?, number("y2")?]);
        if walls.len() >= MAX_WALLS {
            return Err(tokens.bad("segments", format!("more than {MAX_WALLS}")).into());
        }
        walls.extend((wall.length_m() >= MIN_SEGMENT_M).then_some(wall));
        Ok(())
    })?;
    Ok(walls)
}

/// The text of such a map.
pub(super) fn text(walls: &[Wall]) -> String {
    let mut text = String::new();
    for w in walls {
        // Writing to a String cannot fail.
        writeln!(text, "{:.6}, {:.6}, {:.6}, {:.6}", w.a[0], w.a[1], w.b[0], w.b[1]).ok();
    }
    text
}
