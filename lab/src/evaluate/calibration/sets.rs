//! Real views of calibration boards, in the formats of public sets, with each set's own
//! calibration: `Model.txt` with `data*.txt` (Zhang), OpenCV's `corners` in yml files, and
//! photographs of a chessboard, whose inner corners OpenCV finds, if Python has it.

use crate::bench::Python;
use anyhow::Context as _;
use cli::pictures;
use nalgebra::{Point2, Vector2};
use serde::Deserialize;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};
use vision::camera_calibration::PlanarView;

/// Finds the inner corners of a chessboard in pictures.
const PROGRAM: &str = include_str!("../../../peers/chessboard.py");
/// Standard deviation that is assumed for corners of such sets.
pub(super) const SIGMA_PX: f64 = 0.2;
/// Side of a square if the set does not state it; only the scale depends on it.
const SQUARE_M: f64 = 0.025;

/// A focal length that a set states.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub(super) struct Stated {
    pub(super) file: String,
    pub(super) fx_px: f64,
    /// With lens distortion, or as a pinhole.
    pub(super) lens: bool,
}

/// Views of one board by one camera.
#[derive(Debug)]
pub(super) struct Set {
    pub(super) name: String,
    pub(super) image_px: [usize; 2],
    pub(super) views: Vec<PlanarView>,
    /// The four outermost points: one quad.
    pub(super) corners: [usize; 4],
    pub(super) stated: Vec<Stated>,
}

impl Set {
    /// The views of the outermost quad alone.
    pub(super) fn quads(&self) -> Vec<PlanarView> {
        let of = |v: &PlanarView| {
            let plane = self.corners.map(|i| v.plane_m[i]).to_vec();
            PlanarView::of_points(plane, self.corners.map(|i| v.seen_px[i]).to_vec(), SIGMA_PX)
        };
        self.views.iter().map(of).collect()
    }
}

/// All boards of a folder. The second list names what could not be used, and why.
pub(super) fn read(folder: &Path, python: &Path) -> anyhow::Result<(Vec<Set>, Vec<String>)> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .with_context(|| format!("cannot read {}", folder.display()))?
        .map(|e| e.map(|e| e.path()))
        .collect::<Result<_, _>>()?;
    files.sort();
    let name = folder.file_name().map_or_else(|| "set".into(), |n| n.to_string_lossy().into_owned());
    let stated = stated(&files)?;
    if folder.join("Model.txt").is_file() {
        return Ok((vec![zhang(folder, &files, name, stated)?], vec![]));
    }
    let boards = grids(&files, &name)?;
    if !boards.is_empty() {
        let sets = boards.into_iter().map(|set| Set { stated: stated.clone(), ..set });
        return Ok((sets.collect(), vec![]));
    }
    match photographed(&files, &name, python) {
        Ok(set) => Ok((vec![Set { stated, ..set }], vec![])),
        Err(why) => Ok((vec![], vec![format!("{name}: {why}")])),
    }
}

fn text(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}

fn numbers(text: &str) -> Vec<f64> {
    text.split(|c: char| c.is_whitespace() || c == ',').filter_map(|t| t.parse().ok()).collect()
}

fn points(numbers: &[f64]) -> Vec<Point2<f64>> {
    numbers.chunks_exact(2).map(|p| Point2::new(p[0], p[1])).collect()
}

/// Zhang's format: corners of the squares in inches, and their pixels in each picture.
fn zhang(folder: &Path, files: &[PathBuf], name: String, stated: Vec<Stated>) -> anyhow::Result<Set> {
    const INCH_M: f64 = 0.0254;
    let model: Vec<_> =
        points(&numbers(&text(&folder.join("Model.txt"))?)).iter().map(|p| p * INCH_M).collect();
    let mut views = vec![];
    for path in files.iter().filter(|p| stem(p).starts_with("data") && is(p, "txt")) {
        let observed = points(&numbers(&text(path)?));
        anyhow::ensure!(observed.len() == model.len(), "{}: not one pixel a point", path.display());
        views.push(PlanarView::of_points(model.clone(), observed, SIGMA_PX));
    }
    let image_px = size(files).context("no picture says how large the images are")?;
    // The model's second coordinate runs down the board.
    for point in views.iter_mut().flat_map(|v| &mut v.plane_m) {
        point.y = -point.y;
    }
    let corners = views.first().map_or([0; 4], |v| outermost(&v.plane_m));
    Ok(Set { name, image_px, views, corners, stated })
}

