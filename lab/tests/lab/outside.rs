//! Claim: the figures of `waymark-lab evaluate outside` follow from labels and poses: a wrong label
//! makes a wrong name, a pose that is moved makes an error of that length, and what a world does
//! not state is absent.

use crate::lab;
use serde_json::{Value, json};
use sim::{
    building::{Building, LandmarkKind},
    corridor::CorridorParams,
    export::{DataSet, QuadState},
    lesson::LessonParams,
};
use std::{ffi::OsString, fs, path::Path, sync::Arc};
use tempfile::TempDir;
use tests::{command::Run, scenes};

/// Shortest side and largest angle of a full view (docs/EVALUATION.md).
const MIN_SIDE_PX: f64 = 30.0;
const MAX_ANGLE_DEG: f64 = 70.0;

/// A rendered corridor as a world: every poster taught, and `world.json` with all poses.
struct World {
    folder: TempDir,
    set: DataSet,
    poses: Value,
}

impl World {
    fn new(seed: u64) -> Self {
        let folder = TempDir::new().expect("a temporary directory");
        let params = CorridorParams { posters: 5, first_poster: 100 * seed, ..CorridorParams::default() };
        let building = Arc::new(Building::corridor_with(&params, seed));
        let taught: Vec<String> = building.posters().map(|p| p.name.clone()).collect();
        let views = LessonParams {
            views: 2,
            max_view_angle_rad: 0.7,
            distance_m: [1.3, 2.6],
            ..LessonParams::default()
        };
        let views = scenes::views(&building, &views);
        let set = scenes::write_set(folder.path(), &building, &views, &taught, 10.0);
        let camera = set.camera.as_ref().expect("a camera");
        let landmarks: Vec<Value> = building
            .posters()
            .map(|p| {
                let corners = p.corners_map().map(|c| [c.x, c.y, c.z]);
                json!({ "name": p.name, "kind": "poster", "corners": corners })
            })
            .collect();
        let frames: Vec<Value> = set
            .images
            .iter()
            .zip(&views)
            .map(|(image, (_, readings))| {
                let pose = readings.frame.truth.map_from_camera.inverse().to_homogeneous();
                let rows: [[f64; 4]; 4] =
                    std::array::from_fn(|row| std::array::from_fn(|column| pose[(row, column)]));
                json!({ "file": image.file, "fx": camera.fx, "fy": camera.fy, "cx": camera.cx, "cy": camera.cy,
                        "camera_from_world": rows })
            })
            .collect();
        let world = Self { folder, set, poses: json!({ "landmarks": landmarks, "frames": frames }) };
        world.save();
        world
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    fn save(&self) {
        scenes::save(self.path(), &self.set);
        fs::write(self.path().join("world.json"), self.poses.to_string()).expect("world.json");
    }

    /// Labels that are full views.
    fn full_views(&self) -> impl Iterator<Item = &sim::export::QuadEntry> {
        self.set.images.iter().flat_map(|i| &i.quads).filter(|q| {
            q.state == QuadState::Full
                && q.corners.min_side_px() >= MIN_SIDE_PX
                && q.view_angle_rad.to_degrees() <= MAX_ANGLE_DEG
        })
    }
}

fn evaluate(args: &[&str], folders: &[&Path]) -> Run {
    let args = ["evaluate", "outside"].iter().chain(args).map(OsString::from);
    lab(args.chain(folders.iter().map(|f| OsString::from(*f))))
}

fn report(folders: &[&Path]) -> Value {
    let run = evaluate(&["--json"], folders);
    assert_eq!((run.status, run.stdout.lines().count()), (0, 1), "{run:?}");
    run.last_json()
}

fn number(report: &Value, path: &str) -> f64 {
    report.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path} of {report}"))
}

