//! Starts everything in order: store, jobs, engine, bus, HTTP.

use crate::{
    backup::Backups,
    bus::{Bus, Receivers, Sockets},
    config::{Config, JoinedRouter, Tls},
    events::{EventLog, watch_changes::watch_changes},
    fleet::{Fleet, server_name},
    gather::{self, Gatherer, GatheringTap, OfferedFrame},
    http::{App, Enrolment, Services, resumed_sessions},
    identity::{
        certificates::{CertificateRegistry, Certificates},
        local_token::LocalToken,
    },
    jobs::Jobs,
    publication::Catalogue,
    recording_answers::store_answers,
    ros2::{Ros2, Ros2Publisher},
    running::{RunningServer, Tasks},
    serving::{Listeners, Serving},
    start_error::StartError,
    store::{
        StoreError,
        actor::Actor,
        db::Pool,
        disk_guard::{self, DiskGuard},
        integrity, landmarks, now_ms, pictures,
    },
};
use engine::{
    Observers,
    answer_records::{AnswerRecord, answer_records},
    decode::ImageLimits,
    findings::{LandmarkFinding, findings},
    intake::Intake,
    live::LiveHub,
    mapping_tap::MappingTap,
    motion::MotionTracker,
    panics::Panics,
    quotas::{Quotas, Rates},
    slots::Slots,
    snapshot::Snapshots,
    vitals::{Pulse, Vitals},
    workers::{Engine, Workers},
};
use protos::Name;
use std::{net::SocketAddr, sync::Arc, time::Duration};
use tokio::{
    sync::{mpsc::Receiver, watch},
    task::JoinHandle,
};

/// Starts servers.
#[derive(Debug)]
pub struct Server;

impl Server {
    /// Starts a server. When this returns, it answers.
    pub async fn start(config: Config) -> Result<RunningServer, StartError> {
        let config = Arc::new(config);
        config.log_memory_ceiling();
        let (listeners, sockets) = (Listeners::open(&config).await?, Sockets::take(&config).await?);
        let (store, writer) = Catalogue::open(&config).await?;
        let (stop, stopping) = watch::channel(false);
        let (certificates, listeners) = encrypted(&config, listeners, &stopping)?;
        let (http_addr, metrics_addr) = (listeners.http_addr, listeners.metrics_addr);
        let local_token = write_local_token(&config, &store, http_addr.port())?;
        let sessions = Arc::new(resumed_sessions(&store).await);
        let (snapshots, vitals) = (store.snapshots().clone(), store.vitals().clone());
        let (tap, offered) = gather::gathering_tap();
        let teaching = Teaching::start(&config, &store, (&tap, offered), &stopping).await?;
        let observers = Observers::new(config.limits.replay_bytes);
        let (engine, records) = engine(&config, (snapshots.clone(), vitals.clone()), &observers, tap);
        let recorders = recorders(&config, &store, (records, &observers.live), &stopping);
        let disk = watch_disk(&store, &local_token, &engine, &stopping);
        let checks = checks(&store, &stopping);
        // Whoever owns the router decides who is a robot.
        let of_robots = certificates.as_ref().filter(|_| config.router.is_none());
        let to =
            receivers(&config, (&engine, &observers.live), of_robots.map(|_| store.certificates().clone()))?;
        let (server, fleet) = (to.server.clone(), to.fleet.clone());
        let Robots { mut bus, ros2, publisher, workers } =
            Robots::connect(&config, &engine, to, (sockets, certificates.clone())).await?;
        let (backups, backups_task) = Backups::start(&config, told(&store), stopping.clone());
        let services = Services {
            jobs: teaching.jobs,
            gatherer: teaching.gatherer,
            ros2: ros2.clone(),
            publisher: Some(publisher.clone()),
            sessions: sessions.clone(),
            backups,
            enrolment: enrolment(of_robots, bus.endpoint()),
            local_token_file: Some(local_token.path().to_owned()),
            server: server.clone(),
            fleet,
        };
        let probed = ((*store).clone(), publisher.outbox().clone(), bus.take_pinger());
        let app =
            Arc::new(App::new(config.clone(), store, services, (&engine, &observers), stopping.clone()));
        let serving = Serving::start(listeners, &app, probed, &stopping);
        Ok(RunningServer {
            http_addr,
            metrics_addr,
            zenoh_endpoint: bus.endpoint().to_owned(),
            server,
            snapshots,
            live: observers.live,
            slots: engine.slots,
            ros2,
            sessions,
            local_token,
            tls_name: tls_name(&config, http_addr),
            stop,
            vitals,
            tasks: Tasks {
                workers,
                bus,
                serving,
                jobs: teaching.jobs_task,
                recorders,
                gather: teaching.gather_task,
                checks,
                disk,
                backups: backups_task,
                writer,
            },
        })
    }
}