/// The pixels of one picture of a board.
type Board = Vec<Point2<f64>>;

/// Boards by the beginning of the file's name and the numbers of rows and columns.
fn grids(files: &[PathBuf], name: &str) -> anyhow::Result<Vec<Set>> {
    let mut boards: BTreeMap<(String, usize, usize), Vec<Board>> = BTreeMap::new();
    for path in files.iter().filter(|p| is(p, "yml") || is(p, "yaml") || is(p, "dat")) {
        let Some((rows, columns, values)) = matrix(&text(path)?, "corners") else { continue };
        let family: String = stem(path).chars().take_while(|c| !c.is_ascii_digit()).collect();
        let family = if stem(path).starts_with("m-") { stem(path).chars().take(3).collect() } else { family };
        let corners = points(&values);
        if corners.len() == rows * columns {
            boards.entry((family, rows, columns)).or_default().push(corners);
        }
    }
    let mut sets = vec![];
    for ((family, rows, columns), all) in boards {
        let pictures: Vec<PathBuf> = files
            .iter()
            .filter(|p| pictures::is_picture(p) && stem(p).starts_with(family_root(&family)))
            .cloned()
            .collect();
        let Some(image_px) = size(&pictures) else { continue };
        let views =
            all.into_iter().map(|corners| PlanarView::of_points(grid(rows, columns), corners, SIGMA_PX));
        let corners = outermost(&grid(rows, columns));
        let name = format!("{name}/{family} {columns}x{rows}");
        sets.push(Set { name, image_px, views: views.collect(), corners, stated: vec![] });
    }
    Ok(sets)
}

fn family_root(family: &str) -> &str {
    family.split('_').next().unwrap_or(family)
}

/// Photographs of a chessboard whose size one of the set's files states.
fn photographed(files: &[PathBuf], name: &str, python: &Path) -> Result<Set, String> {
    #[derive(Deserialize)]
    struct Greeting {
        #[expect(dead_code, reason = "its presence says that OpenCV is there")]
        version: String,
    }
    #[derive(Deserialize)]
    struct Found {
        corners: Option<Vec<[f64; 2]>>,
    }
    let board = files.iter().filter(|p| is(p, "yml")).find_map(|p| {
        let text = std::fs::read_to_string(p).ok()?;
        let field = |name: &str| numbers(text.split_once(name)?.1).first().copied();
        Some((field("board_width:")? as usize, field("board_height:")? as usize))
    });
    let (columns, rows) = board.ok_or("neither corners nor the size of a chessboard are stated")?;
    let photographs: Vec<PathBuf> = files.iter().filter(|p| pictures::is_picture(p)).cloned().collect();
    let image_px = size(&photographs).ok_or("no pictures")?;
    let (mut python, Greeting { .. }) = Python::start(python, PROGRAM, &photographs)?;
    let mut views = vec![];
    for i in 0..photographs.len() {
        let Found { corners } = python.ask(&format!("{i} {columns} {rows}"))?;
        let observed: Vec<Point2<f64>> = corners.unwrap_or_default().into_iter().map(Point2::from).collect();
        if observed.len() == rows * columns {
            views.push(PlanarView::of_points(grid(rows, columns), observed, SIGMA_PX));
        }
    }
    let corners = outermost(&grid(rows, columns));
    Ok(Set { name: format!("{name} {columns}x{rows}"), image_px, views, corners, stated: vec![] })
}

