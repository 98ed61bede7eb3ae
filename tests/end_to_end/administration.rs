//! Claim: the commands against a running server teach, show and change its maps, say what to do
//! next, ask before they destroy, and end with an exit status for each class of failure. What is
//! refused leaves nothing behind.

use client::api::{LandmarkStatus, WallBody};
use serde_json::Value;
use std::{fs, path::Path, time::Duration};
use tempfile::TempDir;
use tests::{
    Child,
    command::{Run, waymark},
    pictures::{blocks, png},
};

const LONGEST: Duration = Duration::from_mins(3);
/// An address where no server is.
const NOBODY: &str = "http://127.0.0.1:1";

/// A server and a folder for photographs.
struct Desk {
    server: Child,
    folder: TempDir,
}

impl Desk {
    fn new() -> Self {
        Self::with(&[])
    }

    /// The server has these settings, as environment variables.
    fn with(settings: &[(&str, &str)]) -> Self {
        let folder = TempDir::new().expect("a temporary directory");
        Self { server: Child::start_with(&folder.path().join("data"), settings), folder }
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).to_str().expect("text").to_owned()
    }

    /// Runs a command line against the server.
    fn run(&self, line: &str) -> Run {
        waymark(line.split(' ').chain(["--server", &self.server.url]), LONGEST)
    }

    /// Runs one that must succeed, and gives standard output.
    fn done(&self, line: &str) -> String {
        let run = self.run(line);
        assert_eq!(run.status, 0, "`{line}`: {run:?}");
        run.stdout
    }

    /// Runs one that must fail with this status, with and without --json. Gives the sentence for
    /// people.
    fn failed(&self, line: &str, status: i32, code: &str) -> String {
        let run = self.run(line);
        assert_eq!((run.status, run.stdout.as_str()), (status, ""), "`{line}`: {run:?}");
        let json = self.run(&format!("{line} --json"));
        let error: Value =
            serde_json::from_str(&json.stderr).unwrap_or_else(|e| panic!("`{line}`: {e}: {json:?}"));
        assert_eq!((json.status, &error["error"]["code"]), (status, &code.into()), "`{line}`: {json:?}");
        assert_eq!(error["error"]["exit_status"], status, "{json:?}");
        run.stderr
    }
}

/// A scan: nothing but a picture.
fn scan(path: &str, seed: u64) {
    fs::write(path, png(240, 180, &blocks(seed, 240, 180))).expect("a picture");
}

/// A wall with framed pictures side by side.
fn wall_with(path: &str, seeds: &[u64]) {
    let (width, height) = (320 * seeds.len(), 400);
    let mut grey = vec![120_u8; width * height];
    for (i, seed) in seeds.iter().enumerate() {
        let picture = blocks(*seed, 160, 200);
        for v in 0..240 {
            for u in 0..200 {
                let is_frame = !(20..180).contains(&u) || !(20..220).contains(&v);
                let level = if is_frame { 250 } else { picture[(v - 20) * 160 + u - 20] };
                grey[(80 + v) * width + 320 * i + 60 + u] = level;
            }
        }
    }
    fs::write(path, png(width, height, &grey)).expect("a picture");
}

#[test]
fn empty_lists_say_what_to_do() {
    let desk = Desk::new();
    let empty = |line: &str, advice: &str| {
        let run = desk.run(line);
        assert_eq!((run.status, run.stdout.as_str()), (0, ""), "`{line}`: {run:?}");
        assert!(run.stderr.contains(advice), "`{line}`: {run:?}");
        assert_eq!(desk.done(&format!("{line} --json")), "[]\n", "`{line}`");
    };
    empty("map list", "waymark map create NAME");
    empty("robot list", "waymark robot add NAME --map MAP");
    assert!(desk.failed("landmark list", 3, "no_map").contains("waymark map create NAME"));
    desk.done("map create office");
    // The only map is the one that is meant.
    empty("landmark list", "waymark landmark teach NAME PHOTO");
    empty("gathering list", "waymark gathering start ROBOT");
    empty("run list", "waymark run start ROBOT");
    empty("map walls office", "waymark map import office FILE");
    let status = desk.done("server status");
    assert!(status.contains("ready") && status.contains("1 map with 0 landmarks"), "{status}");
    desk.server.kill();
}

