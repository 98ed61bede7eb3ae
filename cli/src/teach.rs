//! Commands against a running server: `map`, `robot`, `learn`, `recognise`.

use super::{
    answers::{robot_line, sentence},
    arg_parsers::{camera, distance, numbers, size},
    mapping, screen,
    visibility_settings::{self, VisibilityArgs},
};
use client::{
    ClientError, LandmarkRegion, MapClient,
    api::{Distance, Job, MapPatch, NewMap, Parent, Size, UploadOutcomeBody},
};
use std::{path::PathBuf, process::ExitCode, time::Duration};
use vision::{frame::Intrinsics, recognise::DistanceKind};

/// Longest wait for a lesson.
pub(super) const LESSON_TIMEOUT: Duration = Duration::from_hours(2);

/// Which server.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct ServerArgs {
    /// Address of the server's HTTP interface.
    #[arg(long, env = "WAYMARK_SERVER", default_value = "http://127.0.0.1:8080")]
    server: String,
    /// Print the server's answer as JSON.
    #[arg(long)]
    json: bool,
}

impl ServerArgs {
    /// Its address.
    pub(super) fn address(&self) -> &str {
        &self.server
    }
}

/// `waymark map`.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum MapCommand {
    /// Make a map.
    Create {
        /// Lower-case letters, digits, `_` and `-`, up to 64.
        name: String,
        /// The distance that decides in this map.
        #[arg(long, value_parser = distance)]
        distance: Option<DistanceKind>,
        #[command(flatten)]
        location: LocationArgs,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Set where a map belongs, and its link to another map.
    ///
    /// For example, the first floor of a house whose plan is the map `house`, 3.4 m up, turned by 90 degrees:
    ///   waymark map place floor1 --building house --floor 1st --in house --at 12.5,-3,90 --level-m 3.4
    #[command(verbatim_doc_comment)]
    Place {
        /// The map.
        name: String,
        #[command(flatten)]
        location: LocationArgs,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Show or set the visibility settings of a map: the camera and the limits that define "visible".
    ///
    /// The visibility areas of landmarks follow from them. For example, a camera 0.8 m up that tilts up to 60 degrees:
    ///   waymark map sight office --image 1280x720 --focal-px 900 --camera-height-m 0.8 --tilt-deg -10,60
    #[command(verbatim_doc_comment)]
    Sight {
        /// The map.
        name: String,
        #[command(flatten)]
        sight: VisibilityArgs,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// List the maps.
    List {
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Build a map of walls from a laser recording: scans are matched, loops closed, walls drawn. No server needed.
    ///
    /// The first pose is the origin of the map. Standard output says how many loops were closed and refused: a picture
    /// (--draw) shows where. Poses in a CARMEN log are taken for odometry; in a corrected log they are nearly right
    /// already.
    ///
    /// For example:
    ///   waymark map build hall.log.gz --out hall.json --draw hall.svg
    ///   waymark map build hall.jsonl --server $SERVER --map hall
    ///
    /// A Waymark recording is JSON lines: a head, then one scan a line (`null`: no return; `t_s` and `truth` if known).
    ///   `{"waymark_recording":1,"robot_from_laser":[0.2,0,0],"first_bearing_rad":-1.57,"bearing_step_rad":0.0087,"max_range_m":30}`
    ///   `{"t_s":12.5,"odom":[1.0,0.2,0.05],"ranges_m":[1.93,null,2.01]}`
    #[command(verbatim_doc_comment)]
    Build(mapping::build::Args),
    /// Walls from a ROS occupancy grid, a vector map or a map file, to a file or to a running server.
    ///
    /// The border between free and occupied cells becomes straight segments, the free side on their left. For example:
    ///   waymark map import floor.yaml --out floor.json --draw floor.svg
    ///   waymark map import floor.vectormap.txt --server $SERVER --map floor
    ///   waymark map import plan.geojson --server $SERVER --map floor
    #[command(verbatim_doc_comment)]
    Import(mapping::import::ImportArgs),
    /// Walls as a ROS occupancy grid, a vector map or a map file.
    Export(mapping::import::ExportArgs),
}

/// Location of a map.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct LocationArgs {
    /// The site it belongs to.
    #[arg(long)]
    site: Option<String>,
    /// The building.
    #[arg(long)]
    building: Option<String>,
    /// The floor.
    #[arg(long)]
    floor: Option<String>,
    /// The map in whose frame it lies.
    #[arg(long = "in", value_name = "MAP", requires = "at")]
    parent: Option<String>,
    /// Its origin and x axis there: x,y in metres, direction in degrees.
    #[arg(long, value_name = "X,Y,DEG", value_parser = origin, requires = "parent", allow_hyphen_values = true)]
    at: Option<[f64; 3]>,
    /// Its floor above that one's, metres.
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true)]
    level_m: f64,
}

