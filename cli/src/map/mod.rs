//! `waymark map`: maps of a server, and their walls from laser logs, grids and plans.

pub mod build;
mod bundle;
mod convert;
mod difference;
mod export;
mod fusion;
mod import;
mod learning;
mod location;
mod underlay;
mod visibility;
mod walls;

use super::{
    arg_parsers::distance,
    names::name,
    screen::{Table, counted},
    session::{Consent, ServerArgs, Session},
};
use client::api::{LandmarkStatus, Map, MapPatch, NewMap};
use formats::scan_log::LaserDefaults;
use vision::{params::preset::Preset, recognise::DistanceKind};

/// `waymark map`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// Make a map.
    Create {
        /// Lower-case letters, digits, `_` and `-`, up to 64.
        #[arg(value_name = "MAP", value_parser = name)]
        map: String,
        /// Its detector and decision, `default` or `paper`; otherwise those of the server's
        /// settings.
        #[arg(long, value_name = "NAME")]
        preset: Option<Preset>,
        /// The distance that decides in this map; otherwise that of the preset.
        #[arg(long, value_parser = distance)]
        distance: Option<DistanceKind>,
        #[command(flatten)]
        location: location::LocationArgs,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Set the detector and decision of a map
    ///
    /// Answers follow from the next version on; undo it in the history. For example, the paper's
    /// pipeline with C^r deciding, and back to the server's settings:
    ///   waymark map pipeline office --preset paper --distance correlation
    ///   waymark map pipeline office --preset server
    #[command(verbatim_doc_comment)]
    Pipeline {
        /// The map.
        map: String,
        /// `default`, `paper`, or `server`: as the server's settings say.
        #[arg(long, value_name = "NAME", value_parser = map_preset, required_unless_present = "distance")]
        preset: Option<MapPreset>,
        /// The distance that decides; otherwise that of the preset.
        #[arg(long, value_parser = distance)]
        distance: Option<DistanceKind>,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// List the maps.
    List {
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Show a map: version, landmarks by state, walls, where it lies.
    Show {
        /// The map.
        map: String,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Set where a map belongs, and its link to another map
    ///
    /// For example, the first floor of a house whose plan is the map `house`, 3.4 m up, turned by
    /// 90 degrees:
    ///   waymark map locate floor1 --building house --floor 1st --in house --at 12.5,-3,90 --level-m 3.4
    #[command(verbatim_doc_comment)]
    Locate {
        /// The map.
        map: String,
        #[command(flatten)]
        location: location::LocationArgs,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Show or set the visibility settings of a map: camera and limits that define "visible"
    ///
    /// The visibility areas of landmarks follow from them. For example, a camera 0.8 m up that
    /// tilts up to 60 degrees:
    ///   waymark map visibility office --image 1280x720 --focal-px 900 --camera-height-m 0.8 --tilt-deg -10,60
    #[command(verbatim_doc_comment)]
    Visibility {
        /// The map.
        map: String,
        #[command(flatten)]
        visibility: visibility::VisibilityArgs,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Show or set the fusion mode of a map: what is fused where reference runs know the best
    /// modality.
    Fusion(fusion::FusionArgs),
    /// Show or set weights and gates of a map, where others than the server's are wanted
    ///
    /// What a landmark sets of its own goes before. For example, few wrong names before many right
    /// ones, in a house of equal doors:
    ///   waymark map learning office --weights 20:1 --why "doors look alike here"
    #[command(verbatim_doc_comment)]
    Learning(learning::Args),
    /// Give a map another name; no robot may be on it.
    Rename {
        /// The map.
        map: String,
        /// Its new name: lower-case letters, digits, `-` and `_`.
        #[arg(value_parser = name)]
        new_name: String,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Copy a map: landmarks with views and models, walls, floor plan, runs, settings
    ///
    /// Robots stay on the first one. For example:
    ///   waymark map duplicate office office-trial
    #[command(verbatim_doc_comment)]
    Duplicate {
        /// The map.
        map: String,
        /// Name of the new one: lower-case letters, digits, `-` and `_`.
        #[arg(value_parser = name)]
        new_name: String,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Save a map to a file: landmarks, photographs, models, walls, floor plan, runs, settings
    ///
    /// The file is a zip that other programs read without Waymark. For example:
    ///   waymark map save office office.zip
    #[command(verbatim_doc_comment)]
    Save(bundle::SaveArgs),
    /// Make a new map of a file of `waymark map save`, on this or another server
    ///
    /// A file of which one byte has changed is refused. For example:
    ///   waymark map load office.zip --name office-2
    #[command(verbatim_doc_comment)]
    Load(bundle::LoadArgs),
    /// Delete a map with its landmarks, walls and runs. This cannot be undone.
    Delete {
        /// The map.
        map: String,
        #[command(flatten)]
        consent: Consent,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Set a map's walls from a ROS occupancy grid, a floor plan, a vector map or a map file
    ///
    /// If the map has walls, the difference is shown first and you are asked. The picture of a grid
    /// becomes the map's underlay. For example:
    ///   waymark map import office floor.yaml --dry-run
    ///   waymark map import office plan.geojson --yes
    #[command(verbatim_doc_comment)]
    Import(import::ImportArgs),
    /// List a map's walls with their numbers, for `waymark landmark place --wall`
    ///
    /// For example:
    ///   waymark map walls office --draw walls.svg
    #[command(verbatim_doc_comment)]
    Walls(walls::WallsArgs),
    /// Write a map's walls as a ROS occupancy grid, a vector map or a map file.
    Export(export::ExportArgs),
    /// Turn a file of walls into another kind of file; no server needed
    ///
    /// For example:
    ///   waymark map convert floor.yaml --out floor.json --draw floor.svg
    #[command(verbatim_doc_comment)]
    Convert(convert::ConvertArgs),
    /// Build walls from a laser log: scans matched, loops closed; a server only with --into
    ///
    /// The first pose is the origin of the map. Standard output says how many loops were closed and
    /// refused: a picture (--draw) shows where. Poses in a CARMEN log are taken for odometry; in a
    /// corrected log they are nearly right already.
    ///
    /// For example:
    ///   waymark map build hall.log.gz --out hall.json --draw hall.svg
    ///   waymark map build hall.jsonl --into hall
    ///
    /// A Waymark scan log is JSON lines: a head, then one scan a line (`null`: no return; `t_s` and
    /// `truth` if known).
    ///   `{"waymark_recording":1,"robot_from_laser":[0.2,0,0],"first_bearing_rad":-1.57,"bearing_step_rad":0.0087,"max_range_m":30}`
    ///   `{"t_s":12.5,"odom":[1.0,0.2,0.05],"ranges_m":[1.93,null,2.01]}`
    #[command(verbatim_doc_comment)]
    Build(build::Args),
}

/// What is known of the laser where a log does not say it.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct LaserArgs {
    /// Ranges from here on are "no return", metres.
    #[arg(long, default_value_t = LaserDefaults::default().max_range_m)]
    max_range_m: f64,
    /// Angle of the fan, degrees, where the log gives none (CARMEN FLASER, numbered scans).
    #[arg(long, default_value_t = LaserDefaults::default().field_deg)]
    field_deg: f64,
}

impl LaserArgs {
    /// The values for reading logs.
    pub fn defaults(&self) -> LaserDefaults {
        LaserDefaults { max_range_m: self.max_range_m, field_deg: self.field_deg }
    }
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    match &args.verb {
        Verb::Convert(args) => convert::run(args),
        Verb::Build(args) => build::run(args).await,
        Verb::Import(args) => import::run(args).await,
        Verb::Export(args) => export::run(args).await,
        Verb::Learning(args) => learning::run(args).await,
        Verb::Fusion(args) => fusion::run(args).await,
        Verb::Save(args) => bundle::save(args).await,
        Verb::Load(args) => bundle::load(args).await,
        Verb::Walls(args) => walls::run(args).await,
        Verb::Create { server, .. }
        | Verb::List { server }
        | Verb::Show { server, .. }
        | Verb::Pipeline { server, .. }
        | Verb::Locate { server, .. }
        | Verb::Visibility { server, .. }
        | Verb::Rename { server, .. }
        | Verb::Duplicate { server, .. }
        | Verb::Delete { server, .. } => {
            let session = server.session()?;
            session.explained(on_server(&session, &args.verb).await).await
        }
    }
}

/// A preset of a map; `None`: as the server's settings say.
#[derive(Debug, Clone, Copy)]
struct MapPreset(Option<Preset>);

fn map_preset(word: &str) -> Result<MapPreset, String> {
    if word == "server" {
        return Ok(MapPreset(None));
    }
    word.parse().map(|preset| MapPreset(Some(preset))).map_err(|why: String| format!("{why}, server"))
}

/// Detector and decision, in words.
fn pipeline(map: &Map) -> String {
    let preset = map.preset.map_or("of the server's settings", |preset| Preset::from(preset).word());
    format!("{preset}, distance {}", format!("{:?}", map.distance).to_lowercase())
}

async fn on_server(session: &Session, verb: &Verb) -> anyhow::Result<()> {
    let maps = session.maps();
    match verb {
        Verb::Create { map, preset, distance, location, .. } => {
            let (preset, distance) = (preset.map(Into::into), distance.map(Into::into));
            let new = NewMap { preset, distance, ..location.new_map(map) };
            let made = maps.create_map(&new).await?;
            session.show(&made, &format!("map {map} created"))?;
            session.note(&format!(
                "  Teach it a landmark: waymark landmark teach NAME PHOTO... --size 0.60x0.84 --map {map}"
            ));
            Ok(())
        }
        Verb::Pipeline { map, preset, distance, .. } => {
            let preset = preset.map(|MapPreset(preset)| preset.map(Into::into));
            let distance = distance.map(Into::into);
            let map = maps.locate_map(map, &MapPatch { preset, distance, ..MapPatch::default() }).await?;
            session.show(&map, &format!("{}: {}", map.name, pipeline(&map)))
        }
        Verb::Locate { map, location, .. } => {
            let map = maps.locate_map(map, &location.patch()).await?;
            session.show(&map, &format!("{}: {}", map.name, map.whereabouts()))
        }
        Verb::Visibility { map, visibility, .. } => {
            let settings = visibility.set(maps, map).await?;
            session.show(&settings, &visibility::sentences(map, &settings))
        }
        Verb::Rename { map, new_name, .. } => {
            let renamed = maps.rename_map(map, new_name).await?;
            session.show(&renamed, &format!("map {map} is {new_name} now"))
        }
        Verb::Duplicate { map, new_name, .. } => {
            let made = maps.copy_map(map, new_name).await?;
            let landmarks = counted(made.landmarks, "landmark");
            session.show(&made, &format!("map {new_name} is a copy of {map}, with {landmarks}"))
        }
        Verb::Delete { map, consent, .. } => {
            let found = maps.map(map).await?;
            let landmarks = counted(found.landmarks, "landmark");
            consent.ask(&format!("Delete the map {map} with {landmarks}? This cannot be undone."))?;
            maps.if_match(&found.revision).delete_map(map).await?;
            session.show(&serde_json::json!({ "deleted": map }), &format!("map {map} deleted"))
        }
        Verb::Show { map, .. } => show(session, map).await,
        _ => list(session).await,
    }
}

async fn list(session: &Session) -> anyhow::Result<()> {
    let all = session.maps().maps().await?;
    let table = |all: &[Map]| {
        Table::of(["map", "version", "landmarks", "where"], all, |m| {
            [m.name.clone(), m.version.to_string(), m.landmarks.to_string(), m.whereabouts()]
        })
    };
    session.list(&all, table, "There is no map yet. Make one: waymark map create NAME")
}

async fn show(session: &Session, name: &str) -> anyhow::Result<()> {
    let maps = session.maps();
    let map = maps.map(name).await?;
    let walls = maps.walls(name).await?;
    let landmarks = maps.landmarks(name).await?;
    let length_m: f64 = walls
        .segments
        .iter()
        .map(|w| (w.b[0] - w.a[0]).hypot(w.b[1] - w.a[1]))
        .fold(0.0, |sum, each| sum + each);
    let active = landmarks.iter().filter(|l| l.status == LandmarkStatus::Active);
    let placed = active.clone().filter(|l| l.place.is_some() && l.size.is_some()).count();
    let active = active.count();
    if session.is_json() {
        let walls = serde_json::json!({ "segments": walls.segments.len(), "length_m": length_m });
        let counts =
            serde_json::json!({ "all": landmarks.len(), "active": active, "active_and_placed": placed });
        return session.show(&serde_json::json!({ "map": map, "walls": walls, "landmarks": counts }), "");
    }
    let place = map.whereabouts();
    let text = [
        format!(
            "map {name}, version {}{}",
            map.version,
            if place.is_empty() { place } else { format!(", {place}") }
        ),
        format!("  landmarks  {}, {active} active, {placed} of these with size and place", landmarks.len()),
        format!("  walls      {}, {length_m:.1} m", counted(walls.segments.len() as u64, "segment")),
        format!("  pipeline   {}", pipeline(&map)),
        format!("  learning   {}", learning::text(&map)),
    ];
    session.show(&map, &text.join("\n"))?;
    if active > placed {
        session.note("  A landmark gives poses once it has size and place: waymark landmark place --help");
    }
    Ok(())
}
