//! The paper's experiments, E1 to E14 (method 18).

use super::row::{
    Command, Figure,
    Presets::{Each, One},
    Row,
    Unit::{Bytes, Count, Deg, M, Percent, Plain, Px, Share},
};

const CORRIDOR: Command = Command {
    full: "detection corridor --seed 931",
    quick: "detection corridor --seed 931 --views 4",
    presets: Each,
    sets: &[],
    seconds: 40,
    figures: &[
        Figure::more("recall at IoU 0.7", Share, "0/recall_70").of("0/quads").within("0/recall_70_interval"),
        Figure::more("recall at IoU 0.85", Share, "0/recall_85").within("0/recall_85_interval"),
        Figure::more("posters to 50 deg, recall at IoU 0.7", Share, "0/by_class_ahead/poster/recall_70")
            .of("0/by_class_ahead/poster/quads")
            .within("0/by_class_ahead/poster/recall_70_interval"),
        Figure::more("doors, recall at IoU 0.7", Share, "0/by_class/door/recall_70")
            .of("0/by_class/door/quads")
            .within("0/by_class/door/recall_70_interval"),
        Figure::less("false quads an image", Plain, "0/false_per_image").within("0/false_per_image_interval"),
        Figure::less("corners, median", Px, "0/corner_error_px"),
    ],
};

const DISCRIMINATION: &str = "discrimination";
const FEW_DISTRACTORS: &str = "discrimination --landmarks 3 --distractors 4 --views 1 --own-views 1";
/// A command of the discrimination, which several rows read.
const fn discrimination(figures: &'static [Figure]) -> Command {
    Command { full: DISCRIMINATION, quick: FEW_DISTRACTORS, presets: Each, sets: &[], seconds: 200, figures }
}

/// A sweep over one condition.
const fn sweep(full: &'static str, quick: &'static str, seconds: u32, figures: &'static [Figure]) -> Command {
    Command { full, quick, presets: Each, sets: &[], seconds, figures }
}

const NAVIGATION: &str = "navigation";
const ONE_DRIVE: &str = "navigation --drives 1 --length-m 8 --rate-hz 1 --views 4";

const fn navigation(figures: &'static [Figure]) -> Command {
    Command { full: NAVIGATION, quick: ONE_DRIVE, presets: Each, sets: &[], seconds: 400, figures }
}

/// The same of another building; the figures name the seed.
macro_rules! navigation_of {
    ($seed:literal) => {
        Command {
            full: concat!("navigation --seed ", $seed),
            quick: concat!("navigation --drives 1 --length-m 8 --rate-hz 1 --views 4 --seed ", $seed),
            presets: Each,
            sets: &[],
            seconds: 100,
            figures: &[
                Figure::less(concat!("seed ", $seed, ": along, median"), M, "0/along_m/median"),
                Figure::less(concat!("seed ", $seed, ": along, 95 %"), M, "0/along_m/p95"),
                Figure::less(concat!("seed ", $seed, ": along, worst"), M, "0/along_m/worst"),
                Figure::new(concat!("seed ", $seed, ": NEES of 3"), Plain, "0/nees"),
            ],
        }
    };
}

/// A survey of two drives, and drives in its map; the figures name the seed.
macro_rules! in_survey {
    ($seed:literal) => {
        Command {
            full: concat!("navigation --survey 2 --drives 2 --rate-hz 2 --seed ", $seed),
            quick: concat!("navigation --survey --drives 1 --length-m 8 --rate-hz 1 --seed ", $seed),
            presets: One,
            sets: &[],
            seconds: 40,
            figures: &[
                Figure::new(concat!("seed ", $seed, ": along, 95 %"), M, "0/along_m/p95"),
                Figure::new(concat!("seed ", $seed, ": along, worst"), M, "0/along_m/worst"),
                Figure::new(concat!("seed ", $seed, ": NEES of 3"), Plain, "0/nees"),
                Figure::new(concat!("seed ", $seed, ": fewest corrections"), Count, "0/corrections_fewest"),
                Figure::new(concat!("seed ", $seed, ": false matches"), Count, "0/false_matches")
                    .of("0/frames"),
            ],
        }
    };
}

