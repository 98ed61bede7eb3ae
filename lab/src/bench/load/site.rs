//! What the server of the load knows: a corridor whose posters are landmarks, robots with
//! certificates, and a second map whose posters are learnt again and again.

use super::{plan::PlannedRobot, process::ServerChild};
use anyhow::Context as _;
use cli::{pictures, screen};
use client::{
    LandmarkRegion, MapClient,
    api::{CertificateRequest, NewMap, Place, Size, WallsBody},
};
use rcgen::{CertificateParams, KeyPair};
use sim::{
    building::Building,
    drive::DriveParams,
    lesson::{LessonParams, stops},
    posters::poster_of_size,
    robot::{Robot, RobotParams},
    truth::ViewState,
};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};
use tokio::task::{JoinHandle, JoinSet};
use vision::frame::GrayImage;

const MAP: &str = "corridor";
/// The map of the lesson.
const MUSEUM: &str = "museum";
/// Photographs of each landmark of the corridor.
const VIEWS: usize = 3;
/// Width of a poster of the museum, px.
const POSTER_PX: usize = 240;
/// Robots that get their certificates at a time: the server gathers changes so close together into
/// one reopening of its encrypted listener.
const ENROLLING: usize = 32;
/// Longest lesson.
const LESSON: Duration = Duration::from_hours(1);

/// The drive of the robots.
pub(super) fn drive(seed: u64, rate_hz: f64) -> RobotParams {
    let drive = DriveParams { seed, rate_hz, ..DriveParams::default() };
    RobotParams { drive, ..RobotParams::default() }
}

/// The server and its maps.
pub(super) struct Site<'a> {
    server: &'a ServerChild,
    folder: &'a Path,
    building: Arc<Building>,
    seed: u64,
    disturbed: AtomicU64,
}

impl<'a> Site<'a> {
    pub(super) fn new(server: &'a ServerChild, folder: &'a Path, seed: u64) -> Self {
        let building = Arc::new(Building::corridor(seed));
        Self { server, folder, building, seed, disturbed: AtomicU64::new(0) }
    }

    fn maps(&self) -> anyhow::Result<MapClient> {
        Ok(MapClient::new(&self.server.url)?)
    }

    /// The map of the corridor: walls, and every poster at its place from photographs.
    pub(super) async fn teach(&self) -> anyhow::Result<()> {
        let maps = self.maps()?;
        maps.create_map(&NewMap::new(MAP)).await?;
        let walls: WallsBody =
            self.building.walls().iter().map(|w| [[w.a_m.x, w.a_m.y], [w.b_m.x, w.b_m.y]]).collect();
        maps.set_walls(MAP, &walls).await?;
        for poster in self.building.posters() {
            let centre = poster.map_from_landmark.translation.vector;
            let outward = poster.map_from_landmark.rotation * nalgebra::Vector3::x();
            let theta_rad = outward.y.atan2(outward.x);
            let place = Place { x_m: centre.x, y_m: centre.y, z_m: centre.z, theta_rad, ..Place::default() };
            let size = Size { width_m: poster.width_m, height_m: poster.height_m };
            maps.add_landmark(MAP, &poster.name, Some(size), Some(place)).await?;
        }
        let stops =
            stops(&self.building, &LessonParams { seed: self.seed, views: VIEWS, ..LessonParams::default() });
        let mut robot = Robot::new(self.building.clone(), &drive(self.seed, 1.0));
        for stop in stops {
            let readings = robot.look(&stop.step);
            let seen = readings.frame.truth.landmark(&stop.landmark).filter(|v| v.state == ViewState::Full);
            if let Some(seen) = seen {
                let region = LandmarkRegion::Corners(seen.corners_px.into());
                maps.upload_view(MAP, &stop.landmark, pictures::jpeg(&readings.frame.image)?, region).await?;
            }
        }
        let job = maps.learn(MAP, None, None).await?;
        maps.wait_for_job(job, LESSON, |_| ()).await?;
        Ok(())
    }