#[test]
fn every_class_of_failure_has_its_exit_status_and_names_the_next_command() {
    let desk = Desk::new();
    desk.done("map create museum");
    desk.done("map create office");
    let missing = desk.failed("map show offices", 3, "unknown_map");
    assert!(missing.contains("There is no map `offices` (there are: museum, office)."), "{missing}");
    assert!(missing.contains("waymark map create offices"), "{missing}");
    assert!(desk.failed("landmark list", 2, "usage").contains("There are museum, office."));
    desk.failed("map create office", 4, "exists");
    let robot = desk.failed("robot show r1", 3, "unknown_robot");
    assert!(robot.contains("(there is none yet)") && robot.contains("waymark robot add r1"), "{robot}");
    let landmark = desk.failed("landmark show poster --map office", 3, "unknown_landmark");
    assert!(landmark.contains("waymark landmark teach poster PHOTO"), "{landmark}");
    let blank = desk.path("blank.png");
    fs::write(&blank, png(320, 240, &vec![128; 320 * 240])).expect("a picture");
    let refused = desk.failed(&format!("landmark teach poster {blank} --map office"), 5, "quad_not_found");
    assert!(refused.contains("No four edges found") && refused.contains("--whole-image"), "{refused}");
    assert_eq!(
        desk.done("landmark list --map office --json"),
        "[]\n",
        "nothing is made where teaching fails"
    );
    for line in ["map delete office", "landmark delete poster --map office"] {
        let code = if line.starts_with("map") { "not_confirmed" } else { "unknown_landmark" };
        desk.failed(line, if line.starts_with("map") { 2 } else { 3 }, code);
    }
    let run = waymark(["map", "list", "--server", NOBODY], LONGEST);
    assert_eq!(run.status, 6, "{run:?}");
    assert!(run.stderr.contains("No server answers") && run.stderr.contains("waymark serve"), "{run:?}");
    desk.done("map delete office --yes");
    assert_eq!(desk.done("map list").lines().count(), 1);
    desk.server.kill();
}

#[test]
fn a_map_gets_another_name_while_nothing_works_on_it() {
    let desk = Desk::new();
    desk.done("map create hall");
    desk.done("map create office");
    desk.failed("map rename hall office", 4, "exists");
    assert!(desk.failed("map rename hall Hall", 2, "usage").contains("use `hall`?"));
    desk.done("robot add r1 --map hall");
    let busy = desk.failed("map rename hall lobby", 4, "in_use");
    assert!(busy.contains("robot `r1`"), "{busy}");
    desk.done("robot add r1 --map office");
    let photograph = desk.path("poster.png");
    wall_with(&photograph, &[1]);
    desk.done(&format!("landmark teach poster {photograph} --map hall"));
    assert!(desk.done("map rename hall lobby").contains("lobby now"));
    desk.failed("map show hall", 3, "unknown_map");
    let found: Value = serde_json::from_str(&desk.done("map show lobby --json")).expect("JSON");
    let found = &found["map"];
    assert_eq!((&found["name"], &found["landmarks"]), (&"lobby".into(), &1.into()), "{found}");
    // What is recognised is recognised under the new name at once.
    let seen = desk.done(&format!("recognise {photograph} --map lobby --json"));
    let seen: Value = serde_json::from_str(&seen).expect("JSON");
    assert_eq!(seen["map"], "lobby", "{seen}");
    desk.server.kill();
}

