//! What the paper does not measure.

use super::row::{
    Command, Figure,
    Presets::{Each, One},
    Row,
    Unit::{Count, Deg, M, Plain},
};

/// What no preset changes.
const fn once(full: &'static str, quick: &'static str, seconds: u32, figures: &'static [Figure]) -> Command {
    Command { full, quick, presets: One, sets: &[], seconds, figures }
}

/// Of surveys.
const SURVEYED: [Figure; 13] = [
    Figure::new("posters that became landmarks", Count, "0/placed").of("0/shown"),
    Figure::new("landmarks that are something else", Count, "0/strangers"),
    Figure::new("landmark, median", M, "0/joint_m/median"),
    Figure::new("landmark, 95 %", M, "0/joint_m/p95"),
    Figure::new("after alignment, median", M, "0/joint_aligned_m/median"),
    Figure::new("after alignment, 95 %", M, "0/joint_aligned_m/p95"),
    Figure::new("by two steps, median", M, "0/two_steps_m/median"),
    Figure::new("by two steps, 95 %", M, "0/two_steps_m/p95"),
    Figure::new("by two steps, after alignment, 95 %", M, "0/two_steps_aligned_m/p95"),
    Figure::new("size in percent, 95 %", Plain, "0/size_percent/p95"),
    Figure::new("mounting as stated, 95 %", Deg, "0/stated_deg/p95"),
    Figure::new("mounting as found, 95 %", Deg, "0/found_deg/p95"),
    Figure::new("NEES of a degree of freedom", Plain, "0/nees"),
];

pub(super) const BEYOND: [Row; 9] = [
    Row {
        id: "B1",
        title: "confidences",
        paper: "",
        commands: &[Command {
            full: "confidence",
            quick: "confidence --quads 100",
            presets: Each,
            sets: &[],
            seconds: 400,
            figures: &[
                Figure::less("expected calibration error", Plain, "0/results/distance=both/ece")
                    .within("0/results/distance=both/ece_interval"),
                Figure::less("the same, H^r", Plain, "0/results/distance=hausdorff/ece")
                    .within("0/results/distance=hausdorff/ece_interval"),
            ],
        }],
    },
    Row {
        id: "B2",
        title: "look-alikes, one of each pair taught: accepted",
        paper: "",
        commands: &[Command {
            full: "lookalikes --pairs 16",
            quick: "lookalikes --pairs 2 --views 1",
            presets: Each,
            sets: &[],
            seconds: 200,
            figures: &[
                Figure::less("a quarter replaced", Count, "0/kinds/change=a quarter/alone/look_alike")
                    .of("0/kinds/change=a quarter/alone/views"),
                Figure::less("one block of 25", Count, "0/kinds/change=one block/alone/look_alike")
                    .of("0/kinds/change=one block/alone/views"),
                Figure::less("a line of text", Count, "0/kinds/change=text/alone/look_alike")
                    .of("0/kinds/change=text/alone/views"),
                Figure::less("other tones", Count, "0/kinds/change=tones/alone/look_alike")
                    .of("0/kinds/change=tones/alone/views"),
                Figure::less("another door number", Count, "0/kinds/change=doors/alone/look_alike")
                    .of("0/kinds/change=doors/alone/views"),
            ],
        }],
    },
    Row {
        id: "B3",
        title: "poses by landmarks with errors of corners, places and mounting",
        paper: "",
        commands: &[once(
            "pose --no-peers",
            "pose --no-peers --draws 100 --drives 2",
            30,
            &[
                Figure::new("cells within 95 %", Count, "0/cells_inside_95"),
                Figure::new("unflagged flips", Count, "0/unflagged_flips"),
                Figure::new("robot by one landmark, RMS", M, "0/joint/0/rms_m"),
                Figure::new("by two", M, "0/joint/1/rms_m"),
                Figure::new("by three", M, "0/joint/2/rms_m"),
                Figure::new("NEES of 3, by one", Plain, "0/joint/0/nees"),
            ],
        )],
    },
    Row {
        id: "B4",
        title: "places of landmarks",
        paper: "",
        commands: &[once(
            "placement",
            "placement --rooms 10 --corridors 1 --views 2",
            60,
            &[
                Figure::new("wall, one view, median", M, "0/summaries/what=rooms, walls, one view/median_m"),
                Figure::new("its NEES of 6", Plain, "0/summaries/what=rooms, walls, one view/nees"),
                Figure::new(
                    "wall, several views, median",
                    M,
                    "0/summaries/what=rooms, walls, several views/median_m",
                ),
                Figure::new(
                    "its NEES of 6, several views",
                    Plain,
                    "0/summaries/what=rooms, walls, several views/nees",
                ),
                Figure::new(
                    "rendered posters, median",
                    M,
                    "0/summaries/what=rendered corridor, posters, detector/median_m",
                ),
                Figure::new(
                    "rendered lamps, median",
                    M,
                    "0/summaries/what=rendered corridor, lamps, detector/median_m",
                ),
            ],
        )],
    },
    Row {
        id: "B5",
        title: "cameras at any roll",
        paper: "",
        commands: &[once(
            "roll",
            "roll --posters 2 --views 1",
            40,
            &[
                Figure::new("named at 0 deg", Count, "0/rolls/roll_deg=0.0/named")
                    .of("0/rolls/roll_deg=0.0/shown"),
                Figure::new("named at 90 deg", Count, "0/rolls/roll_deg=90.0/named")
                    .of("0/rolls/roll_deg=90.0/shown"),
                Figure::new("named at 150 deg", Count, "0/rolls/roll_deg=150.0/named")
                    .of("0/rolls/roll_deg=150.0/shown"),
                Figure::new("position at 90 deg, median", M, "0/rolls/roll_deg=90.0/robot/median_m"),
                Figure::new("position at 90 deg, worst", M, "0/rolls/roll_deg=90.0/robot/worst_m"),
            ],
        )],
    },
    Row {
        id: "B6",
        title: "modalities by area: position, 95 %",
        paper: "",
        commands: &[once(
            "modalities",
            "modalities --runs 1 --drives 1",
            20,
            &[
                Figure::new("stated errors", M, "0/rows/way=untaught&zone=all/p95_m"),
                Figure::new("measured errors", M, "0/rows/way=all, with error models&zone=all/p95_m"),
                Figure::new("the best alone", M, "0/rows/way=best&zone=all/p95_m"),
            ],
        )],
    },
    Row {
        id: "B7",
        title: "visibility areas against brute force",
        paper: "",
        commands: &[once(
            "visibility --seed 1",
            "visibility --seed 1 --maps 2 --points 200",
            30,
            &[Figure::new("points that differ", Count, "0/differ").of("0/points")],
        )],
    },
    Row {
        id: "B8",
        title: "surveys of one drive, 25 m with uneven walls: landmarks, camera and sizes",
        paper: "",
        commands: &[once(
            "survey --buildings 12 --seed 701",
            "survey --buildings 1 --length-m 10 --posters 2",
            300,
            &SURVEYED,
        )],
    },
    Row {
        id: "B9",
        title: "the same, surveys of two drives",
        paper: "",
        commands: &[once(
            "survey --drives 2 --buildings 8 --seed 821",
            "survey --drives 2 --buildings 1 --length-m 12 --posters 4",
            300,
            &SURVEYED,
        )],
    },
];
