//! Gathers training views while robots drive. In: analysed frames by a bounded queue; a frame that
//! does not fit is dropped and counted. Out: tracks with views in the store. One task follows
//! objects from frame to frame (`map::tracks`) and commits new views before it counts them.
//!
//! A person decides about tracks (`store::track_acceptance`).

mod frame_observations;
mod frame_tap;
mod surveyed;
pub(crate) mod track_summaries;

pub(crate) use frame_tap::GatheringCounts;
pub use frame_tap::{ActiveGathering, GatheringTap, OfferedFrame, gathering_tap};

use crate::{
    config::Config,
    jobs::request,
    publication::Catalogue,
    store::{
        StoreError,
        gatherings::{self, GatheringLimits, GatheringRow, NewGathering},
        landmark_placement::{self, StoredCapture},
        track_acceptance::{self, AcceptanceResult, Decision, TrackAcceptance},
        views::{NewView, QuadCrop},
    },
};
use engine::{
    panics::Edge,
    picture,
    threads::{self, Class},
};
use frame_tap::{ActiveGatherings, lock};
use map::tracks::{GatherParams, StoredTrack, Track, TrackOutcome, ViewTracker};
use protos::{
    CheckedFrame,
    api::{GatheringChange, ServerEventBody},
    convert::{Encoding, Pixels},
};
use std::{collections::BTreeMap, sync::Arc};
use tokio::sync::mpsc::Receiver;
use vision::{
    frame::GrayImage,
    icon::icon,
    learn::reference_border::reference_border,
    model::LandmarkId,
    params::Params,
    recognise::{RecogniseParams, features},
    seen_border::{FoundBy, SeenBorder},
};

/// The active gatherings.
#[derive(Debug)]
pub(crate) struct Gatherer {
    store: Catalogue,
    params: Arc<Params>,
    active: Arc<ActiveGatherings>,
}

