//! Claim: walls explain at least nine tenths of the wall cells of every real and simulated grid map
//! of the data sets, and lie where the grid has walls. Skipped, with the reason, where the maps are
//! not.

use formats::walls::{self, ImportOptions, MIN_EXPLAINED};
use std::{io::Write as _, path::PathBuf};

/// Share of the walls' length that must lie on wall cells.
const MIN_ON_WALL_CELLS: f64 = 0.97;

/// The maps, where they are: `WAYMARK_DATA`, else `shared/data` beside the repository.
fn maps() -> Vec<PathBuf> {
    let data = std::env::var_os("WAYMARK_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from);
    let folder = data.join("maps-ros-grid");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        // Past the capture of output: whoever runs the tests must know what was not tested.
        writeln!(
            std::io::stderr(),
            "skipped: real_grids: no grid maps in {} (set WAYMARK_DATA)",
            folder.display()
        )
        .expect("standard error");
        return vec![];
    };
    let all = entries.map(|e| e.expect("an entry").path());
    let mut maps: Vec<PathBuf> = all.filter(|p| p.extension().is_some_and(|e| e == "yaml")).collect();
    maps.sort();
    assert!(maps.len() >= 7, "the set has become smaller");
    maps
}

#[test]
fn walls_explain_every_grid_map() {
    let mut failed = vec![];
    for path in maps() {
        let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
        let imported =
            walls::import(&path, &ImportOptions::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        let report = imported.report.grid.expect("a grid");
        if report.share_explained() < MIN_EXPLAINED || report.length_on_wall_cells < MIN_ON_WALL_CELLS {
            failed.push(format!("{name}: {report:?}"));
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}
