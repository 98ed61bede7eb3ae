//! `robot/{robot}/rpc/localise`: where a robot is, by what it senses at one place. In: queries.
//! Out: replies, by the code of HTTP's `localise`.
//!
//! A search takes longer than zenoh's threads may wait: queries pass a bounded queue to one thread.
//! Each robot has one place in it, so that none keeps the others out.

use super::{BusError, Receivers, caught};
use crate::fleet::Responsibility;
use crate::localise_body::localise_body;
use engine::{
    decode::{ImageLimits, decode_frame},
    localise::{LocaliseFrame, LocaliseInput, localise},
    panics::Edge,
    snapshot::MapSnapshot,
    threads::{self, Class},
};
use protos::{
    Code, Key, Keys, Name, Rejection,
    convert::{CheckedLocalise, localise::localise_reply},
    named_map,
    prost::Message,
    v1,
};
use std::{
    collections::BTreeSet,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        mpsc::{SyncSender, TrySendError, sync_channel},
    },
    thread::JoinHandle,
    time::Instant,
};
use zenoh::{
    Session, Wait,
    query::{Query, Queryable},
};

/// Queries that wait for the one in work.
pub(super) const MAX_WAITING: usize = 8;

/// A checked query.
struct Job {
    robot: Name,
    map: Arc<MapSnapshot>,
    sensed: CheckedLocalise,
    /// The search ends then.
    until: Instant,
    query: Query,
}

/// Robots with a query in the queue or in work.
#[derive(Clone, Default)]
struct Places(Arc<Mutex<BTreeSet<Name>>>);

impl Places {
    fn robots(&self) -> MutexGuard<'_, BTreeSet<Name>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The queryable and the thread behind it.
pub(super) struct Localiser {
    queryable: Queryable<()>,
    thread: JoinHandle<()>,
}

impl Localiser {
    /// Answers from now on. Images of frames are decoded within `limits`.
    pub(super) async fn start(
        session: &Session,
        keys: &Keys,
        to: &Receivers,
        limits: ImageLimits,
    ) -> Result<Self, BusError> {
        let (queue, jobs) = sync_channel::<Job>(MAX_WAITING);
        let (places, pulse) = (Places::default(), to.vitals.begin("the thread that localises robots"));
        let (served, vitals, server) = (places.clone(), to.vitals.clone(), to.server.clone());
        let work = move || {
            // Dropped with the thread, however that ends.
            let _pulse = pulse;
            for job in jobs {
                let done = vitals.panics().catch(
                    Edge::Message,
                    "a localisation",
                    "it is refused as internal",
                    || found(&job, limits),
                );
                served.robots().remove(&job.robot);
                reply((&job.robot, &server), &job.query, done.unwrap_or_else(failed));
            }
        };
        let thread = threads::spawn(Class::Requests, "localise", work)
            .map_err(|source| BusError::Thread { name: "localise", source })?;
        let receive = {
            let (keys, to) = (keys.clone(), to.clone());
            move |query: Query| {
                let Ok(Key::Localise(robot)) = keys.parse(query.key_expr().as_str()) else { return };
                let payload = query.payload().map(|payload| payload.to_bytes()).unwrap_or_default();
                match to.responsibility(&robot, || named_map::of_localise(&payload)) {
                    Responsibility::Take => {}
                    Responsibility::Silent => return,
                    Responsibility::Refuse(refusal) => {
                        return reply((&robot, &to.server), &query, Err(refusal));
                    }
                }
                drop(payload);
                let panics = to.vitals.panics();
                let taken =
                    panics.catch(Edge::Message, "a localisation", "it is refused as internal", || {
                        take(&to, (&queue, &places), &robot, &query)
                    });
                if let Err(refusal) = taken.unwrap_or_else(|| failed().map(drop)) {
                    reply((&robot, &to.server), &query, Err(refusal));
                }
            }
        };
        let declared = session
            .declare_queryable(keys.all_localisations())
            .callback(caught(&to.vitals, "a localisation", receive))
            .await;
        let queryable = declared
            .map_err(|e| BusError::Declare { action: "answer localisations", detail: e.to_string() })?;
        Ok(Self { queryable, thread })
    }

