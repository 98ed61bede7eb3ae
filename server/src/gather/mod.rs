//! Gathering views while robots drive. The frame path offers what it has looked at and never waits: a bounded queue, and
//! what does not fit is dropped and counted. One task follows things from frame to frame (`map::tracks`), and what is
//! worth keeping is committed before it counts as kept.
//!
//! It decides on no landmark: that is for a person (`store::accepting`).

mod glimpses;
mod hook;
pub(crate) mod candidates;

pub(crate) use hook::Counts;
pub use hook::{Hook, Offer, Session, hook};

use crate::{
    config::Config,
    jobs::request,
    publication::Catalogue,
    store::{
        StoreError,
        accepting::{self, Accepted, Decision, Pick},
        gatherings::{self, Bounds, GatheringRow, NewGathering},
        placing::{self, Capture},
        views::NewView,
    },
};
use engine::{panics::Edge, picture};
use hook::{Sessions, lock};
use map::tracks::{GatherParams, StoredTrack, TrackOutcome, ViewTracker};
use protos::convert::Encoding;
use sha2::{Digest, Sha256};
use std::{collections::BTreeMap, sync::Arc};
use tokio::sync::mpsc::Receiver;
use vision::{
    model::LandmarkId,
    params::Params,
    recognise::{RecogniseParams, features},
};

/// Who gathers, and what is kept.
#[derive(Debug)]
pub(crate) struct Gatherer {
    store: Catalogue,
    params: Arc<Params>,
    sessions: Arc<Sessions>,
}

impl Gatherer {
    /// Takes up what a stop or a crash interrupted, and follows what is offered until no worker is left.
    pub(crate) async fn start(
        store: Catalogue,
        config: &Config,
        hook: &Hook,
        offers: Receiver<Offer>,
    ) -> Result<(Arc<Self>, tokio::task::JoinHandle<()>), StoreError> {
        let gatherer =
            Arc::new(Self { store, params: config.params.clone(), sessions: hook.sessions.clone() });
        for row in gatherings::open(gatherer.store.reads()).await? {
            tracing::info!(gathering = row.id, robot = row.robot, "gathering_resumed");
            let tracker = gatherer.resumed(&row).await?;
            gatherer.enter(&row, tracker);
        }
        let pulse = gatherer.store.vitals().begin("the task that gathers views");
        let run = gatherer.clone().run(offers);
        let task = tokio::spawn(async move {
            run.await;
            drop(pulse);
        });
        Ok((gatherer, task))
    }

    async fn resumed(&self, row: &GatheringRow) -> Result<ViewTracker, StoreError> {
        let mut tracker = ViewTracker::new(GatherParams::default());
        let walls = self.store.snapshots().get(&row.map).map(|map| map.walls.clone()).unwrap_or_default();
        for track in gatherings::tracks(self.store.reads(), row.id).await? {
            tracker.number_after(track.number);
            if track.state != "open" {
                continue;
            }
            let views = gatherings::track_views(self.store.reads(), row.id, track.number).await?;
            let captures = views.iter().map(|v| (&v.cut.corners_px, v.capture.as_deref()));
            let kept = StoredTrack {
                number: track.number,
                landmark: track.landmark_id.map(|id| LandmarkId(id as u64)),
                sightings: track.sightings,
                known: track.known,
                place: placing::preview(captures, &walls).ok().map(|made| made.place),
            };
            let prepare = |view: gatherings::TrackView| {
                (view.cut.corners_px, features(view.cut.icon, &self.params.recognise))
            };
            tracker.resume(kept, views.into_iter().map(prepare));
        }
        Ok(tracker)
    }

    fn enter(&self, row: &GatheringRow, tracker: ViewTracker) {
        let session = Arc::new(Session::new(row, tracker));
        self.sessions.rcu(|sessions| {
            let mut sessions = BTreeMap::clone(sessions);
            sessions.insert(row.robot.clone(), session.clone());
            sessions
        });
    }

