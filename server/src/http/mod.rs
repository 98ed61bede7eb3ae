//! The HTTP face: administrators, teachers and pages. axum appears only here.
//!
//! `/api/v1`, JSON with `snake_case` names, `application/problem+json` errors with a stable `code`
//! and the `field`, lists in pages. Handlers parse, call the store, the jobs or the engine, and
//! shape the answer; they decide nothing.

mod answers;
mod audit;
mod authorise;
mod backups;
mod bulk;
mod bundles;
mod cameras;
mod components;
mod cookie;
mod creation;
mod documented;
pub(crate) mod encryption;
mod error;
mod events;
mod examples;
mod extract;
mod gathering;
mod guard;
mod health;
mod drafts;
mod history;
mod landmark_aspect;
mod landmark_models;
mod landmarks;
mod learning;
mod live;
mod localise;
mod mapping;
mod maps;
mod metrics;
mod modalities;
mod page_session;
mod pages;
mod pose_by_hand;
mod peer;
mod photograph_camera;
mod pictures;
mod recognise;
mod refused_views;
mod reference_runs;
mod relocalisation;
mod request_id;
mod request_rates;
mod replay;
mod reused_answers;
mod revision;
mod robot_activity;
mod robot_certificates;
mod robots;
mod room;
mod ros2;
mod router;
mod safe_headers;
mod security;
mod servers;
mod stored_answers;
mod tokens;
mod topology;
mod underlay;
mod upload;
mod views;
mod visibility;
mod visibility_settings;
mod walls;
mod ambiguous;
mod objects;
mod upload_places;
pub(crate) mod listen;
#[cfg(test)]
mod tests;

pub(crate) use metrics::alone as metrics_alone;
pub(crate) use page_session::resumed_sessions;
pub(crate) use router::Service;

use crate::{
    backup::Backups,
    config::Config,
    fleet::Fleet,
    gather::Gatherer,
    identity::Sessions,
    jobs::Jobs,
    metrics::http_times::HttpTimes,
    publication::Catalogue,
    ros2::{Ros2, Ros2Publisher},
    store::now_ms,
};
use authorise::Caller;
use axum::http::StatusCode;
use engine::{
    Observers,
    frame_times::FrameTimes,
    intake::FrameJob,
    kept_frames::KeptFrames,
    live::LiveHub,
    motion::MotionTracker,
    panics::Edge,
    relocalise::Relocalisers,
    slots::Slots,
    threads::{self, Class},
    workers::Engine,
};
use error::ApiError;
use protos::Name;
use reused_answers::ReusedAnswers;
pub(crate) use robot_certificates::Enrolment;
use std::{
    path::PathBuf,
    sync::Arc,
    time::{Duration, Instant},
};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, SemaphorePermit, watch};

/// Where the API lives.
const API: &str = "/api/v1";
/// Longest time between two looks at the token of an event stream.
const STREAM_CHECK: Duration = Duration::from_mins(1);

/// What every handler shares.
#[derive(Debug)]
pub(crate) struct App {
    pub(crate) config: Arc<Config>,
    pub(crate) store: Catalogue,
    pub(crate) jobs: Arc<Jobs>,
    /// Robots that gather views.
    pub(crate) gatherer: Arc<Gatherer>,
    /// What robots are doing now.
    pub(crate) live: Arc<LiveHub>,
    /// Where they are.
    pub(crate) motion: Arc<MotionTracker>,
    /// Their last frames.
    pub(crate) kept_frames: Arc<KeptFrames>,
    /// Where those may be that do not know.
    pub(crate) searches: Arc<Relocalisers>,
    /// Frames that wait, and counts of all.
    pub(crate) slots: Arc<Slots<FrameJob>>,
    /// How long frames take.
    pub(crate) frame_times: Arc<FrameTimes>,
    /// How long requests take.
    pub(crate) http_times: HttpTimes,
    /// Robots of ROS 2.
    pub(crate) ros2: Arc<Ros2>,
    /// Where poses go that were not asked for by a message; absent without a bus.
    pub(crate) publisher: Option<Arc<Ros2Publisher>>,
    /// Sessions of the page.
    pub(crate) sessions: Arc<Sessions>,
    /// Where the local token is, absolute.
    pub(crate) local_token_file: Option<PathBuf>,
    pub(crate) backups: Arc<Backups>,
    /// What robots are enrolled with, where their connections are encrypted.
    pub(crate) enrolment: Option<Enrolment>,
    /// This server's name.
    pub(crate) server: Name,
    /// The servers of its router, if it joins one.
    pub(crate) fleet: Option<Arc<Fleet>>,
    /// Becomes true when the server stops; ends event streams.
    pub(crate) stopping: watch::Receiver<bool>,
    /// How often each token and address may ask.
    rates: request_rates::RequestRates,
    /// Answers to reads of maps.
    reused: ReusedAnswers,
    /// Places for vision work asked for over HTTP: as many as there are vision threads.
    vision: Arc<Semaphore>,
    /// Places for event streams.
    streams: Arc<Semaphore>,
    /// Places for requests with large bodies.
    uploads: upload_places::UploadPlaces,
    /// The place for a bundle that is written or read: its map is in memory as a whole.
    bundles: Semaphore,
}

