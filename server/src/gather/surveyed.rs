//! The objects of a survey as tracks of a gathering that has ended, for a decision. In: the drive
//! and what it gave. Out: the gathering's number.

use super::{Gatherer, new_view};
use crate::store::{
    gatherings::{self, GatheringLimits, NewGathering},
    landmark_placement::StoredCapture,
    views::{NewView, QuadCrop},
};
use engine::{
    mapping::MadeSurvey,
    panics::Edge,
    survey::{ObjectView, SurveyedObject, picture},
    threads::{self, Class},
};
use map::tracks::StoredTrack;
use protos::api::GatheringChange;
use std::sync::Arc;
use vision::{icon::icon, params::Params};

/// Most views of an object that are stored.
const MAX_VIEWS: usize = 12;

/// A track with its views.
type Proposal = (StoredTrack, Vec<NewView>);

impl Gatherer {
    /// Stores the objects that a survey takes for landmarks; `None` where there are none. Beyond
    /// [`GatheringLimits::tracks`] those with fewest views are left out. Durable when this returns.
    /// Errors: why, in words.
    pub(crate) async fn propose(
        self: &Arc<Self>,
        map: &str,
        robot: &str,
        made: Arc<MadeSurvey>,
    ) -> Result<Option<i64>, String> {
        let params = self.params.clone();
        let made = threads::run(Class::Background, move || proposals(&made, &params)).await;
        let (panics, what) = (self.store.vitals().panics(), "the views of a survey");
        let Ok(proposals) = panics.ended(Edge::Gathering, what, "it proposes nothing", made) else {
            return Err("the server failed on the views; see its log".to_owned());
        };
        if proposals.is_empty() {
            return Ok(None);
        }
        let (gatherer, map) = (self.clone(), map.to_owned());
        let new = NewGathering { robot: robot.to_owned(), landmark: None, known: false };
        let proposals = Arc::new(proposals);
        let write = self.store.write(move |tx| {
            Box::pin(async move {
                let row = gatherings::create(tx, &map, &new, GatheringLimits::SERVER).await?;
                for (track, views) in proposals.iter() {
                    for view in views {
                        gatherings::add_view(tx, row.id, track, view, GatheringLimits::SERVER).await?;
                    }
                }
                let told = map.clone();
                tx.after(move || gatherer.tell(&told, row.id, GatheringChange::Ended));
                gatherings::end(tx, &map, row.id, "{}").await
            })
        });
        let stored = write.await.map_err(|error| error.to_string())?;
        Ok(Some(stored.id))
    }
}

fn proposals(made: &MadeSurvey, params: &Params) -> Vec<Proposal> {
    let mut objects: Vec<&SurveyedObject> =
        made.building.objects.iter().filter(|object| object.refused.is_none()).collect();
    objects.sort_by_key(|object| std::cmp::Reverse(object.views.len()));
    objects.truncate(GatheringLimits::SERVER.tracks);
    let proposal = |(number, object): (u32, &SurveyedObject)| {
        let every = object.views.len().div_ceil(MAX_VIEWS).max(1);
        let views = object.views.iter().step_by(every);
        let views: Vec<NewView> = views.filter_map(|view| view_of(made, view, params)).collect();
        let place = Some(object.place);
        let sightings = u32::try_from(object.views.len()).unwrap_or(u32::MAX);
        (StoredTrack { number, landmark: None, sightings, known: 0, place }, views)
    };
    let made = (1..).zip(objects).map(proposal);
    made.filter(|(_, views)| !views.is_empty()).collect()
}

fn view_of(made: &MadeSurvey, view: &ObjectView, params: &Params) -> Option<NewView> {
    let at = made.drive.frames.get(view.frame)?;
    let grey = picture(at).ok()?.into_grey();
    let icon = icon(&grey, &view.corners_px, &params.icon).ok()?;
    let camera = made.building.intrinsics(at.frame.intrinsics.as_ref()?);
    let mounting = made.building.mounting(&at.frame.mounting.as_ref()?.robot_from_camera);
    let mut capture = StoredCapture::of_robot(&camera, &made.building.frames[view.frame], &mounting);
    capture.set_detected_corners(&view.covariance_px2);
    let crop = QuadCrop { corners_px: view.corners_px, icon };
    new_view((&at.frame, &grey), crop, Some(&capture))
}
