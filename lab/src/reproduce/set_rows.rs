//! Sets made by others.

use super::row::{
    Command, Figure,
    Presets::{Each, One},
    Row,
    Unit::{Count, Deg, M, Percent, Plain, Px, Share},
};

/// The worlds that nothing was chosen on.
macro_rules! worlds {
    () => {
        "outside photoreal/15 photoreal/16 photoreal/17 photoreal/18 photoreal/19 photoreal/20 photoreal/21 \
         photoreal/22 photoreal/23 photoreal/24 photoreal/25 photoreal/26 photoreal/27 photoreal/28"
    };
}
/// The landmarks of each picture, and a robot that goes from picture to picture.
const WORLDS: &str = concat!(worlds!(), " --walk");
const STRANGERS: &str = concat!(worlds!(), " --strangers");

const NAMES: [Figure; 12] = [
    Figure::more("detected at IoU 0.7", Share, "0/all/shown").of("0/all/full_views"),
    Figure::more("among the compared borders", Share, "0/all/asked"),
    Figure::less("false quads an image", Plain, "0/false_per_picture"),
    Figure::more("full views named", Share, "0/all/named").of("0/all/full_views"),
    Figure::more("without doors and windows", Share, "0/pictures_and_boards/named"),
    Figure::less("wrong names", Count, "0/wrong_names"),
    Figure::more("cut or hidden, named", Count, "0/partial/named").of("0/partial/views"),
    Figure::less("corners of posters and canvases, median", Px, "0/flat/answer_error_px/median"),
    Figure::less("landmark in the camera frame, median", M, "0/measurements/position_m/median"),
    Figure::less("camera position, median", M, "0/camera/position_m/median").of("0/camera/position_m/count"),
    Figure::less("camera position, 90 %", M, "0/camera/position_m/most"),
    Figure::less("camera position, worst", M, "0/camera/position_m/worst"),
];

const WALKED: [Figure; 7] = [
    Figure::more("pictures with a pose", Count, "0/walk/position_m/count").of("0/walk/pictures"),
    Figure::less("position, median", M, "0/walk/position_m/median"),
    Figure::less("position, 90 %", M, "0/walk/position_m/most"),
    Figure::less("position, worst", M, "0/walk/position_m/worst"),
    Figure::less("heading, median", Deg, "0/walk/direction_deg/median"),
    Figure::new("NEES of 3", Plain, "0/walk/nees/mean"),
    Figure::new("within their 95 %", Share, "0/walk/within_95"),
];

const FOUND: [Figure; 4] = [
    Figure::more("recall at IoU 0.7", Share, "0/recall_70").of("0/quads").within("0/recall_70_interval"),
    Figure::more("recall at IoU 0.85", Share, "0/recall_85").within("0/recall_85_interval"),
    Figure::less("false quads an image", Plain, "0/false_per_image").within("0/false_per_image_interval"),
    Figure::less("corners, median", Px, "0/corner_error_px"),
];

const fn of_set(
    full: &'static str,
    quick: &'static str,
    sets: &'static [&'static str],
    seconds: u32,
    figures: &'static [Figure],
) -> Command {
    Command { full, quick, presets: Each, sets, seconds, figures }
}

const BOARD: [Figure; 1] = [Figure::new("5 views, median", Percent, "0/sets/0/by_views/views=5/median")];
const CHESSBOARD: [Figure; 2] = [
    Figure::new("5 views of the chessboard, median", Percent, "0/sets/0/by_views/views=5/median"),
    Figure::new("10 views of the chessboard, median", Percent, "0/sets/0/by_views/views=10/median"),
];

