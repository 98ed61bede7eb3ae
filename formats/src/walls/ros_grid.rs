//! ROS occupancy grids (`map_server`): a YAML file and a PGM or PNG picture beside it.

use super::{
    grid::{CellState, GridError, OccupancyGrid},
    picture::{self, Picture, Pixel},
    ros_yaml::{self, GridMeta, GridMode, MAX_YAML_BYTES},
};
use map::pose2::Pose2;
use std::{
    io::Read as _,
    path::{Path, PathBuf},
};

/// Grey levels that `map_server` writes.
const OCCUPIED: u8 = 0;
const FREE: u8 = 254;
const UNKNOWN: u8 = 205;

/// The picture of a grid and where it lies, to be shown under a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Underlay {
    /// An 8 bit PNG, grey, with opacity where the file had it.
    pub png: Vec<u8>,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Side of a pixel, metres.
    pub resolution_m: f64,
    /// `map_from_picture`: pose of the lower left corner of the lower left pixel, x to the right, y
    /// up.
    pub origin: Pose2,
}

/// The YAML file of a picture: the one of the same name beside it.
pub(super) fn yaml_beside(picture: &Path) -> Option<PathBuf> {
    ["yaml", "yml"].map(|ending| picture.with_extension(ending)).into_iter().find(|p| p.is_file())
}

/// Reads a YAML file and its picture.
pub(super) fn read(yaml: &Path) -> Result<(OccupancyGrid, Underlay), GridError> {
    let unread = |problem: String| GridError::Yaml { problem };
    let mut bytes = Vec::new();
    let file = std::fs::File::open(yaml).map_err(|e| unread(e.to_string()))?;
    file.take(MAX_YAML_BYTES as u64 + 1).read_to_end(&mut bytes).map_err(|e| unread(e.to_string()))?;
    if bytes.starts_with(b"P5") || bytes.starts_with(b"P2") || bytes.starts_with(b"\x89PNG") {
        return Err(unread("this is the picture; give its .yaml".to_owned()));
    }
    let meta = ros_yaml::parse(String::from_utf8_lossy(&bytes).trim_start_matches('\u{feff}'))?;
    let picture = Picture::read(&picture_path(yaml, &meta.image))?;
    let (width, height) = (picture.width, picture.height);
    let underlay = Underlay {
        png: picture.grey_png()?,
        width,
        height,
        resolution_m: meta.resolution_m,
        origin: meta.origin,
    };
    Ok((grid(&meta, &picture), underlay))
}

/// Where the picture is: beside the YAML file, at an absolute path, or under the home folder
/// (`~/`), as `nav2_map_server` takes it.
fn picture_path(yaml: &Path, image: &str) -> PathBuf {
    let home = image.strip_prefix("~/").zip(std::env::var_os("HOME"));
    match home {
        Some((rest, home)) => Path::new(&home).join(rest),
        None => yaml.parent().unwrap_or(Path::new(".")).join(image),
    }
}

fn grid(meta: &GridMeta, picture: &Picture) -> OccupancyGrid {
    let mut grid = OccupancyGrid::empty((picture.width, picture.height), meta.resolution_m, meta.origin);
    for y in (0..picture.height).rev() {
        for x in 0..picture.width {
            let (state, probability) = cell(meta, picture.pixel(x, y));
            grid.push(state, probability);
        }
    }
    grid
}

/// What a pixel says, as `nav2_map_server` reads it, and its probability before the thresholds.
/// Departs from it in one thing: `Raw` has probabilities alone there, and gets states by the
/// thresholds here.
fn cell(meta: &GridMeta, pixel: Pixel) -> (CellState, Option<f64>) {
    let brightness = match (meta.mode, pixel.opacity) {
        // Opacity is averaged with red, green and blue.
        (GridMode::Trinary, Some(opacity)) => (3.0 * pixel.brightness + opacity) / 4.0,
        (GridMode::Scale, Some(opacity)) if opacity < 1.0 => return (CellState::Unknown, None),
        _ => pixel.brightness,
    };
    let probability = match meta.mode {
        // Not negated, whatever the file says.
        GridMode::Raw => (brightness * 255.0).round() / 100.0,
        _ if meta.is_negated => brightness,
        _ => 1.0 - brightness,
    };
    if probability > 1.0 {
        return (CellState::Unknown, None);
    }
    let state = if meta.occupied_thresh < probability {
        CellState::Occupied
    } else if probability < meta.free_thresh {
        CellState::Free
    } else {
        CellState::Unknown
    };
    (state, Some(probability))
}