#[test]
fn a_map_or_a_photograph_is_compared_by_the_papers_pipeline() {
    let desk = Desk::new();
    desk.done("map create office");
    let photograph = desk.path("poster.png");
    wall_with(&photograph, &[1]);
    desk.done(&format!("landmark teach poster {photograph} --map office"));
    let points_decide = |options: &str| {
        let line = format!("recognise {photograph} --map office --json {options}");
        let seen = desk.done(line.trim_end());
        let seen: Value = serde_json::from_str(&seen).expect("JSON");
        let candidate = &seen["quads"][0]["candidates"][0];
        assert_eq!(candidate["landmark"], "poster", "{seen}");
        candidate["correlation"].is_null()
    };
    assert!(points_decide("") && !points_decide("--preset paper"));
    assert!(desk.done("map pipeline office --preset paper").contains("paper, distance hausdorff"));
    // The paper refuses what was photographed from one side, until a person wants it all the same.
    assert!(desk.done("landmark show poster --map office").contains("not in use"));
    desk.done("landmark learning poster --map office --use-despite-gates true --why compared");
    assert!(!points_decide("") && points_decide("--preset default"));
    let both = desk.done("map pipeline office --distance correlation");
    assert!(both.contains("paper, distance correlation"), "{both}");
    assert!(desk.done("map show office").contains("paper, distance correlation"));
    assert!(desk.done("map pipeline office --preset server").contains("server's settings, distance both"));
    assert!(points_decide(""));
    desk.failed("map pipeline office", 2, "usage");
    let unknown = desk.failed("map pipeline office --preset papers", 2, "usage");
    assert!(unknown.contains("default, paper, server"), "{unknown}");
    desk.server.kill();
}