impl LocationArgs {
    /// The map link, if it is given.
    fn link(&self) -> Option<Parent> {
        let (map, [x_m, y_m, degrees]) = self.parent.as_ref().zip(self.at)?;
        let theta_rad = degrees.to_radians();
        Some(Parent { map: map.clone(), x_m, y_m, theta_rad, level_m: self.level_m, covariance: None })
    }

    /// A map with what is given.
    fn new_map(&self, name: &str, distance: Option<DistanceKind>) -> NewMap {
        NewMap {
            name: name.to_owned(),
            distance: distance.map(Distance::from).unwrap_or_default(),
            site: self.site.clone(),
            building: self.building.clone(),
            floor: self.floor.clone(),
            parent: self.link(),
        }
    }

    /// A change to what is given; the rest stays.
    fn patch(&self) -> MapPatch {
        MapPatch {
            site: self.site.clone().map(Some),
            building: self.building.clone().map(Some),
            floor: self.floor.clone().map(Some),
            parent: self.link().map(Some),
        }
    }
}

fn origin(text: &str) -> Result<[f64; 3], String> {
    numbers(text, ',').ok_or_else(|| "three numbers: x,y in metres, direction in degrees".to_owned())
}

/// `waymark robot`.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum RobotCommand {
    /// Make a robot known, or give it another map. Frames of unknown robots are rejected.
    Add {
        /// Lower-case letters, digits, `_` and `-`, up to 64.
        name: String,
        /// The map it drives in.
        #[arg(long)]
        map: String,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// List the robots: the map of each, and, where its pose is known, where it is and how far that is trusted.
    List {
        #[command(flatten)]
        server: ServerArgs,
    },
}

/// `waymark learn`.
#[derive(Debug, clap::Args)]
pub(crate) struct LearnArgs {
    /// The map.
    #[arg(long)]
    map: String,
    /// The landmark; made if it does not exist.
    #[arg(long)]
    landmark: String,
    /// Its width and height in metres, such as 0.60x0.84; without it there is recognition but no pose.
    #[arg(long, value_parser = size)]
    size: Option<Size>,
    /// The whole picture is the landmark (a scan, a cut-out). Without it the server looks for the one dominant quad.
    #[arg(long)]
    whole_image: bool,
    /// Warped, dimmed and blurred views made of each photograph; left out, the server chooses by the number of
    /// photographs. A landmark learnt from generated views is recognised less surely than one seen from many sides.
    #[arg(long)]
    generated_views: Option<u32>,
    /// Photographs of the landmark, PNG or JPEG.
    #[arg(required = true)]
    images: Vec<PathBuf>,
    #[command(flatten)]
    server: ServerArgs,
}

/// `waymark recognise`.
#[derive(Debug, clap::Args)]
pub(crate) struct RecogniseArgs {
    /// The map.
    #[arg(long)]
    map: String,
    /// Camera for poses: fx,fy,cx,cy in pixels; and its standard deviations, where known: of the focal length, of the
    /// principal point.
    #[arg(long, value_parser = camera)]
    camera: Option<Intrinsics>,
    /// Photographs, PNG or JPEG.
    #[arg(required = true)]
    images: Vec<PathBuf>,
    #[command(flatten)]
    server: ServerArgs,
}

pub(crate) async fn map(command: &MapCommand) -> anyhow::Result<()> {
    match command {
        MapCommand::Create { name, distance, location, server } => {
            let maps = MapClient::new(&server.server)?;
            let map = maps.create_map(&location.new_map(name, *distance)).await?;
            show(server, &map, &format!("map {} created", map.name))
        }
        MapCommand::Place { name, location, server } => {
            let map = MapClient::new(&server.server)?.locate_map(name, &location.patch()).await?;
            show(server, &map, &format!("{}  {}", map.name, map.whereabouts()))
        }
        MapCommand::Sight { name, sight, server } => {
            let settings = sight.set(&MapClient::new(&server.server)?, name).await?;
            show(server, &settings, &visibility_settings::sentences(name, &settings))
        }
        MapCommand::List { server } => {
            let maps = MapClient::new(&server.server)?.maps().await?;
            let lines: Vec<String> = maps
                .iter()
                .map(|m| {
                    let location = m.whereabouts();
                    let separator = if location.is_empty() { "" } else { ", " };
                    let landmarks = counted(m.landmarks, "landmark");
                    format!("{}  version {}, {landmarks}{separator}{location}", m.name, m.version)
                })
                .collect();
            show(server, &maps, &lines.join("\n"))
        }
        MapCommand::Build(args) => mapping::build::run(args).await,
        MapCommand::Import(args) => mapping::import::import(args).await,
        MapCommand::Export(args) => mapping::import::export(args).await,
    }
}

