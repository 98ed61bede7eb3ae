//! Files of walls of every kind, told by the extension of their names.

mod encoding;
mod other_kinds;

use super::{
    evidence::Evidence,
    floor_plan::{self, PlanError},
    geojson::{self, GeoJsonError},
    grid::{GridError, OccupancyGrid},
    map_file::{MAX_WALLS, MapFile, MapFileError, Wall},
    outline,
    report::{GridImport, ImportReport},
    ros_grid::{self, Underlay},
    vector_map,
};
use crate::scan_log::ReadError;
use encoding::decoded;
use map::check::OutOfRange;
use std::{
    io::{Read as _, Write as _},
    path::Path,
};

/// Extensions of occupancy grids, which are a picture and a text beside it.
const GRIDS: [&str; 9] = ["yaml", "yml", "pgm", "png", "bmp", "jpg", "jpeg", "webp", "ppm"];
/// Sides of a cell of a written grid, metres.
const RESOLUTION_M: std::ops::RangeInclusive<f64> = 0.005..=1.0;

/// Why walls cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum WallFileError {
    /// The file itself.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// An occupancy grid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The picture of an occupancy grid, without what says where it lies.
    #[error("this is the picture; give its .yaml (none of the same name lies beside it)")]
    OnlyPicture,
    /// A file of an occupancy grid, where one file is read.
    #[error("a grid is two files: lay it beneath the map as its floor plan, and have its walls found there")]
    TwoFiles,
    /// A map file.
    #[error(transparent)]
    MapFile(#[from] MapFileError),
    /// A GeoJSON file.
    #[error(transparent)]
    GeoJson(#[from] GeoJsonError),
    /// A floor plan.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A vector map.
    #[error(transparent)]
    Vector(#[from] ReadError),
    /// Larger than a file of its kind may be.
    #[error("more than {0} bytes")]
    TooLarge(u64),
    /// In no encoding that is read.
    #[error(
        "the text is neither UTF-8 nor UTF-16 with a byte order mark, nor Latin-1 as its first line says"
    )]
    Encoding,
    /// A file of a known kind without a reader.
    #[error("{0}")]
    OtherKind(&'static str),
    /// Nothing usable in it.
    #[error("no walls in it: nothing is changed by it")]
    NoWalls,
    /// More walls than are read.
    #[error("more than {MAX_WALLS} segments")]
    TooMany,
    /// A wall that cannot be.
    #[error("segment {index}: {source}")]
    Segment {
        /// From 0.
        index: usize,
        /// What is wrong.
        source: OutOfRange,
    },
    /// The cells of a grid to write.
    #[error("resolution {0} m: 0.005 to 1")]
    Resolution(f64),
    /// A file to write of a kind that is not known.
    #[error("`.{0}` is none of .yaml, .txt, .json, .geojson")]
    Extension(String),
}

/// What a file itself does not say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImportOptions {
    /// Walls of a grid shorter than this are left out, metres, but for those that alone explain
    /// some cells.
    pub min_length_m: f64,
    /// Metres of a unit of an SVG floor plan; without it the plan's physical size counts.
    pub metres_per_unit: Option<f64>,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self { min_length_m: 0.3, metres_per_unit: None }
    }
}

/// A file that was read: its walls, and what of the file became of them.
#[derive(Debug, Clone)]
pub struct Imported {
    /// The walls; of a map file the rest of it, too.
    pub map: MapFile,
    /// What was taken.
    pub report: ImportReport,
    /// Of a grid: its picture.
    pub underlay: Option<Underlay>,
    grid: Option<GridImport>,
}

impl Imported {
    fn of(map: MapFile) -> Self {
        // The sum of nothing is -0.
        let length_m = map.segments.iter().map(Wall::length_m).sum::<f64>() + 0.0;
        let report = ImportReport { segments: map.segments.len(), length_m, grid: None, note: None };
        Self { map, report, underlay: None, grid: None }
    }