/// What robots are heard and answered by.
struct Robots {
    bus: Bus,
    ros2: Arc<Ros2>,
    publisher: Arc<Ros2Publisher>,
    workers: Workers,
}

impl Robots {
    /// Robots are heard and answered from now on. There are none of ROS 2 where the server joins a
    /// router.
    async fn connect(
        config: &Config,
        engine: &Engine,
        to: Receivers,
        (sockets, certificates): (Sockets, Option<Arc<Certificates>>),
    ) -> Result<Self, StartError> {
        let bus = Box::pin(Bus::open(config, to.clone(), sockets, certificates)).await?;
        let outbox = bus.outbox().clone();
        let ros2 = match bus.session() {
            Some(session) => Ros2::open(session, &config.ros2, (&to, &outbox)).await?,
            None => Ros2::default(),
        };
        let ros2 = Arc::new(ros2);
        let publisher = Arc::new(ros2.publisher(outbox.clone()));
        engine.vitals.probe("the outbox", move || outbox.is_running());
        let workers = Workers::start(engine, config.workers, &publisher).map_err(StartError::Threads)?;
        Ok(Self { bus, ros2, publisher, workers })
    }
}

/// The first name of the certificate, or else the address; `None` without encryption.
fn tls_name(config: &Config, http_addr: SocketAddr) -> Option<String> {
    let first_name = |tls: &Tls| tls.names.first().cloned();
    config.tls.as_ref().map(|tls| first_name(tls).unwrap_or(http_addr.ip().to_string()))
}

/// Drives that an earlier server was mapping go on.
fn resume_mappings(engine: &Engine, config: &Config) {
    let snapshots = engine.snapshots.clone();
    let is_on =
        move |map: &Name, robot: &Name| snapshots.robot_map(robot.as_str()).as_deref() == Some(map.as_str());
    engine.motion.mappings().count_in(engine.vitals.panics().clone());
    engine.motion.mappings().resume_in(config.data.join("mapping"), is_on);
}

/// The token for programs of this user on this machine.
fn write_local_token(config: &Config, store: &Catalogue, port: u16) -> Result<Arc<LocalToken>, StartError> {
    let written = LocalToken::write(&config.data, port).map(Arc::new);
    let written = written.map_err(|e| StartError::LocalToken(e.to_string()))?;
    store.tokens().set_local(written.secret());
    Ok(written)
}

/// Checks of what is stored that would hold up the start: of the pictures and of the database.
fn checks(store: &Catalogue, stopping: &watch::Receiver<bool>) -> [JoinHandle<()>; 2] {
    let pictures = pictures::check_all((**store).clone(), stopping.clone());
    let database = integrity::check((**store).clone(), stopping.clone());
    [tokio::spawn(pictures), tokio::spawn(database)]
}