/// Who works on what is asked for.
#[derive(Debug)]
pub(crate) struct Services {
    pub(crate) jobs: Arc<Jobs>,
    pub(crate) gatherer: Arc<Gatherer>,
    pub(crate) ros2: Arc<Ros2>,
    pub(crate) publisher: Option<Arc<Ros2Publisher>>,
    pub(crate) sessions: Arc<Sessions>,
    pub(crate) local_token_file: Option<PathBuf>,
    pub(crate) backups: Arc<Backups>,
    pub(crate) enrolment: Option<Enrolment>,
    pub(crate) server: Name,
    pub(crate) fleet: Option<Arc<Fleet>>,
}

/// The state of the router.
pub(crate) type AppState = Arc<App>;

impl App {
    pub(crate) fn new(
        config: Arc<Config>,
        store: Catalogue,
        services: Services,
        (engine, observers): (&Engine, &Observers),
        stopping: watch::Receiver<bool>,
    ) -> Self {
        let Services { jobs, gatherer, ros2, publisher, sessions, .. } = services;
        let Services { local_token_file, backups, enrolment, server, fleet, .. } = services;
        let vision = Arc::new(Semaphore::new(config.workers));
        let streams = Arc::new(Semaphore::new(config.limits.streams));
        let upload_wait = Duration::from_secs(config.limits.upload_wait_s);
        let uploads = upload_places::UploadPlaces::new(config.limits.uploads, upload_wait);
        let rates = request_rates::RequestRates::new(&config.limits);
        let Observers { live, times: frame_times, kept_frames } = observers.clone();
        let (motion, slots) = (engine.motion.clone(), engine.slots.clone());
        let searches = engine.relocalisers.clone();
        Self {
            config,
            store,
            jobs,
            gatherer,
            live,
            motion,
            kept_frames,
            searches,
            slots,
            frame_times,
            http_times: HttpTimes::default(),
            ros2,
            publisher,
            sessions,
            local_token_file,
            backups,
            enrolment,
            server,
            fleet,
            stopping,
            rates,
            reused: ReusedAnswers::default(),
            vision,
            streams,
            uploads,
            bundles: Semaphore::new(1),
        }
    }

    /// Runs vision work off the runtime, a bounded number at a time, after that of robots.
    async fn on_vision_thread<T: Send + 'static>(
        self: Arc<Self>,
        work: impl FnOnce(&Self) -> T + Send + 'static,
    ) -> Result<T, ApiError> {
        let vitals = self.store.vitals().clone();
        let place = self.vision.clone().acquire_owned().await.map_err(|e| ApiError::internal(&e))?;
        let done = threads::run(Class::Requests, move || {
            let result = work(&self);
            // Not before the work is done: a client that hangs up does not make room for another.
            drop(place);
            result
        });
        let follows = "the request is refused as internal";
        let done = vitals.panics().ended(Edge::Request, "vision work of a request", follows, done.await);
        done.map_err(|e| ApiError::internal(&e))
    }

    /// The place for a bundle.
    async fn bundle_place(&self) -> Result<SemaphorePermit<'_>, ApiError> {
        self.bundles.acquire().await.map_err(|closed| ApiError::internal(&closed))
    }

    /// A place for an event stream, or 503.
    fn stream_place(&self) -> Result<OwnedSemaphorePermit, ApiError> {
        self.streams.clone().try_acquire_owned().map_err(|_full| {
            let detail = format!("all {} event streams are in use", self.config.limits.streams);
            ApiError::new(StatusCode::SERVICE_UNAVAILABLE, "too_many_streams", detail)
        })
    }

    /// Ends when the server stops, the session is logged out, or the token is revoked, expires or
    /// is for other maps.
    fn ended_for(&self, Caller { principal, session }: Caller) -> impl Future<Output = ()> + Send + use<> {
        let (tokens, sessions, stopped) =
            (self.store.tokens().clone(), self.sessions.clone(), self.stopped());
        let denied = async move {
            let (mut token_changes, mut session_changes) = (tokens.changes(), sessions.changes());
            let is_open = || {
                session.as_ref().is_none_or(|cookie| sessions.token(cookie, Instant::now()).is_some())
                    && tokens.principal(principal.token, now_ms()).as_ref() == Ok(&principal)
            };
            while is_open() {
                let left = principal.expires_ms.map_or(STREAM_CHECK, |end| {
                    Duration::from_millis(end.saturating_sub(now_ms()).max(1) as u64).min(STREAM_CHECK)
                });
                // Either way, one more look.
                tokio::select! {
                    _ = token_changes.changed() => {}
                    _ = session_changes.changed() => {}
                    () = tokio::time::sleep(left) => {}
                }
            }
        };
        async move {
            tokio::select! {
                () = stopped => {}
                () = denied => {}
            }
        }
    }

    /// Ends when the server stops.
    fn stopped(&self) -> impl Future<Output = ()> + Send + use<> {
        let mut stopping = self.stopping.clone();
        async move {
            // An error means that the server is gone altogether.
            drop(stopping.wait_for(|stop| *stop).await);
        }
    }
}