impl Gatherer {
    /// Resumes the open gatherings, and handles offered frames until the last worker has stopped.
    pub(crate) async fn start(
        store: Catalogue,
        config: &Config,
        tap: &GatheringTap,
        frames: Receiver<OfferedFrame>,
    ) -> Result<(Arc<Self>, tokio::task::JoinHandle<()>), StoreError> {
        let gatherer = Arc::new(Self { store, params: config.params.clone(), active: tap.active.clone() });
        for row in gatherings::open(gatherer.store.reads()).await? {
            tracing::info!(gathering = row.id, robot = row.robot, "gathering_resumed");
            let tracker = gatherer.resumed(&row).await?;
            gatherer.enter(&row, tracker);
        }
        let pulse = gatherer.store.vitals().begin("the task that gathers views");
        let run = gatherer.clone().run(frames);
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
            let captures = views.iter().map(|v| (&v.crop.corners_px, v.capture.as_deref()));
            let stored = StoredTrack {
                number: track.number,
                landmark: track.landmark_id.map(|id| LandmarkId(id as u64)),
                sightings: track.sightings,
                known: track.known,
                place: landmark_placement::preview(captures, &walls).ok().map(|preview| preview.place),
            };
            let prepare = |view: gatherings::TrackView| {
                (view.crop.corners_px, features(view.crop.icon, &self.params.recognise))
            };
            tracker.resume(stored, views.into_iter().map(prepare));
        }
        Ok(tracker)
    }

    fn enter(&self, row: &GatheringRow, tracker: ViewTracker) {
        let gathering = Arc::new(ActiveGathering::new(row, tracker));
        self.active.rcu(|active| {
            let mut active = BTreeMap::clone(active);
            active.insert(row.robot.clone(), gathering.clone());
            active
        });
    }

    fn leave(&self, id: i64) {
        self.active.rcu(|active| {
            let mut active = BTreeMap::clone(active);
            active.retain(|_, gathering| gathering.id != id);
            active
        });
    }

    fn active_gathering(&self, id: i64) -> Option<Arc<ActiveGathering>> {
        self.active.load().values().find(|s| s.id == id).cloned()
    }

    fn tell(&self, map: &str, gathering: i64, change: GatheringChange) {
        let map = map.to_owned();
        self.store.events().tell(ServerEventBody::Gathering { map, gathering, change });
    }

    /// Starts a gathering. Durable when this returns.
    pub(crate) async fn begin(
        self: &Arc<Self>,
        map: &str,
        new: NewGathering,
    ) -> Result<GatheringRow, StoreError> {
        let (gatherer, map) = (self.clone(), map.to_owned());
        let write = self.store.write(move |tx| {
            Box::pin(async move {
                let row = gatherings::create(tx, &map, &new, GatheringLimits::SERVER).await?;
                let begun = row.clone();
                tx.after(move || {
                    gatherer.tell(&begun.map, begun.id, GatheringChange::Begun);
                    gatherer.enter(&begun, ViewTracker::new(GatherParams::default()));
                });
                Ok(row)
            })
        });
        write.await
    }

    /// Ends a gathering. Frames that are still in the queue give no views.
    pub(crate) async fn end(self: &Arc<Self>, map: &str, id: i64) -> Result<GatheringRow, StoreError> {
        let counts =
            self.counts(id).and_then(|c| serde_json::to_string(&c).ok()).unwrap_or_else(|| "{}".into());
        let (gatherer, map) = (self.clone(), map.to_owned());
        let write = self.store.write(move |tx| {
            Box::pin(async move {
                let ended = map.clone();
                tx.after(move || {
                    gatherer.leave(id);
                    gatherer.tell(&ended, id, GatheringChange::Ended);
                });
                gatherings::end(tx, &map, id, &counts).await
            })
        });
        write.await
    }

    /// Deletes a gathering with all tracks that were not accepted.
    pub(crate) async fn delete(self: &Arc<Self>, map: &str, id: i64) -> Result<(), StoreError> {
        let (gatherer, map) = (self.clone(), map.to_owned());
        let write = self.store.write(move |tx| {
            Box::pin(async move {
                let deleted = map.clone();
                tx.after(move || {
                    gatherer.leave(id);
                    gatherer.tell(&deleted, id, GatheringChange::Deleted);
                });
                gatherings::delete(tx, &map, id).await
            })
        });
        write.await
    }

    /// Accepts tracks as landmarks, and queues their lesson if it is wanted.
    pub(crate) async fn accept(
        self: &Arc<Self>,
        (map, id): (&str, i64),
        tracks: Vec<TrackAcceptance>,
        lesson: bool,
        limits: track_acceptance::AcceptanceLimits,
    ) -> Result<AcceptanceResult, StoreError> {
        let (map, numbers) = (map.to_owned(), tracks.iter().map(|t| t.number).collect::<Vec<_>>());
        let lesson = lesson.then_some(request::Request::of as fn(&[String]) -> String);
        let gatherer = self.clone();
        let decided = map.clone();
        let after = Arc::new(move || {
            gatherer.decided(id, numbers.iter().copied());
            gatherer.tell(&decided, id, GatheringChange::Decided);
        });
        let decision = Decision { map, gathering: id, tracks, lesson, limits, after };
        track_acceptance::accept(&self.store, decision).await
    }

    /// Discards a track.
    pub(crate) async fn discard(self: &Arc<Self>, map: &str, id: i64, number: u32) -> Result<(), StoreError> {
        let (gatherer, map) = (self.clone(), map.to_owned());
        let write = self.store.write(move |tx| {
            Box::pin(async move {
                let decided = map.clone();
                tx.after(move || {
                    gatherer.decided(id, [number]);
                    gatherer.tell(&decided, id, GatheringChange::Decided);
                });
                gatherings::discard(tx, &map, id, number).await
            })
        });
        write.await
    }

    /// Closes tracks that were accepted or discarded.
    fn decided(&self, id: i64, numbers: impl IntoIterator<Item = u32>) {
        if let Some(gathering) = self.active_gathering(id) {
            lock(&gathering.decided).extend(numbers);
        }
    }

    /// Counts of a gathering's frames and quads so far; `None` for one that has ended.
    pub(crate) fn counts(&self, id: i64) -> Option<GatheringCounts> {
        self.active_gathering(id).map(|gathering| *lock(&gathering.counts))
    }

    async fn run(self: Arc<Self>, mut frames: Receiver<OfferedFrame>) {
        while let Some(frame) = frames.recv().await {
            let (gathering, params) = (frame.gathering.clone(), self.params.clone());
            let views = threads::run(Class::Background, move || new_views(&frame, &params)).await;
            let (panics, what) = (self.store.vitals().panics(), "a frame of a robot that gathers");
            let Ok(views) = panics.ended(Edge::Gathering, what, "it gives no views", views) else {
                continue;
            };
            for (track, view) in views {
                self.store_view(&gathering, Box::new(track), view).await;
            }
        }
    }

    async fn store_view(&self, gathering: &ActiveGathering, track: Box<StoredTrack>, view: NewView) {
        let id = gathering.id;
        if self.store.disk().check().is_err() {
            lock(&gathering.counts).not_stored += 1;
            return;
        }
        let write = self.store.write(move |tx| {
            Box::pin(
                async move { gatherings::add_view(tx, id, &track, &view, GatheringLimits::SERVER).await },
            )
        });
        let done = write.await;
        let mut counts = lock(&gathering.counts);
        match done {
            Ok(()) => counts.kept += 1,
            Err(error) => {
                counts.not_stored += 1;
                drop(counts);
                tracing::debug!(gathering = id, %error, "view_not_stored");
                // The gathering or its map was deleted.
                if matches!(error, StoreError::NotFound { .. }) {
                    self.leave(id);
                }
            }
        }
    }
}

