//! `waymark-lab evaluate`: the paper's experiments on labelled pictures. Tables for people, one
//! JSON object for programs.

pub(crate) mod chart;
pub(crate) mod experiment;
pub(crate) mod grids;
pub(crate) mod navigation;
pub(crate) mod rendered;
pub(crate) mod reviewed;
pub(crate) mod statistics;
pub(crate) mod truth;
pub(crate) mod calibration;
pub(crate) mod detection;
pub(crate) mod drawing;
pub(crate) mod placement;
pub(crate) mod pose;
pub(crate) mod joint;
pub(crate) mod mapping;
pub(crate) mod modalities;
pub(crate) mod outside;
pub(crate) mod recognition;
pub(crate) mod roll;
pub(crate) mod survey;
pub(crate) mod visibility;

/// What to evaluate.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// Quads against labelled corners: recall at IoU 0.7 and 0.85, false quads, corner error, time.
    ///
    /// A set is a folder in the evaluation format (docs/EVALUATION.md), or `corridor` or `scenes`:
    /// rendered pictures with exact truth, for which no data is needed. Figures come with 95 %
    /// confidence intervals, for all quads and by class, stratum, size and angle of view.
    ///
    /// For example, the default detector beside the paper's grouping, with its worst pictures:
    ///   waymark-lab evaluate detection corridor --compare relaxation --plot recall.svg --worst 20 --draw worst
    #[command(verbatim_doc_comment)]
    Detection(Box<detection::Args>),
    /// Teach a server from the set's pictures; it then recognises the others over zenoh.
    ///
    /// Starts a server of its own in a temporary folder. A landmark taught from one picture is
    /// learnt from views generated from it (warped, dimmed, blurred).
    Recognition(recognition::Args),
    /// Worlds made by others, with exact truth: quads, names, poses, taught from one picture.
    ///
    /// A world is a folder in the evaluation format with the camera of every picture beside it
    /// (world.json, docs/EVALUATION.md). Its landmarks are taught with true size and place; its
    /// pictures are recognised as photographs are, without a prior. For example:
    ///   waymark-lab evaluate outside photoreal/01 photoreal/02 --draw missed
    ///   waymark-lab evaluate outside photoreal/01 --misses --peer
    ///   waymark-lab evaluate outside photoreal --strangers --json
    #[command(verbatim_doc_comment)]
    Outside(Box<outside::Args>),
    /// Recognition over the view angle: distances over their thresholds, and the decision.
    ///
    /// Landmarks are rendered posters (and photographs, with --photographs), taught as a robot
    /// would teach them. Every view has its own noise, blur, light and compression; only the angle
    /// is set. For example:
    ///   waymark-lab evaluate viewpoint --plot viewpoint.svg
    ///   waymark-lab evaluate viewpoint --photographs museum-paintings --taught photograph --detector
    #[command(verbatim_doc_comment)]
    Viewpoint(experiment::conditions::ViewpointArgs),
    /// A camera mounted at twelve rolls: names and poses with its mounting, without one, and by
    /// expectation.
    ///
    /// Frames are rendered in a corridor whose posters are taught from one level photograph each.
    Roll(roll::Args),
    /// Recognition over the apparent size, from 300 px down to 28.
    Scale(experiment::conditions::Args),
    /// Recognition over illumination: darker, brighter, light from the side, a shadow's edge.
    Illumination(experiment::conditions::Args),
    /// Recognition over the share of a landmark's area that is hidden in its middle.
    Occlusion(experiment::conditions::Args),
    /// False acceptance of distractors: by pair and the paper's thresholds, by quad and decision.
    ///
    /// Distractors are posters that are not taught, photographs, doors, windows and tiles, and, as
    /// strata of their own, look-alikes of landmarks made on purpose. Bounds are exact, by quads
    /// and by textures. For example:
    ///   waymark-lab evaluate discrimination --landmarks 50,300 --views 40 --plot distances.svg
    #[command(verbatim_doc_comment)]
    Discrimination(experiment::discrimination::Args),
    /// Pairs of pictures that are nearly the same (another text, one block changed, mirrored, two
    /// doors): distinguished, refused as ambiguous, or confused.
    Lookalikes(experiment::look_alikes::Args),
    /// Laser maps from scan logs: errors beside odometry and published figures, walls, time.
    ///
    /// For example:
    ///   waymark-lab evaluate mapping laser-carmen-corrected laser-intel-raw-odometry --draw maps --plot mapping.svg
    #[command(verbatim_doc_comment)]
    Mapping(mapping::Args),
    /// The joint map of walls, landmarks and camera in simulated buildings, and what is required of
    /// it.
    ///
    /// One drive and two, loops with and without scans, a bare corridor, no laser, wrong
    /// identities; beside them the laser map with each landmark placed alone. Needs no data. For
    /// example:
    ///   waymark-lab evaluate joint --buildings 4 --cases a,d,e
    #[command(verbatim_doc_comment)]
    Joint(joint::Args),
    /// The map that `waymark survey` makes of a simulated drive, against the truth.
    ///
    /// A robot with odometry, laser and a camera whose mounting is stated wrongly drives through a
    /// corridor and back. Beside it two steps: the laser map, then each object alone. For example:
    ///   waymark-lab evaluate survey --buildings 2 --ahead
    #[command(verbatim_doc_comment)]
    Survey(survey::Args),
    /// Occupancy grids imported: share of wall cells explained, and of walls on wall cells.
    ///
    /// For example:
    ///   waymark-lab evaluate grids maps-ros-grid --draw grids
    #[command(verbatim_doc_comment)]
    Grids(grids::Args),
    /// Calibration of confidences: reliability diagram and expected calibration error.
    Confidence(experiment::confidence::Args),
    /// Auto-calibration from views of one quad: error of the focal length by views (Fig. 17).
    ///
    /// Synthetic views with the constraints C1, C1+C2, C1+C3 and all, linear and refined; and real
    /// boards, their outermost quad against all their points and against what the set states. For
    /// example:
    ///   waymark-lab evaluate calibration calib-zhang calib-opencv-chessboard --plot calibration.svg
    #[command(verbatim_doc_comment)]
    Calibration(calibration::Args),
    /// Accuracy of landmark and robot poses, and consistency of their covariances.
    ///
    /// The table of method 13.3, NEES over twelve cells of distance, angle and noise, flips of the
    /// planar ambiguity, OpenCV on the same corners, several landmarks in one frame, simulated
    /// drives, cost.
    Pose(pose::Args),
    /// Landmarks placed on walls and ceilings from known robot poses, against the truth.
    ///
    /// Generated rooms with everything uncertain drawn anew, rendered corridors with the detector's
    /// corners, and objects that hang on no wall.
    Placement(placement::Args),
    /// Robots drive through the paper's corridor: pose errors, beside those of odometry alone.
    ///
    /// 25 m, four posters taught by a first drive, unknown start poses. Everything is rendered; no
    /// data is needed. For example:
    ///   waymark-lab evaluate navigation --plot corridor.svg
    #[command(verbatim_doc_comment)]
    Navigation(navigation::Args),
    /// The map of a drive, drawn: walls, landmarks, and doors as arcs (Fig. 6).
    ///
    /// A robot with errors drives through a rendered corridor, maps its walls by laser and places
    /// posters, windows and doors by the detector's corners. For example:
    ///   waymark-lab evaluate drawing --draw map.svg
    #[command(verbatim_doc_comment)]
    Drawing(drawing::Args),
    /// Modality statistics: learnt from reference runs, then used in every fusion mode.
    ///
    /// A path of 55 m through a corridor (the laser does not constrain x), a hall (the floor
    /// disturbs odometry, no posters) and a workshop (its walls were moved after they were mapped).
    /// For example:
    ///   waymark-lab evaluate modalities --plot modalities.svg
    #[command(verbatim_doc_comment)]
    Modalities(modalities::Args),
    /// Visibility areas in closed form against brute force on random maps, their sizes against
    /// counting, and the time of areas and of gaze selection.
    Visibility(visibility::Args),
}