/// Writes `NAME.yaml` and `NAME.pgm`.
pub(super) fn write(grid: &OccupancyGrid, yaml: &Path) -> std::io::Result<()> {
    let picture = yaml.with_extension("pgm");
    let rows = (0..grid.height).rev().flat_map(|y| &grid.cells[y * grid.width..(y + 1) * grid.width]);
    let levels: Vec<u8> = rows
        .map(|c| match c {
            CellState::Occupied => OCCUPIED,
            CellState::Free => FREE,
            CellState::Unknown => UNKNOWN,
        })
        .collect();
    picture::write_pgm(&picture, grid.width, grid.height, &levels)?;
    let name = picture.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let Pose2 { x_m, y_m, theta_rad } = grid.origin;
    // Quoted as JSON, which is YAML: a name may hold what YAML reads as something else.
    let text = format!(
        "image: {}\nmode: trinary\nresolution: {}\norigin: [{x_m}, {y_m}, {theta_rad}]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
        serde_json::Value::String(name),
        grid.resolution_m
    );
    std::fs::write(yaml, text)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn meta(mode: GridMode, is_negated: bool) -> GridMeta {
        GridMeta {
            image: String::new(),
            resolution_m: 0.05,
            origin: Pose2::default(),
            mode,
            is_negated,
            occupied_thresh: 0.65,
            free_thresh: 0.196,
        }
    }

    /// Oracle: `nav2_map_server` (`map_io.cpp`), worked out by hand for these levels.
    #[test]
    fn cells_are_those_of_nav2() {
        use CellState::{Free, Occupied, Unknown};
        let opaque = |level: f64| Pixel { brightness: level / 255.0, opacity: None };
        for (mode, is_negated, level, state, probability) in [
            (GridMode::Trinary, false, 0.0, Occupied, Some(1.0)),
            (GridMode::Trinary, false, 89.0, Occupied, Some(166.0 / 255.0)),
            (GridMode::Trinary, false, 90.0, Unknown, Some(165.0 / 255.0)),
            (GridMode::Trinary, false, 205.0, Unknown, Some(50.0 / 255.0)),
            (GridMode::Trinary, false, 206.0, Free, Some(49.0 / 255.0)),
            (GridMode::Trinary, true, 254.0, Occupied, Some(254.0 / 255.0)),
            (GridMode::Trinary, true, 0.0, Free, Some(0.0)),
            (GridMode::Scale, false, 127.0, Unknown, Some(128.0 / 255.0)),
            (GridMode::Scale, true, 200.0, Occupied, Some(200.0 / 255.0)),
            (GridMode::Raw, false, 0.0, Free, Some(0.0)),
            (GridMode::Raw, true, 0.0, Free, Some(0.0)),
            (GridMode::Raw, false, 50.0, Unknown, Some(0.5)),
            (GridMode::Raw, false, 100.0, Occupied, Some(1.0)),
            (GridMode::Raw, false, 101.0, Unknown, None),
            (GridMode::Raw, false, 255.0, Unknown, None),
        ] {
            let (found, p) = cell(&meta(mode, is_negated), opaque(level));
            assert_eq!(found, state, "{mode:?} {is_negated} {level}");
            let as_expected = match (p, probability) {
                (Some(p), Some(q)) => (p - q).abs() < 1e-12,
                (p, q) => p == q,
            };
            assert!(as_expected, "{mode:?} {is_negated} {level}: {p:?}");
        }
        for (mode, brightness, opacity, state) in [
            (GridMode::Trinary, 0.0, 1.0, Occupied),
            (GridMode::Trinary, 1.0, 1.0, Free),
            // Three quarters of white.
            (GridMode::Trinary, 1.0, 0.0, Unknown),
            (GridMode::Trinary, 0.0, 0.0, Occupied),
            (GridMode::Scale, 0.0, 1.0, Occupied),
            (GridMode::Scale, 0.0, 254.0 / 255.0, Unknown),
            (GridMode::Scale, 1.0, 0.0, Unknown),
            (GridMode::Raw, 0.0, 0.0, Free),
        ] {
            let pixel = Pixel { brightness, opacity: Some(opacity) };
            assert_eq!(cell(&meta(mode, false), pixel).0, state, "{mode:?} {brightness} {opacity}");
        }
    }
}