    /// Takes no more queries, and returns when the taken ones are answered.
    pub(super) async fn close(self) {
        if let Err(error) = self.queryable.undeclare().await {
            tracing::warn!(%error, "zenoh_undeclare_failed");
        }
        let thread = self.thread;
        if !matches!(tokio::task::spawn_blocking(move || thread.join()).await, Ok(Ok(()))) {
            tracing::error!("localiser_panicked");
        }
    }
}

/// Checks a query and puts it into the queue.
fn take(
    to: &Receivers,
    (queue, places): (&SyncSender<Job>, &Places),
    robot: &Name,
    query: &Query,
) -> Result<(), Rejection> {
    let received = Instant::now();
    if !to.admits(robot) {
        return Err(Rejection::new(Code::UnknownRobot, "robot", "not registered"));
    }
    let own = to.intake.robot_map(robot)?;
    let bytes = query.payload().map(|payload| payload.to_bytes()).unwrap_or_default();
    if bytes.len() > to.intake.frame_bytes {
        let detail =
            format!("{} bytes are more than {} (limits.frame_bytes)", bytes.len(), to.intake.frame_bytes);
        return Err(Rejection::new(Code::TooLarge, "message", detail));
    }
    let request = v1::LocaliseRequest::decode(&*bytes)
        .map_err(|e| Rejection::new(Code::BadMessage, "message", e.to_string()))?;
    let sensed = CheckedLocalise::try_from(request)?;
    let map = to.intake.open_map(&own, sensed.map.as_ref().map_or(own.as_str(), Name::as_str))?;
    if !places.robots().insert(robot.clone()) {
        let detail = "an earlier question of the robot is not answered yet";
        return Err(Rejection::new(Code::TooMany, "robot", detail));
    }
    let until = received + sensed.budget;
    let job = Job { robot: robot.clone(), map, sensed, until, query: query.clone() };
    queue.try_send(job).map_err(|full| {
        places.robots().remove(robot);
        let detail = match full {
            TrySendError::Full(_) => format!("{MAX_WAITING} other robots wait already"),
            TrySendError::Disconnected(_) => "the server stops".to_owned(),
        };
        Rejection::new(Code::TooMany, "message", detail)
    })
}

fn found(job: &Job, limits: ImageLimits) -> Result<v1::LocaliseReply, Rejection> {
    if Instant::now() >= job.until {
        let detail = "other localisations took the time";
        return Err(Rejection::new(Code::Expired, "deadline_ms", detail));
    }
    let CheckedLocalise { frame, scan, .. } = &job.sensed;
    let picture = frame.as_ref().map(|(frame, ..)| decode_frame(frame, limits)).transpose();
    let picture = picture.map_err(|r| r.inside("frame"))?;
    let frame = frame.as_ref().zip(picture.as_ref());
    let frame = frame.map(|((_, camera, extrinsics), picture)| {
        let picture = picture.into();
        LocaliseFrame { picture, camera, extrinsics }
    });
    let input = LocaliseInput { map: &job.map, frame, scan: scan.as_ref() };
    let localisation = localise(&input, &|| Instant::now() >= job.until);
    Ok(localise_reply(localise_body(localisation, &job.map)))
}

fn failed() -> Result<v1::LocaliseReply, Rejection> {
    Err(Rejection::new(Code::Internal, "message", "the server failed on it; see its log"))
}

fn reply((robot, server): (&Name, &Name), query: &Query, done: Result<v1::LocaliseReply, Rejection>) {
    let mut reply = done.unwrap_or_else(|refusal| {
        tracing::debug!(%robot, %refusal, "localisation_refused");
        v1::LocaliseReply { rejection: Some((&refusal).into()), ..v1::LocaliseReply::default() }
    });
    reply.server = server.to_string();
    if let Err(error) = query.reply(query.key_expr().clone(), reply.encode_to_vec()).wait() {
        tracing::debug!(%robot, %error, "localisation_not_sent");
    }
}