#[test]
fn a_worlds_figures_follow_from_its_truth() {
    let mut world = World::new(8);
    let posters = world.full_views().filter(|q| q.kind == LandmarkKind::Poster).count();
    assert!(posters >= 6, "{posters} posters: too few");
    let right = report(&[world.path()]);
    assert_eq!(number(&right, "/all/full_views") as usize, world.full_views().count(), "{right}");
    assert_eq!(number(&right, "/by_kind/poster/full_views") as usize, posters, "{right}");
    let named = number(&right, "/by_kind/poster/named");
    assert!(named >= 0.5 && number(&right, "/all/asked") >= number(&right, "/all/shown"), "{right}");
    assert_eq!(number(&right, "/wrong_names") as usize, 0, "{right}");
    let with_pose = number(&right, "/camera/position_m/count");
    assert!(with_pose >= 2.0 && number(&right, "/camera/position_m/median") < 0.05, "{right}");
    assert!(number(&right, "/camera/nees_of_view/median") < 8.0, "{right}");
    assert!(number(&right, "/measurements/nees_6/median") < 16.0, "{right}");

    // Each true position 30 cm higher than it is.
    let stated = world.poses.clone();
    for frame in world.poses["frames"].as_array_mut().expect("frames") {
        for row in frame["camera_from_world"].as_array_mut().expect("rows").iter_mut().take(3) {
            let by_z = row[2].as_f64().expect("a number");
            row[3] = json!(row[3].as_f64().expect("a number") - 0.3 * by_z);
        }
    }
    world.save();
    let moved = report(&[world.path()]);
    for position in ["/camera/position_m/median", "/measurements/position_m/median"] {
        assert!((0.25..0.35).contains(&number(&moved, position)), "{position}: {moved}");
    }
    for nees in ["/camera/nees_of_view/mean", "/camera/nees/mean", "/measurements/nees_3/mean"] {
        assert!(number(&moved, nees) > 3.0 * number(&right, nees), "{nees}: {moved} {right}");
    }
    for key in ["all", "by_kind", "wrong_names", "false_quads"] {
        assert_eq!(moved[key], right[key], "{key}");
    }

    // Every label has the name of the next poster.
    world.poses = stated;
    let names: Vec<String> = world.set.teach.iter().map(|t| t.landmark.clone()).collect();
    for quad in world.set.images.iter_mut().flat_map(|i| &mut i.quads) {
        let at = quad.landmark.as_ref().and_then(|name| names.iter().position(|n| n == name));
        quad.landmark = at.map(|at| names[(at + 1) % names.len()].clone());
    }
    world.save();
    let drawn = world.path().join("drawn");
    let run = evaluate(&["--misses", "--draw", &drawn.to_string_lossy()], &[world.path()]);
    assert!(run.status == 0 && run.stderr.contains("named_otherwise"), "{run:?}");
    let wrong = run.stderr.lines().filter(|l| l.contains(": WRONG ")).count();
    assert!(wrong as f64 >= named * posters as f64, "{run:?}");
    assert!(run.stdout.contains(&format!("wrong names: {wrong}\n")), "{run:?}");
    assert!(fs::read_dir(drawn).expect("drawings").count() > 0);
}

#[test]
fn a_world_without_poses_has_names_and_no_pose() {
    let world = World::new(9);
    fs::remove_file(world.path().join("world.json")).expect("world.json");
    let report = report(&[world.path()]);
    assert!(number(&report, "/by_kind/poster/named") >= 0.5, "{report}");
    assert_eq!(number(&report, "/camera/pictures") as usize, 0, "{report}");
    assert!(report["camera"]["position_m"]["median"].is_null(), "{report}");
    assert!(report["measurements"]["misfit"].is_null(), "{report}");
}

#[test]
fn strangers_are_not_named_and_sub_folders_are_found() {
    let (one, other) = (World::new(8), World::new(9));
    let both = TempDir::new().expect("a temporary directory");
    for (name, world) in [("1", &one), ("2", &other)] {
        fs::rename(world.path(), both.path().join(name)).expect("moved");
    }
    let run = evaluate(&["--json", "--strangers"], &[both.path()]);
    let report = run.last_json();
    assert_eq!(number(&report, "/worlds") as usize, 2, "{report}");
    let named = report["partial"]["named"].as_u64().zip(report["wrong_names"].as_u64());
    assert!(named == Some((0, 0)) && number(&report, "/all/named") <= 0.0, "{report}");
    assert!(number(&report, "/all/asked") > 0.3, "{report}");
    let alone = evaluate(&["--strangers"], &[&both.path().join("1")]);
    assert!(alone.status == 1 && alone.stderr.contains("two worlds"), "{alone:?}");
}

#[test]
fn a_wrong_world_is_refused_with_its_field() {
    let mut world = World::new(8);
    let stated = world.poses.clone();
    for (path, value, field) in [
        ("/frames/1/camera_from_world/0/0", json!(3.0), "frames[1].camera_from_world"),
        ("/frames/0/fx", json!(-1.0), "frames[0].fx"),
        ("/landmarks/2/corners/1/2", json!(9.0), "landmarks[2].corners"),
        ("/frames", json!([]), "frames: none is of frame-00.png"),
        ("/landmarks", json!([]), "landmarks: none is "),
    ] {
        world.poses = stated.clone();
        *world.poses.pointer_mut(path).expect("a field") = value;
        world.save();
        let run = evaluate(&[], &[world.path()]);
        assert_eq!((run.status, run.stdout.as_str()), (1, ""), "{run:?}");
        assert!(run.stderr.contains(field) && run.stderr.contains("world.json"), "{run:?}");
    }
}