/// Looks at the disk: while it is nearly full, journals of mappings get no more scans; when there
/// is room again, what had none at the start is made.
fn watch_disk(
    store: &Catalogue,
    token: &Arc<LocalToken>,
    engine: &Engine,
    stopping: &watch::Receiver<bool>,
) -> JoinHandle<()> {
    let (disk, token, motion) = (store.disk().clone(), token.clone(), engine.motion.clone());
    let part = (store.vitals().begin(disk_guard::PART), stopping.clone());
    let looked = disk.clone();
    let after = move || {
        motion.mappings().set_room(looked.check().is_ok());
        token.write_again();
    };
    tokio::spawn(disk.watch(store.reads().clone(), part, after))
}

/// What robots are enrolled with, if their endpoint is encrypted.
fn enrolment(certificates: Option<&Arc<Certificates>>, zenoh: &str) -> Option<Enrolment> {
    let certificates = certificates.filter(|_| zenoh.starts_with("tls/"))?.clone();
    Some(Enrolment { certificates, zenoh: zenoh.to_owned() })
}

/// The certificates, where there is encryption, and the listeners that show the server's.
fn encrypted(
    config: &Config,
    listeners: Listeners,
    stopping: &watch::Receiver<bool>,
) -> Result<(Option<Arc<Certificates>>, Listeners), StartError> {
    let certificates = open_certificates(config, stopping)?;
    let listeners = listeners.encrypted(certificates.as_ref())?;
    Ok((certificates, listeners))
}

/// The certificates, if connections are encrypted; they renew themselves until the server stops.
fn open_certificates(
    config: &Config,
    stopping: &watch::Receiver<bool>,
) -> Result<Option<Arc<Certificates>>, StartError> {
    let Some(settings) = &config.tls else { return Ok(None) };
    let opened = Certificates::open(settings, &config.data, now_ms());
    let opened = Arc::new(opened.map_err(|e| StartError::Certificates(e.to_string()))?);
    tokio::spawn(opened.clone().keep_valid(stopping.clone()));
    Ok(Some(opened))
}

/// What learns from photographs and drives.
struct Teaching {
    jobs: Arc<Jobs>,
    jobs_task: JoinHandle<()>,
    gatherer: Arc<Gatherer>,
    gather_task: JoinHandle<()>,
}

impl Teaching {
    async fn start(
        config: &Arc<Config>,
        store: &Catalogue,
        (tap, offered): (&GatheringTap, Receiver<OfferedFrame>),
        stopping: &watch::Receiver<bool>,
    ) -> Result<Self, StartError> {
        let failed = |e: StoreError| StartError::Store(e.to_string());
        let started = Jobs::start(store.clone(), config.clone(), stopping.clone());
        let (jobs, jobs_task) = started.await.map_err(failed)?;
        let started = Gatherer::start(store.clone(), config, tap, offered);
        let (gatherer, gather_task) = started.await.map_err(failed)?;
        Ok(Self { jobs, jobs_task, gatherer, gather_task })
    }
}

/// Stores findings and answers, and tells readers of events what changes.
fn recorders(
    config: &Config,
    store: &Catalogue,
    ((found, recorded), live): (Records, &Arc<LiveHub>),
    stopping: &watch::Receiver<bool>,
) -> [JoinHandle<()>; 3] {
    let pulse = store.vitals().begin("the task that stores findings");
    let findings = store_findings(store.clone(), found, pulse);
    let part = |name| (store.vitals().begin(name), stopping.clone());
    let max = config.limits.stored_answers;
    let answers = store_answers(store.clone(), recorded, max, part("the task that stores answers"));
    let watched = (store.snapshots().clone(), store.tokens().clone(), live.clone());
    let events = watch_changes(store.events().clone(), watched, part("the task that tells events"));
    [tokio::spawn(findings), tokio::spawn(answers), tokio::spawn(events)]
}

/// Whom a backup tells of its panics and of its end, whether there is room for it, and the database
/// that is not in the data directory.
fn told(store: &Catalogue) -> (Arc<Panics>, Arc<EventLog>, Arc<DiskGuard>, Option<Pool>) {
    (store.vitals().panics().clone(), store.events().clone(), store.disk().clone(), store.database())
}