    fn leave(&self, id: i64) {
        self.sessions.rcu(|sessions| {
            let mut sessions = BTreeMap::clone(sessions);
            sessions.retain(|_, session| session.id != id);
            sessions
        });
    }

    fn session(&self, id: i64) -> Option<Arc<Session>> {
        self.sessions.load().values().find(|s| s.id == id).cloned()
    }

    /// Begins. Durable when this returns.
    pub(crate) async fn begin(
        self: &Arc<Self>,
        map: &str,
        new: NewGathering,
    ) -> Result<GatheringRow, StoreError> {
        let (gatherer, map) = (self.clone(), map.to_owned());
        let write = self.store.write(move |tx| {
            Box::pin(async move {
                let row = gatherings::create(tx, &map, &new, Bounds::SERVER).await?;
                let begun = row.clone();
                tx.after(move || gatherer.enter(&begun, ViewTracker::new(GatherParams::default())));
                Ok(row)
            })
        });
        write.await
    }

    /// Ends. What is still in the queue is not kept.
    pub(crate) async fn end(self: &Arc<Self>, map: &str, id: i64) -> Result<GatheringRow, StoreError> {
        let counts =
            self.counts(id).and_then(|c| serde_json::to_string(&c).ok()).unwrap_or_else(|| "{}".into());
        let (gatherer, map) = (self.clone(), map.to_owned());
        let write = self.store.write(move |tx| {
            Box::pin(async move {
                tx.after(move || gatherer.leave(id));
                gatherings::end(tx, &map, id, &counts).await
            })
        });
        write.await
    }

    /// Throws everything away that nobody has accepted.
    pub(crate) async fn delete(self: &Arc<Self>, map: &str, id: i64) -> Result<(), StoreError> {
        let (gatherer, map) = (self.clone(), map.to_owned());
        let write = self.store.write(move |tx| {
            Box::pin(async move {
                tx.after(move || gatherer.leave(id));
                gatherings::delete(tx, &map, id).await
            })
        });
        write.await
    }

    /// Makes landmarks of tracks, and queues their lesson if it is wanted.
    pub(crate) async fn accept(
        self: &Arc<Self>,
        (map, id): (&str, i64),
        picks: Vec<Pick>,
        lesson: bool,
        bounds: accepting::Bounds,
    ) -> Result<Accepted, StoreError> {
        let (map, numbers) = (map.to_owned(), picks.iter().map(|p| p.number).collect::<Vec<_>>());
        let lesson = lesson.then_some(request::Request::of as fn(&[String]) -> String);
        let gatherer = self.clone();
        let after = Arc::new(move || gatherer.decided(id, numbers.iter().copied()));
        let decision = Decision { map, gathering: id, picks, lesson, bounds, after };
        accepting::accept(&self.store, decision).await
    }

    /// Throws a track away.
    pub(crate) async fn discard(self: &Arc<Self>, map: &str, id: i64, number: u32) -> Result<(), StoreError> {
        let (gatherer, map) = (self.clone(), map.to_owned());
        let write = self.store.write(move |tx| {
            Box::pin(async move {
                tx.after(move || gatherer.decided(id, [number]));
                gatherings::discard(tx, &map, id, number).await
            })
        });
        write.await
    }

    /// Somebody has decided on these tracks.
    fn decided(&self, id: i64, numbers: impl IntoIterator<Item = u32>) {
        if let Some(session) = self.session(id) {
            lock(&session.decided).extend(numbers);
        }
    }

    /// What became of the frames so far; `None` for a gathering that has ended.
    pub(crate) fn counts(&self, id: i64) -> Option<Counts> {
        self.session(id).map(|session| *lock(&session.counts))
    }