    /// Renders the frames of the drive to files; their folder.
    pub(super) fn render(&self, count: usize, rate_hz: f64) -> anyhow::Result<PathBuf> {
        let folder = self.folder.join("frames");
        std::fs::create_dir(&folder)?;
        let bar = screen::progress(count, "frames");
        let robot = Robot::new(self.building.clone(), &drive(self.seed, rate_hz));
        for (i, readings) in robot.take(count).enumerate() {
            std::fs::write(folder.join(format!("{i}.jpg")), pictures::jpeg(&readings.frame.image)?)?;
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(folder)
    }

    /// Robots on the map, each with a certificate.
    pub(super) async fn enrol(&self, count: usize) -> anyhow::Result<Vec<PlannedRobot>> {
        let folder = self.folder.join("robots");
        std::fs::create_dir(&folder)?;
        let bar = screen::progress(count, "robots");
        let mut robots = Vec::new();
        for first in (0..count).step_by(ENROLLING) {
            let mut enrolling = JoinSet::new();
            for i in first..count.min(first + ENROLLING) {
                enrolling.spawn(enrol_one(self.maps()?, folder.clone(), i));
            }
            robots.extend(enrolling.join_all().await);
            bar.set_position(robots.len() as u64);
        }
        bar.finish_and_clear();
        let mut robots = robots.into_iter().collect::<anyhow::Result<Vec<_>>>()?;
        robots.sort_by_key(|(i, _)| *i);
        Ok(robots.into_iter().map(|(_, robot)| robot).collect())
    }

    /// A change of the map while robots are answered, and a question that is refused.
    pub(super) async fn disturb(&self) -> anyhow::Result<()> {
        let (maps, number) = (self.maps()?, self.disturbed.fetch_add(1, Ordering::Relaxed));
        let name = format!("disturbed-{}", number % 8);
        if number >= 8 {
            maps.delete_landmark(MAP, &name).await?;
        }
        maps.add_landmark(MAP, &name, Some(Size { width_m: 1.0, height_m: 1.0 }), None).await?;
        anyhow::ensure!(maps.map("no-such-map").await.is_err(), "a map that does not exist was found");
        Ok(())
    }

    /// The server's counters of frames.
    pub(super) async fn counters(&self) -> anyhow::Result<Counters> {
        let maps = self.maps()?;
        let token = maps.token_in_use().await?.context("the server asks for no token")?;
        let client = reqwest_client()?;
        let answer = client.get(format!("{}/metrics", self.server.url)).bearer_auth(token).send().await?;
        let text = answer.error_for_status()?.text().await?;
        let value = |name: &str| {
            let line = text.lines().find_map(|line| line.strip_prefix(name));
            line.and_then(|rest| rest.trim().parse::<f64>().ok()).map(|value| value as u64)
        };
        let ended = |outcome: &str| value(&format!("waymark_frames_total{{outcome=\"{outcome}\"}}"));
        let known = || -> Option<Counters> {
            Some(Counters {
                received: value("waymark_frames_received_total ")?,
                processed: ended("processed")?,
                superseded: ended("superseded")?,
                expired: ended("expired")?,
                rejected: ended("rejected")?,
                open: value("waymark_frames_waiting ")? + value("waymark_frames_in_work ")?,
            })
        };
        known().context("the server's counters of frames are not in its metrics")
    }
}

/// Robot number `i`, with a certificate in `folder`.
async fn enrol_one(maps: MapClient, folder: PathBuf, i: usize) -> anyhow::Result<(usize, PlannedRobot)> {
    let name = format!("r{i}");
    maps.put_robot(&name, MAP).await?;
    let pair = KeyPair::generate()?;
    let request = CertificateParams::default().serialize_request(&pair)?.pem()?;
    let enrolled = maps.enrol_robot(&name, &CertificateRequest { request, valid_s: None }).await?;
    let (certificate, key) = (folder.join(format!("{name}.pem")), folder.join(format!("{name}.key")));
    std::fs::write(&certificate, &enrolled.certificate_pem)?;
    std::fs::write(&key, pair.serialize_pem())?;
    Ok((i, PlannedRobot { name, fleet: enrolled.fleet, certificate, key }))
}

/// A client of plain HTTP on this machine.
fn reqwest_client() -> anyhow::Result<reqwest::Client> {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let tls = rustls::ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions()?;
    let tls = tls.with_root_certificates(rustls::RootCertStore::empty()).with_no_client_auth();
    Ok(reqwest::Client::builder().no_proxy().tls_backend_preconfigured(tls).build()?)
}

/// Frames by how they ended, as the server counts them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Counters {
    pub(super) received: u64,
    pub(super) processed: u64,
    pub(super) superseded: u64,
    pub(super) expired: u64,
    pub(super) rejected: u64,
    /// Waiting or in work.
    pub(super) open: u64,
}

