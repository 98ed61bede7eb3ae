use super::{
    any::{ImportOptions, WallFileError, import},
    evidence::Evidence,
    grid::{CellState, OccupancyGrid},
    map_file::Wall,
    outline, ros_grid,
};
use map::pose2::Pose2;

fn walls_of(grid: &OccupancyGrid, min_length_m: f64) -> Vec<Wall> {
    outline::walls(grid, &Evidence::of(grid), min_length_m)
}

/// A grid from rows of text, the top row first: `#` occupied, `+` grey, `.` free, anything else
/// unknown.
fn drawn(rows: &[&str], resolution_m: f64) -> OccupancyGrid {
    let mut grid = OccupancyGrid::empty((rows[0].len(), rows.len()), resolution_m, Pose2::default());
    for cell in rows.iter().rev().flat_map(|row| row.bytes()) {
        match cell {
            b'#' => grid.push(CellState::Occupied, Some(1.0)),
            b'+' => grid.push(CellState::Unknown, Some(0.4)),
            b'.' => grid.push(CellState::Free, Some(0.0)),
            _ => grid.push(CellState::Unknown, Some(0.196)),
        }
    }
    grid
}

#[test]
fn a_grid_becomes_its_walls_and_back() {
    // A room 4 m x 3 m, walls drawn by hand, free side inside (left of counter-clockwise).
    let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
    let room: Vec<Wall> = (0..4).map(|i| Wall::between(corners[i], corners[(i + 1) % 4])).collect();
    let grid = OccupancyGrid::of_walls(&room, 0.05).unwrap();
    assert_eq!(grid.at(60, 50), CellState::Free);
    assert_eq!(grid.at(2, 2), CellState::Unknown, "outside");
    let folder = tempfile::tempdir().unwrap();
    let yaml = folder.path().join("room.yaml");
    ros_grid::write(&grid, &yaml).unwrap();
    let (again, underlay) = ros_grid::read(&yaml).unwrap();
    assert_eq!(again.cells, grid.cells);
    assert_eq!((again.width, again.height, again.origin), (grid.width, grid.height, grid.origin));
    assert_eq!((underlay.width, underlay.height, underlay.origin), (grid.width, grid.height, grid.origin));
    let walls = walls_of(&again, 0.3);
    assert_eq!(walls.len(), 4, "{walls:?}");
    for w in &walls {
        let s = w.segment().unwrap();
        // The free side is inside, and the wall where it was, to a cell.
        assert!(s.facing().dot(&(nalgebra::Point2::new(2.0, 1.5) - s.a)) > 0.0, "{w:?}");
        let near = |v: f64, to: &[f64]| to.iter().any(|t| (v - t).abs() < 0.06);
        assert!([w.a, w.b].iter().all(|p| near(p[0], &[0.0, 4.0]) && near(p[1], &[0.0, 3.0])), "{w:?}");
    }
}

#[test]
fn a_smoothed_grid_has_its_walls_too() {
    // Free, a cell in between, a wall two cells thick, unknown behind.
    let grid = drawn(&["..?##?"; 40], 0.05);
    let walls = walls_of(&grid, 0.3);
    assert_eq!(walls.len(), 1, "{walls:?}");
    assert!([walls[0].a, walls[0].b].iter().all(|p| (p[0] - 0.15).abs() < 1e-9), "{walls:?}");
}

#[test]
fn a_slanted_wall_of_a_grid_is_one_wall() {
    let slanted = [Wall::between([0.0, 0.0], [6.0, 2.0]), Wall::between([6.0, 4.0], [0.0, 4.0])];
    let grid = OccupancyGrid::of_walls(&slanted, 0.05).unwrap();
    let walls = walls_of(&grid, 1.0);
    let along = |w: &&Wall| {
        let d = [w.b[0] - w.a[0], w.b[1] - w.a[1]];
        (d[1] / d[0] - 1.0 / 3.0).abs() < 0.05 && d[0] > 0.0
    };
    let upper: f64 = walls.iter().filter(along).map(|w| w.b[0] - w.a[0]).sum();
    assert!(upper > 5.5, "{walls:?}");
}