const fn board(line: &'static str, sets: &'static [&'static str], figures: &'static [Figure]) -> Command {
    Command { full: line, quick: line, presets: One, sets, seconds: 5, figures }
}

pub(super) const SETS: [Row; 11] = [
    Row {
        id: "S1",
        title: "path-traced worlds of an independent generator",
        paper: "",
        commands: &[of_set(WORLDS, "outside photoreal/15 --walk", &["photoreal"], 30, &NAMES)],
    },
    Row {
        id: "S2",
        title: "a poster behind glass, filmed by hand",
        paper: "",
        commands: &[of_set(
            "outside poster-behind-glass",
            "outside poster-behind-glass",
            &["poster-behind-glass"],
            15,
            &[
                Figure::more("detected at IoU 0.7", Share, "0/all/shown").of("0/all/full_views"),
                Figure::more("full views named", Share, "0/all/named").of("0/all/full_views"),
                Figure::less("wrong names", Count, "0/wrong_names"),
                Figure::less("corners, median", Px, "0/all/answer_error_px/median"),
            ],
        )],
    },
    Row {
        id: "S3",
        title: "paintings on gallery walls: detection",
        paper: "",
        commands: &[of_set(
            "detection museum-paintings",
            "detection museum-paintings",
            &["museum-paintings"],
            15,
            &FOUND,
        )],
    },
    Row {
        id: "S4",
        title: "paintings on gallery walls: recognition among 287",
        paper: "",
        commands: &[of_set(
            "recognition museum-paintings",
            "recognition museum-paintings --generated-views 2",
            &["museum-paintings"],
            90,
            &[
                Figure::more("right", Count, "0/right"),
                Figure::less("wrong", Count, "0/wrong"),
                Figure::less("missed", Count, "0/missed"),
                Figure::less("distractors accepted", Count, "0/distractors_accepted"),
                Figure::more("distractors refused", Count, "0/distractors_refused"),
            ],
        )],
    },
    Row {
        id: "S5",
        title: "exit signs in corridors: detection",
        paper: "",
        commands: &[of_set(
            "detection exit-signs --min-side-px 20",
            "detection exit-signs --min-side-px 100",
            &["exit-signs"],
            30,
            &FOUND,
        )],
    },
    Row {
        id: "S6",
        title: "landmarks of another world shown",
        paper: "",
        commands: &[of_set(
            STRANGERS,
            "outside photoreal/15 photoreal/16 --strangers",
            &["photoreal"],
            40,
            &[Figure::less("wrong names", Count, "0/wrong_names")],
        )],
    },
    Row {
        id: "S7",
        title: "boards of others: focal length by one quad with one radial coefficient, against all points",
        paper: "below 1 % (Fig. 17)",
        commands: &[
            board("calibration calib-zhang --trials 1", &["calib-zhang"], &BOARD),
            board(
                "calibration calib-opencv-chessboard --trials 1",
                &["calib-opencv-chessboard"],
                &CHESSBOARD,
            ),
        ],
    },
    Row {
        id: "S8",
        title: "laser maps of public logs: error of relative poses",
        paper: "",
        commands: &[Command {
            full: "mapping laser-carmen-corrected laser-intel-raw-odometry --seed 1",
            quick: "mapping laser-carmen-corrected laser-intel-raw-odometry --seed 1",
            presets: One,
            sets: &["laser-carmen-corrected", "laser-intel-raw-odometry"],
            seconds: 90,
            figures: &[
                Figure::new("intel, raw odometry", M, "log=intel, raw odometry/error/translation_m"),
                Figure::new("aces", M, "log=aces/error/translation_m"),
                Figure::new("infinite-corridor", M, "log=infinite-corridor/error/translation_m"),
                Figure::new("freiburg-079", M, "log=freiburg-079/error/translation_m"),
            ],
        }],
    },
    Row {
        id: "S9",
        title: "unknown quads with photographs among them",
        paper: "",
        commands: &[of_set(
            "discrimination --photographs museum-paintings --photographs poster-textures-estense",
            "discrimination --photographs museum-paintings --photographs poster-textures-estense \
             --landmarks 3 --distractors 4 --views 1 --own-views 1",
            &["museum-paintings", "poster-textures-estense"],
            250,
            &[
                Figure::less("accepted", Count, "0/unknown/0/accepted").of("0/unknown/0/quads"),
                Figure::more("landmarks right", Count, "0/mated/right").of("0/mated/quads"),
                Figure::less("landmarks wrong", Count, "0/mated/wrong").of("0/mated/quads"),
            ],
        )],
    },
    Row {
        id: "S10",
        title: "occupancy grids: wall cells explained",
        paper: "",
        commands: &[Command {
            full: "grids maps-ros-grid",
            quick: "grids maps-ros-grid",
            presets: One,
            sets: &["maps-ros-grid"],
            seconds: 5,
            figures: &[
                Figure::new("mit-stata-basement, explained", Share, "map=mit-stata-basement/explained"),
                Figure::new("nav2-depot, explained", Share, "map=nav2-depot/explained"),
                Figure::new("nav2-warehouse, explained", Share, "map=nav2-warehouse/explained"),
                Figure::new("turtlebot3-world, explained", Share, "map=turtlebot3-world/explained"),
                Figure::new("upenn-levine-lobby, explained", Share, "map=upenn-levine-lobby/explained"),
            ],
        }],
    },
    Row {
        id: "S11",
        title: "a robot that goes from picture to picture of the same worlds, without a laser: its fused pose",
        paper: "",
        commands: &[of_set(WORLDS, "outside photoreal/15 --walk", &["photoreal"], 30, &WALKED)],
    },
];