impl Counters {
    pub(super) fn since(&self, before: &Self) -> Self {
        Self {
            received: self.received - before.received,
            processed: self.processed - before.processed,
            superseded: self.superseded - before.superseded,
            expired: self.expired - before.expired,
            rejected: self.rejected - before.rejected,
            open: self.open,
        }
    }

    /// Received less all that they ended in: 0, or frames were lost.
    pub(super) fn missing(&self) -> i128 {
        let ended = self.processed + self.superseded + self.expired + self.rejected + self.open;
        i128::from(self.received) - i128::from(ended)
    }
}

/// Lessons that follow each other for as long as the load lasts.
pub(super) struct Lessons {
    task: Option<JoinHandle<anyhow::Result<()>>>,
    ended: Arc<AtomicU64>,
    began: Instant,
}

/// How many lessons ended, in which time.
pub(super) struct Taught {
    pub(super) lessons: u64,
    pub(super) seconds: f64,
    /// One was running at the end.
    pub(super) was_running: bool,
}

impl Lessons {
    /// Makes the map of the lesson and begins the first one.
    pub(super) async fn begin(site: &Site<'_>, landmarks: usize) -> anyhow::Result<Self> {
        let (ended, began) = (Arc::<AtomicU64>::default(), Instant::now());
        if landmarks == 0 {
            return Ok(Self { task: None, ended, began });
        }
        let maps = site.maps()?;
        maps.create_map(&NewMap::new(MUSEUM)).await?;
        let bar = screen::progress(landmarks, "landmarks of the lesson");
        for i in 0..landmarks {
            let name = format!("l{i}");
            let texture = poster_of_size(50_000 + i as u64, POSTER_PX, 1.4);
            let poster = GrayImage::from_fn(texture.width(), texture.height(), |u, v| {
                texture.data()[v * texture.width() + u]
            });
            maps.add_landmark(MUSEUM, &name, Some(Size { width_m: 0.6, height_m: 0.84 }), None).await?;
            let jpeg = pictures::jpeg(&poster)?;
            maps.upload_view(MUSEUM, &name, jpeg, LandmarkRegion::WholeImage).await?;
            bar.inc(1);
        }
        bar.finish_and_clear();
        let counted = ended.clone();
        let first = maps.learn(MUSEUM, None, None).await?;
        let task = tokio::spawn(async move {
            let mut job = first;
            loop {
                maps.wait_for_job(job, LESSON, |_| ()).await?;
                counted.fetch_add(1, Ordering::Relaxed);
                job = maps.learn(MUSEUM, None, None).await?;
            }
        });
        Ok(Self { task: Some(task), ended, began: Instant::now() })
    }

    /// Stops to begin lessons. Errors: one has failed.
    pub(super) async fn end(self) -> anyhow::Result<Taught> {
        let (lessons, seconds) = (self.ended.load(Ordering::Relaxed), self.began.elapsed().as_secs_f64());
        let Some(task) = self.task else { return Ok(Taught { lessons, seconds, was_running: false }) };
        let was_running = !task.is_finished();
        if was_running {
            task.abort();
        } else {
            task.await??;
        }
        Ok(Taught { lessons, seconds, was_running })
    }
}

/// Codes of refusals over all robots.
pub(super) fn summed<'a>(all: impl Iterator<Item = &'a BTreeMap<String, u64>>) -> BTreeMap<String, u64> {
    let mut sum = BTreeMap::new();
    for (code, count) in all.flatten() {
        *sum.entry(code.clone()).or_default() += count;
    }
    sum
}