/// The new views of one frame, each with its track.
fn new_views(offered: &OfferedFrame, params: &Params) -> Vec<(StoredTrack, NewView)> {
    let (gathering, frame) = (&offered.gathering, &offered.frame);
    let observed = frame_observations::frame_observations(offered, params);
    let is_wanted = |id| gathering.landmark.map_or(gathering.known, |only| only == id);
    let mut tracker = lock(&gathering.tracker);
    for number in std::mem::take(&mut *lock(&gathering.decided)) {
        tracker.close(number);
    }
    let at = (frame.captured_ns, offered.camera.as_str());
    let recognise: &RecogniseParams = &params.recognise;
    let outcomes = tracker.update(at, &observed.quads, is_wanted, gathering.landmark.is_none(), recognise);
    let mut counts = lock(&gathering.counts);
    counts.unusable += observed.unusable;
    counts.not_on_wall += observed.not_on_wall;
    for outcome in &outcomes {
        counts.add(*outcome);
    }
    drop(counts);
    let mut views = vec![];
    for ((quad, corners_px2), outcome) in observed.quads.iter().zip(&observed.corners_px2).zip(outcomes) {
        let TrackOutcome::Keep(number) = outcome else { continue };
        let Some(track) = tracker.tracks().iter().find(|t| t.number == number) else { continue };
        let stored = StoredTrack {
            number,
            landmark: track.landmark,
            sightings: track.sightings,
            known: track.known,
            place: quad.place,
        };
        let detected = SeenBorder {
            corners_px: quad.corners_px,
            covariance_px2: *corners_px2,
            found_by: FoundBy::Edges,
        };
        let Some((crop, border)) = view_of(track, &offered.gathered.image, detected, params) else {
            lock(&gathering.counts).appearance_mismatch += 1;
            continue;
        };
        let mut capture = observed.capture.clone();
        if let Some(capture) = &mut capture {
            capture.set_detected_corners(&border.covariance_px2);
        }
        let pictured = (&offered.frame, &offered.gathered.image);
        views.extend(new_view(pictured, crop, capture.as_ref()).map(|view| (stored, view)));
    }
    views
}

/// A view along the border of the track's first one. `None` where the picture shows something else
/// there. A landmark is recognised along its own border.
fn view_of(
    track: &Track,
    image: &GrayImage,
    detected: SeenBorder,
    params: &Params,
) -> Option<(QuadCrop, SeenBorder)> {
    let border = match (track.landmark, track.reference()) {
        (None, Some(reference)) => reference_border(image, &detected, reference, params)?,
        _ => detected,
    };
    let icon = icon(image, &border.corners_px, &params.icon).ok()?;
    Some((QuadCrop { corners_px: border.corners_px, icon }, border))
}

fn new_view(
    (frame, grey): (&CheckedFrame, &GrayImage),
    crop: QuadCrop,
    capture: Option<&StoredCapture>,
) -> Option<NewView> {
    // Only whole images are offered.
    let Pixels::Image(sent) = &frame.pixels else { return None };
    let (image, image_kind) = match sent.encoding {
        Encoding::Jpeg => (sent.bytes.to_vec(), "jpeg"),
        Encoding::Png => (sent.bytes.to_vec(), "png"),
        Encoding::Gray8 | Encoding::Rgb8 | Encoding::Bgr8 => {
            (picture::png(grey.width(), grey.height(), grey.data()).ok()?, "png")
        }
    };
    Some(NewView {
        image_sha256: crate::store::pictures::digest(&image),
        image,
        image_kind,
        size_px: [grey.width(), grey.height()],
        crop,
        // Another quad of the frame may become a landmark itself: it is no distractor here.
        distractors: vec![],
        capture: capture.and_then(|c| serde_json::to_string(c).ok()),
    })
}

#[cfg(test)]
mod tests;