    async fn run(self: Arc<Self>, mut offers: Receiver<Offer>) {
        while let Some(offer) = offers.recv().await {
            let (session, params) = (offer.session.clone(), self.params.clone());
            let views = tokio::task::spawn_blocking(move || follow(&offer, &params)).await;
            let (panics, what) = (self.store.vitals().panics(), "a frame of a robot that gathers");
            let Ok(views) = panics.joined(Edge::Gathering, what, "nothing of it is kept", views) else {
                continue;
            };
            for (kept, view) in views {
                self.keep(&session, Box::new(kept), view).await;
            }
        }
    }

    async fn keep(&self, session: &Session, kept: Box<StoredTrack>, view: NewView) {
        let id = session.id;
        let write = self.store.write(move |tx| {
            Box::pin(async move { gatherings::add_view(tx, id, &kept, &view, Bounds::SERVER).await })
        });
        let done = write.await;
        let mut counts = lock(&session.counts);
        match done {
            Ok(()) => counts.kept += 1,
            Err(error) => {
                counts.not_stored += 1;
                drop(counts);
                tracing::debug!(gathering = id, %error, "a view was not kept");
                // It was deleted, or its map was.
                if matches!(error, StoreError::NotFound { .. }) {
                    self.leave(id);
                }
            }
        }
    }
}

/// One frame: which of its quads are views to keep, and in which track.
fn follow(offer: &Offer, params: &Params) -> Vec<(StoredTrack, NewView)> {
    let (session, frame) = (&offer.session, &offer.frame);
    let found = glimpses::glimpses(offer, params);
    let wanted = |id| session.landmark.map_or(session.known, |only| only == id);
    let mut tracker = lock(&session.tracker);
    for number in std::mem::take(&mut *lock(&session.decided)) {
        tracker.close(number);
    }
    let at = (frame.captured_ns, offer.camera.as_str());
    let recognise: &RecogniseParams = &params.recognise;
    let outcomes = tracker.update(at, &found.glimpses, wanted, session.landmark.is_none(), recognise);
    let mut counts = lock(&session.counts);
    counts.unusable += found.unusable;
    counts.not_on_wall += found.not_on_wall;
    for outcome in &outcomes {
        counts.add(*outcome);
    }
    drop(counts);
    let mut views = vec![];
    for ((glimpse, corners_px2), outcome) in found.glimpses.iter().zip(&found.corners_px2).zip(outcomes) {
        let TrackOutcome::Keep(number) = outcome else { continue };
        let Some(track) = tracker.tracks().iter().find(|t| t.number == number) else { continue };
        let kept = StoredTrack {
            number,
            landmark: track.landmark,
            sightings: track.sightings,
            known: track.known,
            place: glimpse.place,
        };
        let mut capture = found.capture.clone();
        if let Some(capture) = &mut capture {
            capture.corners_by_detector(corners_px2);
        }
        views.extend(view(offer, glimpse, capture.as_ref()).map(|view| (kept, view)));
    }
    views
}

fn view(offer: &Offer, glimpse: &map::tracks::QuadObservation, capture: Option<&Capture>) -> Option<NewView> {
    let (frame, grey) = (&offer.frame, &offer.looked.image);
    let (image, image_kind) = match frame.encoding {
        Encoding::Jpeg => (frame.image.to_vec(), "jpeg"),
        Encoding::Png => (frame.image.to_vec(), "png"),
        Encoding::Gray8 => (picture::png(grey.width(), grey.height(), grey.data()).ok()?, "png"),
    };
    Some(NewView {
        image_sha256: Sha256::digest(&image).into(),
        image,
        image_kind,
        size_px: [grey.width(), grey.height()],
        cut: crate::store::views::Cut { corners_px: glimpse.corners_px, icon: glimpse.icon.icon.clone() },
        // What else is in the frame may become a landmark itself: it teaches nothing here.
        strangers: vec![],
        capture: capture.and_then(|c| serde_json::to_string(c).ok()),
    })
}

#[cfg(test)]
mod tests;