/// What is to be stored: findings of robots, and answers.
type Records = (Receiver<LandmarkFinding>, Receiver<AnswerRecord>);

/// Everything between frames and answers, for one set of settings, and what is to be stored of it.
fn engine(
    config: &Config,
    (snapshots, vitals): (Arc<Snapshots>, Arc<Vitals>),
    Observers { live, times, kept_frames }: &Observers,
    tap: GatheringTap,
) -> (Engine, Records) {
    let (findings, found) = findings();
    let (records, recorded) = answer_records(kept_frames.clone());
    let motion = Arc::new(MotionTracker::new(snapshots.clone(), live.clone()).with_quotas(quotas(config)));
    let mappings = Arc::new(MappingTap::new(motion.clone()));
    let engine = Engine {
        slots: Arc::new(Slots::new(config.limits.cameras, config.limits.waiting_frame_bytes)),
        motion,
        snapshots,
        limits: ImageLimits { bytes: config.limits.frame_bytes, pixels: config.limits.frame_pixels },
        vitals,
        relocalisers: Arc::default(),
        observers: vec![
            Arc::new(records),
            live.clone(),
            times.clone(),
            Arc::new(findings),
            Arc::new(tap),
            mappings,
        ],
        search: config.search_frames.policy(config.workers),
    };
    resume_mappings(&engine, config);
    (engine, (found, recorded))
}

/// What each robot may send.
fn quotas(config: &Config) -> Quotas {
    Quotas::new(Rates {
        frames_per_s: config.limits.robot_frames_per_s,
        odometry_per_s: config.limits.robot_odometry_per_s,
        scans_per_s: config.limits.robot_scans_per_s,
        bytes_per_s: config.limits.robot_bytes_per_s,
    })
}

/// Stores findings about landmarks, until the last worker has stopped.
async fn store_findings(store: Catalogue, mut found: Receiver<LandmarkFinding>, pulse: Pulse) {
    while let Some(LandmarkFinding { map, landmark, name, health, finding }) = found.recv().await {
        let actor = Actor::server("finding of robots", format!("/maps/{map}/landmarks/{name}"));
        let stored = store.write(move |tx| {
            Box::pin(async move {
                let name = landmarks::name_of(tx, &map, landmark).await?;
                landmarks::set_health(tx, &map, &name, health, finding.as_deref()).await.map(drop)
            })
        });
        if let Err(error) = actor.scope(stored).await {
            tracing::error!(%error, "landmark_finding_not_stored");
        }
    }
    drop(pulse);
}

fn receivers(
    config: &Config,
    (engine, live): (&Engine, &Arc<LiveHub>),
    certificates: Option<Arc<CertificateRegistry>>,
) -> Result<Receivers, StartError> {
    let server = server_name(config.server_name.as_ref(), &config.data).map_err(StartError::Name)?;
    let start = random_start().map_err(StartError::Name)?;
    let joined = |router: &JoinedRouter| {
        Arc::new(Fleet::new(server.clone(), start, router.connect.clone(), engine.snapshots.clone()))
    };
    let fleet = config.router.as_ref().map(joined);
    let intake = Intake {
        slots: engine.slots.clone(),
        snapshots: engine.snapshots.clone(),
        motion: engine.motion.clone(),
        frame_bytes: config.limits.frame_bytes,
        deadline: Duration::from_millis(u64::from(config.limits.frame_deadline_ms)),
        linked_maps_only: certificates.is_some(),
    };
    Ok(Receivers {
        intake: Arc::new(intake),
        motion: engine.motion.clone(),
        live: live.clone(),
        gazes: Arc::default(),
        vitals: engine.vitals.clone(),
        certificates,
        server,
        fleet,
    })
}

/// A number that no other start has.
fn random_start() -> Result<u64, String> {
    let mut random = [0; 8];
    getrandom::fill(&mut random).map_err(|e| format!("the system gives no random bytes: {e}"))?;
    Ok(u64::from_be_bytes(random))
}