/// Inner corners of a chessboard, row by row from the top.
fn grid(rows: usize, columns: usize) -> Vec<Point2<f64>> {
    (0..rows * columns)
        .map(|i| Point2::new((i % columns) as f64 * SQUARE_M, -((i / columns) as f64) * SQUARE_M))
        .collect()
}

/// The points farthest out to the four corners: TL, TR, BR, BL.
fn outermost(plane: &[Point2<f64>]) -> [usize; 4] {
    [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]].map(|d| {
        let d = Vector2::from(d);
        // Ties: the first.
        (0..plane.len())
            .min_by(|&a, &b| d.dot(&plane[b].coords).total_cmp(&d.dot(&plane[a].coords)))
            .unwrap_or(0)
    })
}

/// A matrix of OpenCV's yml: rows, columns, numbers.
fn matrix(text: &str, name: &str) -> Option<(usize, usize, Vec<f64>)> {
    let (_, rest) = text.split_once(&format!("{name}: !!opencv-matrix"))?;
    let field = |name: &str| numbers(rest.split_once(name)?.1.lines().next()?).first().map(|v| *v as usize);
    let (_, data) = rest.split_once("data: [")?;
    let (data, _) = data.split_once(']')?;
    Some((field("rows:")?, field("cols:")?, numbers(data)))
}

/// Focal lengths that the set's files state: `OpenCV`'s `camera_matrix`, a yaml's `fx`, Zhang's
/// five numbers.
fn stated(files: &[PathBuf]) -> anyhow::Result<Vec<Stated>> {
    let mut all = vec![];
    for path in files.iter().filter(|p| is(p, "yml") || is(p, "yaml") || is(p, "txt")) {
        let (name, text) = (stem(path), text(path)?);
        if let Some((3, 3, k)) = matrix(&text, "camera_matrix") {
            let bent =
                matrix(&text, "distortion_coefficients").is_some_and(|m| m.2.iter().any(|v| v.abs() > 0.0));
            all.extend(k.first().map(|fx_px| Stated { file: name, fx_px: *fx_px, lens: bent }));
        } else if name.starts_with("calibration-result") {
            let lens = !name.contains("no-distortion");
            let fx = numbers(&text).first().copied();
            all.extend(fx.map(|fx_px| Stated { file: name, fx_px, lens }));
        } else if let Some((_, rest)) = text.split_once("fx:") {
            let fx = numbers(rest.lines().next().unwrap_or_default()).first().copied();
            all.extend(fx.map(|fx_px| Stated { file: name, fx_px, lens: true }));
        }
    }
    Ok(all)
}

fn size(files: &[PathBuf]) -> Option<[usize; 2]> {
    let first = files.iter().find(|p| pictures::is_picture(p))?;
    pictures::read(first).ok().map(|image| [image.width(), image.height()])
}

fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned())
}

fn is(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_is_read() {
        let yml = "%YAML:1.0\ncorners: !!opencv-matrix\n   rows: 1\n   cols: 2\n   dt: \"2f\"\n   data: [ 3.5e+01, 2.,\n 7.,\n  8. ]\n";
        assert_eq!(matrix(yml, "corners"), Some((1, 2, vec![35.0, 2.0, 7.0, 8.0])));
        assert_eq!(matrix(yml, "camera_matrix"), None);
        let plane = grid(2, 3);
        assert_eq!(outermost(&plane), [0, 2, 5, 3]);
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("calibration-result-no-distortion.txt", "Summary\n\n867.3 0.05 867.2 299.1 218.6\n");
        write("other.yaml", "pinhole:\n  fx: 565.5\n  fy: 566\n");
        write("README.txt", "words");
        let mut files: Vec<_> =
            std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().path()).collect();
        files.sort();
        let found = stated(&files).unwrap();
        let of = |i: usize| (found[i].fx_px, found[i].lens);
        assert_eq!((found.len(), of(0), of(1)), (2, (867.3, false), (565.5, true)));
        let (sets, why) = read(folder.path(), Path::new("python3")).unwrap();
        assert!(sets.is_empty() && why[0].contains("neither corners"), "{why:?}");
    }
}