pub(super) const ROWS: [Row; 15] = [
    Row {
        id: "E1",
        title: "detection in a corridor",
        paper: "88 % of about 300 images, none false (2.3)",
        commands: &[CORRIDOR],
    },
    Row {
        id: "E2",
        title: "data of the recognition",
        paper: "270 images, 300 posters (3.6)",
        commands: &[discrimination(&[
            Figure::new("landmarks", Count, "0/landmarks"),
            Figure::new("views of them", Count, "0/mated/quads"),
            Figure::new("distractors", Count, "0/unknown/0/textures"),
            Figure::new("views of distractors", Count, "0/unknown/0/quads"),
        ])],
    },
    Row {
        id: "E3",
        title: "distances of one landmark and of all else",
        paper: "normal, small overlap; H^r 0 to 10, C^r 0 to 1.4 (Fig. 11)",
        commands: &[discrimination(&[
            Figure::new("H^r, own, mean", Plain, "0/histograms/0/own_normal/0"),
            Figure::new("H^r, others, mean", Plain, "0/histograms/0/other_normal/0"),
            Figure::less("H^r, overlap", Share, "0/histograms/0/overlap"),
            Figure::new("C^r, own, mean", Plain, "0/histograms/1/own_normal/0"),
            Figure::new("C^r, others, mean", Plain, "0/histograms/1/other_normal/0"),
            Figure::less("C^r, overlap", Share, "0/histograms/1/overlap"),
        ])],
    },
    Row {
        id: "E4",
        title: "errors of the thresholds",
        paper: "false positives about 1 %, false negatives about 30 % (3.6)",
        commands: &[discrimination(&[
            Figure::less("H^r, false positives", Count, "0/pairs/0/false_positives").of("0/pairs/0/unknown"),
            Figure::less("H^r, false negatives", Count, "0/pairs/0/false_negatives").of("0/pairs/0/own"),
            Figure::less("C^r, false positives", Count, "0/pairs/1/false_positives").of("0/pairs/1/unknown"),
            Figure::less("C^r, false negatives", Count, "0/pairs/1/false_negatives").of("0/pairs/1/own"),
        ])],
    },
    Row {
        id: "E5",
        title: "apparent size, from 300 px down",
        paper: "below 1 over a factor of about 3 (Fig. 12)",
        commands: &[sweep("scale", "scale --landmarks 2 --views 1", 150, &CROSSINGS_PX)],
    },
    Row {
        id: "E6",
        title: "angle of view",
        paper: "below 1 up to 75 degrees (Fig. 12)",
        commands: &[sweep("viewpoint", "viewpoint --landmarks 2 --views 1", 150, &CROSSINGS_DEG)],
    },
    Row {
        id: "E7",
        title: "light",
        paper: "below 0.8 until saturation (Fig. 13)",
        commands: &[sweep("illumination", "illumination --landmarks 2 --views 1", 300, &LIGHT)],
    },
    Row {
        id: "E8",
        title: "central occlusion",
        paper: "46 % (H^r), 56 % (C^r) of the area (Fig. 13)",
        commands: &[sweep("occlusion", "occlusion --landmarks 2 --views 1", 130, &CROSSINGS_HIDDEN)],
    },
    Row {
        id: "E9",
        title: "focal length from views of one quad",
        paper: "C1 alone below 1 % with 5 to 10 views (Fig. 17)",
        commands: &[Command {
            full: "calibration",
            quick: "calibration --trials 2",
            presets: One,
            sets: &[],
            seconds: 60,
            figures: &[
                Figure::new("C1, 5 views, 0.5 px, median", Percent, C1_OF_5),
                Figure::new("C1, 10 views, 0.5 px, median", Percent, C1_OF_10),
                Figure::new("refined, 10 views, 0.5 px, median", Percent, REFINED_OF_10),
            ],
        }],
    },
    Row {
        id: "E10",
        title: "navigation in a corridor of 25 m with four posters",
        paper: "13 corrections, below 20 cm along (5)",
        commands: &[
            navigation(&[
                Figure::more("corrections by landmarks", Count, "0/corrections"),
                Figure::new("drives", Count, "0/drives"),
                Figure::less("along the corridor, median", M, "0/along_m/median"),
                Figure::less("along the corridor, 95 %", M, "0/along_m/p95"),
                Figure::less("along the corridor, worst", M, "0/along_m/worst"),
                Figure::less("across, 95 %", M, "0/across_m/p95"),
                Figure::new("NEES of 3", Plain, "0/nees"),
            ]),
            navigation_of!("2"),
            navigation_of!("3"),
        ],
    },
    Row {
        id: "E10S",
        title: "the same in the map of one survey of two drives (`waymark survey A B`), two drives each, 2 Hz",
        paper: "",
        commands: &[in_survey!("36"), in_survey!("37"), in_survey!("38"), in_survey!("39"), in_survey!("40")],
    },
    Row {
        id: "E11",
        title: "recognition of the whole system",
        paper: "above 97 % (5)",
        commands: &[
            discrimination(&[
                Figure::more("views named right", Count, "0/mated/right").of("0/mated/quads"),
                Figure::less("views named wrong", Count, "0/mated/wrong").of("0/mated/quads"),
                Figure::less("distractors accepted", Count, "0/unknown/0/accepted").of("0/unknown/0/quads"),
            ]),
            navigation(&[
                Figure::more("full views named on drives", Count, "0/recognised").of("0/shown"),
                Figure::less("false matches on drives", Count, "0/false_matches").of("0/frames"),
            ]),
        ],
    },
    Row {
        id: "E12",
        title: "the same drives by odometry alone",
        paper: "drawn (Fig. 15)",
        commands: &[navigation(&[
            Figure::new("along the corridor, 95 %", M, "0/odometry_along_m/p95"),
            Figure::new("across, 95 %", M, "0/odometry_across_m/p95"),
        ])],
    },
    Row {
        id: "E13",
        title: "the drawn map: walls, landmarks, doors",
        paper: "drawn (Fig. 6)",
        commands: &[Command {
            full: "drawing",
            quick: "drawing --views 3",
            presets: One,
            sets: &[],
            seconds: 20,
            figures: &[
                Figure::new("walls", Count, "0/walls"),
                Figure::new("landmarks placed", Count, "0/placed").of("0/landmarks"),
                Figure::new("doors placed", Count, "0/doors_placed").of("0/doors"),
                Figure::new("error of a place, median", M, "0/place_error_m"),
            ],
        }],
    },
    Row {
        id: "E14",
        title: "what each distance keeps of a landmark; crossings are in E5 to E8",
        paper: "C^r slightly better, but must keep icons (3.6)",
        commands: &[discrimination(&[
            Figure::new("icons, for C^r", Bytes, "0/icon_bytes_per_model"),
            Figure::new("points with descriptors, for H^r", Bytes, "0/point_bytes_per_model"),
            Figure::new("stored model", Bytes, "0/bytes_per_model"),
        ])],
    },
];

