use super::{
    grid::{CellState, OccupancyGrid},
    map_file::Wall,
    outline::walls as walls_of,
    ros_grid,
};
use map::pose2::Pose2;

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
    let again = ros_grid::read(&yaml).unwrap();
    assert_eq!(again, grid);
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
fn a_smoothed_grid_gives_its_walls() {
    // Free, a cell in between, a wall two cells thick, unknown behind.
    let row = [
        CellState::Free,
        CellState::Free,
        CellState::Unknown,
        CellState::Occupied,
        CellState::Occupied,
        CellState::Unknown,
    ];
    let cells: Vec<CellState> = (0..40).flat_map(|_| row).collect();
    let grid = OccupancyGrid { width: 6, height: 40, resolution_m: 0.05, origin: Pose2::default(), cells };
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
fn an_invalid_grid_is_refused_with_its_field() {
    let folder = tempfile::tempdir().unwrap();
    let yaml = folder.path().join("m.yaml");
    std::fs::write(folder.path().join("m.pgm"), b"P5\n# made by hand\n2 2\n255\n\x00\xfe\xcd\x00").unwrap();
    std::fs::write(folder.path().join("short.pgm"), b"P5\n9 9\n255\n\x00").unwrap();
    let good = "image: m.pgm\nresolution: 0.05\norigin: [1, 2, 0.5]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    std::fs::write(&yaml, good).unwrap();
    let grid = ros_grid::read(&yaml).unwrap();
    // The top row of the picture is the upper row of the map.
    assert_eq!(grid.cells, [CellState::Unknown, CellState::Occupied, CellState::Occupied, CellState::Free]);
    assert_eq!(grid.origin, Pose2::new(1.0, 2.0, 0.5));
    for (from, to, field) in [
        ("resolution: 0.05", "resolution: 0", "resolution"),
        ("origin: [1, 2, 0.5]", "origin: [1, 2]", "origin"),
        ("negate: 0\n", "", "negate"),
        ("free_thresh: 0.196", "free_thresh: low", "free_thresh"),
        ("m.pgm", "m.pgm\nmode: raw", "mode"),
        ("m.pgm", "short.pgm", "fewer pixels"),
        ("m.pgm", "none.pgm", "none.pgm"),
    ] {
        std::fs::write(&yaml, good.replace(from, to)).unwrap();
        let error = ros_grid::read(&yaml).unwrap_err().to_string();
        assert!(error.contains(field), "{error}");
    }
}