/// Runs one evaluation.
pub(crate) fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Detection(args) => detection::run(args),
        Command::Recognition(args) => recognition::run(args),
        Command::Outside(args) => outside::run(args),
        Command::Viewpoint(args) => experiment::conditions::viewpoint(args),
        Command::Roll(args) => roll::run(args),
        Command::Scale(args) => experiment::conditions::scale(args),
        Command::Illumination(args) => experiment::conditions::illumination(args),
        Command::Occlusion(args) => experiment::conditions::occlusion(args),
        Command::Discrimination(args) => experiment::discrimination::run(args),
        Command::Lookalikes(args) => experiment::look_alikes::run(args),
        Command::Confidence(args) => experiment::confidence::run(args),
        Command::Calibration(args) => calibration::run(args),
        Command::Pose(args) => pose::run(args),
        Command::Placement(args) => placement::run(args),
        Command::Navigation(args) => navigation::run(args),
        Command::Mapping(args) => mapping::run(args),
        Command::Joint(args) => joint::run(args),
        Command::Survey(args) => survey::run(args),
        Command::Grids(args) => grids::run(args),
        Command::Drawing(args) => drawing::run(args),
        Command::Modalities(args) => modalities::run(args),
        Command::Visibility(args) => visibility::run(args),
    }
}