const C1_OF_5: &str = "0/curves/constraints=C1&refined=false&corner_noise_px=0.5/points/views=5/median";
const C1_OF_10: &str = "0/curves/constraints=C1&refined=false&corner_noise_px=0.5/points/views=10/median";
const REFINED_OF_10: &str = "0/curves/constraints=C1&refined=true&corner_noise_px=0.5/points/views=10/median";

/// Where the medians reach 1, and up to where half and 95 % are recognised.
macro_rules! crossings {
    ($unit:expr, $better:ident) => {
        [
            Figure::$better("median H^r/tau reaches 1", $unit, "0/curves/0/crossings/0/at")
                .within("0/curves/0/crossings/0/interval")
                .until("0/curves/0/crossings/0/beyond"),
            Figure::$better("median C^r/tau reaches 1", $unit, "0/curves/0/crossings/1/at")
                .within("0/curves/0/crossings/1/interval")
                .until("0/curves/0/crossings/1/beyond"),
            Figure::$better("half recognised up to", $unit, "0/curves/0/half/at")
                .within("0/curves/0/half/interval")
                .until("0/curves/0/half/beyond"),
            Figure::$better("95 % recognised up to", $unit, "0/curves/0/most/at")
                .until("0/curves/0/most/beyond"),
            Figure::less("wrong names", Count, "0/curves/0/wrong").of("0/curves/0/views"),
        ]
    };
}

const CROSSINGS_PX: [Figure; 5] = crossings!(Px, less);
const CROSSINGS_DEG: [Figure; 5] = crossings!(Deg, more);
const CROSSINGS_HIDDEN: [Figure; 5] = crossings!(Plain, more);

const LIGHT: [Figure; 8] = [
    Figure::less("gain, darker, H^r/tau reaches 1", Plain, "0/curves/0/crossings/0/at")
        .until("0/curves/0/crossings/0/beyond"),
    Figure::less("gain, darker, 95 % recognised up to", Plain, "0/curves/0/most/at")
        .until("0/curves/0/most/beyond"),
    Figure::more("gain, brighter, H^r/tau reaches 1", Plain, "0/curves/1/crossings/0/at")
        .until("0/curves/1/crossings/0/beyond"),
    Figure::more("gain, brighter, 95 % recognised up to", Plain, "0/curves/1/most/at")
        .until("0/curves/1/most/beyond"),
    Figure::more("grey levels added, 95 % recognised up to", Plain, "0/curves/2/most/at")
        .until("0/curves/2/most/beyond"),
    Figure::more("light lost to one side, 95 % recognised up to", Share, "0/curves/3/most/at")
        .until("0/curves/3/most/beyond"),
    Figure::more("taken by a shadow, 95 % recognised up to", Share, "0/curves/4/most/at")
        .until("0/curves/4/most/beyond"),
    Figure::less("wrong names, gain", Count, "0/curves/0/wrong").of("0/curves/0/views"),
];