#[test]
fn what_is_no_grid_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let yaml = folder.path().join("m.yaml");
    std::fs::write(folder.path().join("m.pgm"), b"P5\n# made by hand\n2 2\n255\n\x00\xfe\xcd\x00").unwrap();
    std::fs::write(folder.path().join("short.pgm"), b"P5\n9 9\n255\n\x00").unwrap();
    let good = "image: m.pgm\nresolution: 0.05\norigin: [1, 2, 0.5]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    std::fs::write(&yaml, good).unwrap();
    let (grid, underlay) = ros_grid::read(&yaml).unwrap();
    // The top row of the picture is the upper row of the map.
    assert_eq!(grid.cells, [CellState::Unknown, CellState::Occupied, CellState::Occupied, CellState::Free]);
    assert_eq!(grid.origin, Pose2::new(1.0, 2.0, 0.5));
    assert_eq!((underlay.width, underlay.resolution_m, underlay.origin), (2, 0.05, grid.origin));
    for (from, to, field) in [
        ("resolution: 0.05", "resolution: 0", "resolution"),
        ("origin: [1, 2, 0.5]", "origin: [1, 2]", "origin"),
        ("negate: 0\n", "", "negate"),
        ("free_thresh: 0.196", "free_thresh: low", "free_thresh"),
        ("m.pgm", "m.pgm\nmode: rows", "mode"),
        ("m.pgm", "short.pgm", "fewer pixels"),
        ("m.pgm", "none.pgm", "none.pgm"),
    ] {
        std::fs::write(&yaml, good.replace(from, to)).unwrap();
        let error = ros_grid::read(&yaml).unwrap_err().to_string();
        assert!(error.contains(field), "{error}");
    }
}

#[test]
fn a_picture_is_read_by_the_yaml_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("m.pgm");
    let cells = [&[0_u8; 20][..], &[0xfe; 19], &[0xcd]].concat();
    std::fs::write(&picture, [b"P5 20 2 255\n", &cells[..]].concat()).unwrap();
    let alone = import(&picture, &ImportOptions::default()).unwrap_err();
    assert!(matches!(alone, WallFileError::OnlyPicture), "{alone}");
    assert!(alone.to_string().contains("this is the picture; give its .yaml"), "{alone}");
    std::fs::copy(&picture, folder.path().join("n.yaml")).unwrap();
    let named_so = import(&folder.path().join("n.yaml"), &ImportOptions::default()).unwrap_err().to_string();
    assert!(named_so.contains("this is the picture"), "{named_so}");
    let text = "image: m.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    std::fs::write(folder.path().join("m.yaml"), text).unwrap();
    let report = import(&picture, &ImportOptions::default()).unwrap().report.grid.unwrap();
    assert_eq!((report.occupied, report.free, report.unknown, report.grey), (20, 19, 1, 0));
}

#[test]
fn grey_cells_and_gaps_belong_to_a_wall_and_far_unknown_does_not() {
    // Half of the wall was seen seldom, three cells of it never; right of it the laser saw nothing
    // for two metres.
    let long = format!("{}{}{}{}", "#".repeat(20), " ".repeat(3), "+".repeat(20), " ".repeat(60));
    let (free, unknown) = (".".repeat(long.len()), " ".repeat(long.len()));
    let grid = drawn(&[&unknown, &unknown, &long, &free, &free, &unknown], 0.05);
    let walls = walls_of(&grid, 0.3);
    assert_eq!(walls.len(), 1, "{walls:?}");
    // The free side is below, so the wall runs from right to left.
    let Wall { a, b, .. } = walls[0];
    assert!((a[0] - 43.0 * 0.05).abs() < 1e-9 && b[0].abs() < 1e-9, "{walls:?}");
    assert!((a[1] - 0.15).abs() < 1e-9 && (b[1] - 0.15).abs() < 1e-9, "{walls:?}");
}

#[test]
fn a_leg_of_a_table_is_kept_and_a_notch_beside_a_wall_is_not() {
    let plain = ".".repeat(60);
    let wall = "#".repeat(60);
    let notch = format!("{}##{}", ".".repeat(30), ".".repeat(28));
    let leg = format!("{}##{}", ".".repeat(10), ".".repeat(48));
    let rows = [&wall[..], &notch, &plain, &plain, &plain, &plain, &plain, &plain, &leg, &leg, &plain];
    let walls = walls_of(&drawn(&rows, 0.05), 0.3);
    let shortest = |w: &&Wall| w.length_m() < 0.3;
    assert!(walls.iter().filter(shortest).all(|w| w.a[1] < 0.2), "{walls:?}");
    assert!(walls.iter().any(|w| shortest(&w)), "{walls:?}");
    // One or two cells are noise.
    let speck = [&plain[..], &plain, &notch, &plain, &plain];
    assert_eq!(walls_of(&drawn(&speck, 0.05), 0.3), []);
}

#[test]
fn cells_of_a_millimetre_give_no_wall_that_a_map_refuses() {
    let speck = "....................";
    let leg = ".........####.......";
    let walls = walls_of(&drawn(&[speck, leg, leg, leg, leg, speck], 0.001), 0.3);
    assert!(walls.iter().all(|w| w.segment().is_ok()), "{walls:?}");
}