pub(crate) async fn robot(command: &RobotCommand) -> anyhow::Result<()> {
    match command {
        RobotCommand::Add { name, map, server } => {
            let robot = MapClient::new(&server.server)?.put_robot(name, map).await?;
            show(server, &robot, &format!("robot {name} drives in {map}"))
        }
        RobotCommand::List { server } => {
            let robots = MapClient::new(&server.server)?.robots().await?;
            let lines: Vec<String> = robots.iter().map(robot_line).collect();
            show(server, &robots, &lines.join("\n"))
        }
    }
}

pub(super) fn show(
    server: &ServerArgs,
    value: &(impl serde::Serialize + ?Sized),
    text: &str,
) -> anyhow::Result<()> {
    if server.json {
        screen::say(&serde_json::to_string(value)?);
    } else if !text.is_empty() {
        screen::say(text);
    }
    Ok(())
}

pub(crate) async fn learn(args: &LearnArgs) -> anyhow::Result<ExitCode> {
    let maps = MapClient::new(&args.server.server)?;
    let (map, landmark) = (&args.map, &args.landmark);
    match maps.landmark(map, landmark).await {
        Ok(_) => {}
        Err(ClientError::Refused { status: 404, .. }) => {
            maps.add_landmark(map, landmark, args.size, None).await?;
        }
        Err(error) => return Err(error.into()),
    }
    let extent = if args.whole_image { LandmarkRegion::WholeImage } else { LandmarkRegion::Detect };
    let mut status = ExitCode::SUCCESS;
    let progress = screen::progress(args.images.len(), "uploading");
    for path in &args.images {
        let name = path.display();
        let uploaded = match std::fs::read(path) {
            Ok(image) => match maps.upload_view(map, landmark, image, extent).await {
                Ok(view) => {
                    if view.outcome == Some(UploadOutcomeBody::NearDuplicate) {
                        let like = format!(
                            "waymark: {name}: not kept, it shows nothing that view {} does not",
                            view.id
                        );
                        screen::complain(&like);
                    }
                    Ok(())
                }
                Err(error) => Err(error.to_string()),
            },
            Err(error) => Err(error.to_string()),
        };
        if let Err(error) = uploaded {
            screen::complain(&format!("waymark: {name}: {error}"));
            status = ExitCode::FAILURE;
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    let job = maps.learn(map, Some(std::slice::from_ref(landmark)), args.generated_views).await?;
    let bar = screen::progress(1000, "learning");
    maps.wait_for_job(job, LESSON_TIMEOUT, |job: &Job| bar.set_position((job.progress * 1000.0) as u64))
        .await?;
    bar.finish_and_clear();
    let learnt = maps.landmark(map, landmark).await?;
    let lines: Vec<String> = std::iter::once(format!(
        "{landmark}: {}, {} photographed",
        learnt.status,
        counted(learnt.views, "view")
    ))
    .chain(learnt.failed_gates.iter().map(|r| format!("  {}", reason(r))))
    .collect();
    show(&args.server, &learnt, &lines.join("\n"))?;
    Ok(status)
}

pub(super) fn counted(count: u64, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

fn reason(value: &serde_json::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), ToOwned::to_owned)
}

pub(crate) async fn recognise(args: &RecogniseArgs) -> anyhow::Result<ExitCode> {
    let maps = MapClient::new(&args.server.server)?;
    let mut status = ExitCode::SUCCESS;
    for path in &args.images {
        let name = path.display();
        let image = match std::fs::read(path) {
            Ok(image) => image,
            Err(error) => {
                screen::complain(&format!("waymark: {name}: {error}"));
                status = ExitCode::FAILURE;
                continue;
            }
        };
        match maps.recognise(&args.map, image, args.camera.as_ref()).await {
            Ok(answer) => show(&args.server, &answer, &sentence(&name.to_string(), &answer))?,
            Err(error) => {
                screen::complain(&format!("waymark: {name}: {error}"));
                status = ExitCode::FAILURE;
            }
        }
    }
    Ok(status)
}