#[test]
fn one_of_several_framed_things_is_picked() {
    let desk = Desk::new();
    desk.done("map create office");
    let hall = desk.path("hall.png");
    wall_with(&hall, &[1, 2]);
    let refused = desk.failed(&format!("landmark teach right {hall}"), 5, "quad_ambiguous");
    assert!(refused.contains("2 framed objects found") && refused.contains("--pick N"), "{refused}");
    assert!(Path::new(&desk.path("hall.quads.png")).is_file(), "{refused}");
    assert_eq!(desk.done("landmark list --json"), "[]\n");
    assert!(
        desk.failed(&format!("landmark teach right {hall} --pick 3"), 2, "usage")
            .contains("2 framed objects")
    );
    desk.done(&format!("landmark teach right {hall} --pick 2"));
    let views: Value = serde_json::from_str(&desk.done("view list right --json")).expect("JSON");
    let left_edge = views[0]["corners"][0][0].as_f64().expect("a number");
    assert!((left_edge - 380.0).abs() < 25.0, "{views}");
    desk.server.kill();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_landmark_is_taught_changed_and_deleted() {
    let desk = Desk::new();
    desk.done("map create office");
    let (first, other) = (desk.path("first.png"), desk.path("other.png"));
    scan(&first, 3);
    scan(&other, 4);
    let teach = |name: &str, file: &str, size: &str| {
        format!("landmark teach {name} {file} --whole-image --size {size}")
    };
    let size = desk.failed(&teach("first", &first, "60x84"), 2, "not_confirmed");
    assert!(size.contains("sizes are in metres") && size.contains("--yes"), "{size}");
    let taught = desk.run(&teach("first", &first, "0.6x0.84"));
    assert!(taught.status == 0 && taught.stdout.contains("first: active, 1 training view"), "{taught:?}");
    assert!(taught.stderr.contains("waymark landmark place first"), "{taught:?}");
    // The size given again is applied, and said.
    let again = desk.run(&teach("first", &first, "0.5x0.7"));
    assert!(again.status == 0 && again.stderr.contains("size 0.6 x 0.84 m -> 0.5 x 0.7 m"), "{again:?}");
    assert!(again.stdout.contains("size    0.5 x 0.7 m"), "{again:?}");
    desk.done("landmark size first 0.6x0.84");
    desk.failed("landmark size first 60x84", 2, "not_confirmed");
    desk.done(&teach("other", &other, "0.3x0.2"));
    desk.failed("landmark rename other first", 4, "exists");
    desk.done("landmark rename other second");
    assert_eq!(desk.done("landmark list").lines().count(), 2);
    place(&desk).await;
    assert!(desk.done("landmark health first quarantined").contains("health  quarantined"));
    let own = desk.done("map learning office --min-views 4 --why few");
    assert_eq!(own, "office: --min-views 4, because: few\n");
    let own = desk.done("landmark learning first --min-views 5 --why few");
    assert!(own.contains("own     --min-views 5, because: few"), "{own}");
    let icon = desk.path("icon.png");
    desk.done(&format!("view show first 1 --out {icon}"));
    assert!(image::open(&icon).is_ok());
    let photograph = desk.path("photograph");
    desk.done(&format!("view image first 1 --out {photograph}"));
    assert_eq!(
        std::fs::read(photograph).expect("the photograph"),
        std::fs::read(&first).expect("the original")
    );
    let seen = desk.done(&format!("recognise {first}"));
    assert!(seen.starts_with(&first), "{seen}");
    desk.failed("landmark delete first second", 2, "not_confirmed");
    desk.done("landmark delete first second --yes");
    assert_eq!(desk.done("landmark list --json"), "[]\n");
    desk.server.kill();
}

/// Walls by import, with the difference first; a place by tape measure.
async fn place(desk: &Desk) {
    let file = desk.path("hall.txt");
    fs::write(&file, "0, 0, 6, 0\n6, 0, 6, 4\n").expect("written");
    let import = format!("map import office {file}");
    assert!(desk.done(&import).contains("10.0 m come"));
    fs::write(&file, "0, 0, 6, 0\n").expect("written");
    let dry = desk.done(&format!("{import} --dry-run"));
    assert!(dry.contains("4.0 m go") || dry.contains("3.8 m go"), "{dry}");
    let asked = desk.failed(&import, 2, "not_confirmed");
    assert!(asked.contains("Replace its walls?") && asked.contains("2 -> 1 segments"), "{asked}");
    assert_eq!(desk.done("map walls office").lines().count(), 2, "nothing was changed");
    desk.done(&format!("{import} --yes"));
    let walls = desk.server.maps().walls("office").await.expect("walls");
    assert_eq!(walls.segments, [WallBody::between([0.0, 0.0], [6.0, 0.0])]);
    let beyond = desk.failed("landmark place first --wall 1 --at 7 --height 1.5", 2, "usage");
    assert!(beyond.contains("6.00 m long"), "{beyond}");
    assert!(
        desk.failed("landmark place first --wall 2 --at 1 --height 1.5", 3, "unknown_wall")
            .contains("map walls")
    );
    desk.done("landmark place first --wall 1 --at 2 --height 1.5");
    let first = desk.server.maps().landmark("office", "first").await.expect("a landmark");
    let place = first.place.expect("a place");
    // From the left end as one stands before the wall, free above it: x = 6 - 2.
    assert!((place.x_m - 4.0).abs() < 1e-9 && place.y_m.abs() < 1e-9, "{place:?}");
    assert!((place.theta_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-9, "{place:?}");
    desk.done("landmark place second --xy 1,2 --facing 90 --lower-edge 1.4");
    let second = desk.server.maps().landmark("office", "second").await.expect("a landmark");
    assert!(second.place.is_some_and(|p| (p.z_m - 1.5).abs() < 1e-9), "{second:?}");
    let drawn = desk.path("walls.svg");
    desk.done(&format!("map walls office --draw {drawn}"));
    assert!(fs::read_to_string(&drawn).expect("a picture").contains(">1</text>"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_landmark_that_looks_like_an_active_one_is_refused_with_its_name() {
    let desk = Desk::new();
    desk.done("map create office");
    let scanned = desk.path("first.png");
    scan(&scanned, 5);
    desk.done(&format!("landmark teach first {scanned} --whole-image"));
    let refused = desk.run(&format!("landmark teach copy {scanned} --whole-image"));
    assert_eq!(refused.status, 5, "{refused:?}");
    assert!(
        refused.stderr.contains("copy is not in use") && refused.stderr.contains("`first`"),
        "{refused:?}"
    );
    let first = desk.server.maps().landmark("office", "first").await.expect("a landmark");
    assert_eq!(first.status, LandmarkStatus::Active, "the one in use stays as it is");
    let shown = desk.done("landmark show copy");
    assert!(shown.contains("copy: not in use") && shown.contains("`first`"), "{shown}");
    desk.server.kill();
}

/// A room of 3 m by 2 m as a grid of `map_server`.
fn write_grid(yaml: &str) {
    let (width, height) = (60, 40);
    let mut pgm = format!("P5 {width} {height} 255\n").into_bytes();
    for (v, u) in (0..height).flat_map(|v| (0..width).map(move |u| (v, u))) {
        let is_wall = v < 2 || u < 2 || v >= height - 2 || u >= width - 2;
        pgm.push(if is_wall { 0 } else { 254 });
    }
    fs::write(Path::new(yaml).with_file_name("floor.pgm"), pgm).expect("a picture");
    let text = "image: floor.pgm\nresolution: 0.05\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n\
                free_thresh: 0.196\n";
    fs::write(yaml, text).expect("a grid");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_picture_of_a_grid_becomes_the_underlay() {
    let desk = Desk::new();
    desk.done("map create office");
    let yaml = desk.path("floor.yaml");
    write_grid(&yaml);
    let import = format!("map import office {yaml}");
    let dry = desk.done(&format!("{import} --dry-run"));
    assert!(dry.contains("(60 x 40 px) would become the underlay") && dry.contains("Nothing"), "{dry}");
    let without: Value =
        serde_json::from_str(&desk.done(&format!("{import} --no-underlay --json"))).expect("JSON");
    assert_eq!(without["underlay"], Value::Null);
    desk.server.maps().underlay("office").await.expect_err("neither has uploaded it");
    let result: Value = serde_json::from_str(&desk.done(&format!("{import} --yes --json"))).expect("JSON");
    assert_eq!(result["underlay"]["changed"], true, "{result}");
    let underlay = desk.server.maps().underlay("office").await.expect("an underlay");
    assert_eq!((underlay.width_px, underlay.height_px), (60, 40));
    assert_eq!((underlay.place.metres_per_pixel, underlay.place.x_m, underlay.place.y_m), (0.05, -1.0, 2.0));
    assert!(desk.failed(&import, 2, "not_confirmed").contains("Replace its walls and its underlay?"));
    desk.server.kill();
}

#[tokio::test(flavor = "multi_thread")]
async fn walls_are_imported_where_the_picture_is_too_large() {
    let desk = Desk::with(&[("WAYMARK_LIMITS__UPLOAD_PIXELS", "1000")]);
    desk.done("map create office");
    let yaml = desk.path("floor.yaml");
    write_grid(&yaml);
    let refused = desk.done(&format!("map import office {yaml}"));
    assert!(refused.contains("(60 x 40 px) is not the underlay: "), "{refused}");
    let result = desk.done(&format!("map import office {yaml} --yes --json"));
    let result: Value = serde_json::from_str(&result).expect("JSON");
    let underlay = &result["underlay"];
    assert_eq!((&underlay["changed"], &underlay["refusal"]["code"]), (&false.into(), &"too_large".into()));
    assert!(!desk.server.maps().walls("office").await.expect("walls").segments.is_empty());
    desk.server.maps().underlay("office").await.expect_err("none");
    desk.server.kill();
}