    fn of_grid(grid: OccupancyGrid, underlay: Underlay, min_length_m: f64) -> Self {
        let evidence = Evidence::of(&grid);
        let segments = outline::walls(&grid, &evidence, min_length_m);
        let mut imported = Self::of(MapFile { segments, ..MapFile::default() });
        let grid = GridImport::new(grid, evidence, &imported.map.segments);
        imported.report.grid = Some(grid.report(&imported.map.segments));
        imported.underlay = Some(underlay);
        imported.grid = Some(grid);
        imported
    }

    /// Of a grid: its cells and walls, and in red the wall cells that no wall explains, as SVG.
    pub fn picture(&self) -> Option<Result<String, GridError>> {
        self.grid.as_ref().map(|grid| grid.svg(&self.map.segments))
    }
}

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// The text of a file of at most `max` bytes, unpacked.
fn text(path: &Path, max: u64) -> Result<String, WallFileError> {
    decoded(bytes(path, max)?, max)
}

fn bytes(path: &Path, max: u64) -> Result<Vec<u8>, WallFileError> {
    let mut bytes = Vec::new();
    std::fs::File::open(path)?.take(max + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > max { Err(WallFileError::TooLarge(max)) } else { Ok(bytes) }
}

/// A map file, or GeoJSON under its name.
fn json(path: &Path) -> Result<Imported, WallFileError> {
    #[derive(serde::Deserialize)]
    struct Kind {
        r#type: String,
    }
    let error = match MapFile::read(path) {
        Ok(map) => return Ok(Imported::of(map)),
        Err(error) => error,
    };
    let text = text(path, geojson::MAX_BYTES).ok();
    match text.filter(|text| serde_json::from_str::<Kind>(text).is_ok_and(|kind| !kind.r#type.is_empty())) {
        Some(text) => geojson_file(&text),
        None => Err(error.into()),
    }
}

fn geojson_file(text: &str) -> Result<Imported, WallFileError> {
    let (segments, note) = geojson::walls(text)?;
    let mut imported = Imported::of(MapFile { segments, ..MapFile::default() });
    imported.report.note = note;
    Ok(imported)
}

/// Reads the walls of `.yaml` (`map_server`; or its picture), `.json` (map file or GeoJSON),
/// `.geojson`, `.svg` and `.svgz` (floor plan), or else of a vector map. Errors: a file without any
/// wall, too.
pub fn import(path: &Path, options: &ImportOptions) -> Result<Imported, WallFileError> {
    let of = |segments| Imported::of(MapFile { segments, ..MapFile::default() });
    let of_grid = |yaml: &Path| -> Result<Imported, WallFileError> {
        let (grid, underlay) = ros_grid::read(yaml)?;
        Ok(Imported::of_grid(grid, underlay, options.min_length_m))
    };
    let imported = match extension(path).as_str() {
        "yaml" | "yml" => of_grid(path)?,
        "pgm" | "png" | "bmp" | "jpg" | "jpeg" | "webp" | "ppm" => {
            of_grid(&ros_grid::yaml_beside(path).ok_or(WallFileError::OnlyPicture)?)?
        }
        "json" => json(path)?,
        "geojson" => geojson_file(&text(path, geojson::MAX_BYTES)?)?,
        "svg" | "svgz" => {
            of(floor_plan::walls(&text(path, floor_plan::MAX_BYTES)?, options.metres_per_unit)?)
        }
        extension => match other_kinds::advice(extension) {
            Some(advice) => return Err(WallFileError::OtherKind(advice)),
            None => of(vector_map::read(path)?),
        },
    };
    if imported.map.segments.is_empty() {
        return Err(WallFileError::NoWalls);
    }
    if imported.map.segments.len() > MAX_WALLS {
        return Err(WallFileError::TooMany);
    }
    for (index, wall) in imported.map.segments.iter().enumerate() {
        wall.segment().map_err(|source| WallFileError::Segment { index, source })?;
    }
    Ok(imported)
}

/// Reads the walls of one file by its bytes, as [`import`] does. `kind` is the extension of its
/// name. A grid is two files: [`WallFileError::TwoFiles`].
pub fn import_bytes(kind: &str, bytes: &[u8], options: &ImportOptions) -> Result<Imported, WallFileError> {
    let kind = kind.to_lowercase();
    if GRIDS.contains(&kind.as_str()) {
        return Err(WallFileError::TwoFiles);
    }
    if let Some(advice) = other_kinds::advice(&kind) {
        return Err(WallFileError::OtherKind(advice));
    }
    let known = ["json", "geojson", "svg", "svgz"].into_iter().find(|known| *known == kind);
    let mut file = tempfile::Builder::new().suffix(&format!(".{}", known.unwrap_or("txt"))).tempfile()?;
    file.write_all(bytes)?;
    import(file.path(), options)
}

/// Reads the walls of a file that says everything itself, as [`import`] does.
pub fn read(path: &Path) -> Result<MapFile, WallFileError> {
    Ok(import(path, &ImportOptions { min_length_m: 0.0, ..ImportOptions::default() })?.map)
}

/// Writes a map as `.yaml` (with a `.pgm` beside it, cells of `resolution_m`), `.txt` (vector map),
/// `.geojson` or `.json`.
pub fn write(map: &MapFile, path: &Path, resolution_m: f64) -> Result<(), WallFileError> {
    match extension(path).as_str() {
        "yaml" | "yml" if !RESOLUTION_M.contains(&resolution_m) => {
            Err(WallFileError::Resolution(resolution_m))
        }
        "yaml" | "yml" => Ok(ros_grid::write(&OccupancyGrid::of_walls(&map.segments, resolution_m)?, path)?),
        "json" => Ok(map.write(path)?),
        "geojson" => Ok(std::fs::write(path, geojson::text(&map.segments))?),
        "txt" => Ok(std::fs::write(path, vector_map::text(&map.segments))?),
        other => Err(WallFileError::Extension(other.to_owned())),
    }
}

#[cfg(test)]
mod variants;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_its_bound() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.svg");
        std::fs::write(&path, "0123456789").unwrap();
        assert_eq!(text(&path, 10).unwrap(), "0123456789");
        assert!(matches!(text(&path, 9), Err(WallFileError::TooLarge(9))));
        std::fs::write(&path, "a\u{e4}").unwrap();
        assert!(matches!(text(&path, 1), Err(WallFileError::TooLarge(1))), "cut within a letter");
        std::fs::write(&path, [0xff]).unwrap();
        assert!(matches!(text(&path, 9), Err(WallFileError::Encoding)));
    }

    #[test]
    fn walls_go_through_every_kind_of_file() {
        let folder = tempfile::tempdir().unwrap();
        let map = MapFile { segments: vec![Wall::between([0.0, 0.5], [4.0, 0.5])], ..MapFile::default() };
        for name in ["m.json", "m.txt", "m.geojson"] {
            let path = folder.path().join(name);
            write(&map, &path, 0.05).unwrap();
            assert_eq!(read(&path).unwrap(), map, "{name}");
        }
        let plan = folder.path().join("m.svg");
        std::fs::write(
            &plan,
            r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 8 2"><path stroke="red" d="M0 1H8"/></svg>"#,
        )
        .unwrap();
        let options = ImportOptions { metres_per_unit: Some(0.5), ..ImportOptions::default() };
        let imported = import(&plan, &options).unwrap();
        assert_eq!((imported.map.segments[0], imported.report.segments), (map.segments[0], 2));
        assert!((imported.report.length_m - 8.0).abs() < 1e-9);
        assert!(imported.picture().is_none() && imported.underlay.is_none());
        let refused = read(&plan).unwrap_err().to_string();
        assert!(refused.contains("the plan has no scale"), "{refused}");
        assert!(matches!(write(&map, &plan, 0.05), Err(WallFileError::Extension(_))));
    }
}
