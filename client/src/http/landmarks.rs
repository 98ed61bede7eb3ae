//! Landmarks with size, place and health.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{
    BulkOutcome, Landmark, LandmarkDeletion, LandmarkDeletions, LandmarkMerge, LandmarkPatch, LandmarkQuery,
    NewLandmark, NewLandmarks, Page, Place, Size, VisibilityAreaBody, VisibilitySettingsBody,
};

operations! {
    ADD: POST "/maps/{map}/landmarks" => add_landmark,
    LIST: GET "/maps/{map}/landmarks" => landmarks,
    GET: GET "/maps/{map}/landmarks/{landmark}" => landmark,
    UPDATE: PATCH "/maps/{map}/landmarks/{landmark}" => update_landmark,
    DELETE: DELETE "/maps/{map}/landmarks/{landmark}" => delete_landmark,
    MERGE: POST "/maps/{map}/landmarks/{landmark}/merge" => merge_landmarks,
    ADD_ALL: POST "/maps/{map}/bulk/create-landmarks" => add_landmarks,
    DELETE_ALL: POST "/maps/{map}/bulk/delete-landmarks" => delete_landmarks,
    AREA: GET "/maps/{map}/landmarks/{landmark}/visibility" => visibility_area,
}

impl MapClient {
    /// Adds a landmark without views.
    pub async fn add_landmark(
        &self,
        map: &str,
        name: &str,
        size: Option<Size>,
        place: Option<Place>,
    ) -> Result<Landmark, ClientError> {
        let new = NewLandmark { name: name.to_owned(), size, place };
        self.send(self.ask(&ADD, &[&map])?.json(&new)).await
    }

    /// All landmarks of a map, by name.
    pub async fn landmarks(&self, map: &str) -> Result<Vec<Landmark>, ClientError> {
        self.all(&LIST, &[&map]).await
    }

    /// A page of the landmarks that a query selects, with their number on all pages.
    pub async fn find_landmarks(
        &self,
        map: &str,
        query: &LandmarkQuery,
    ) -> Result<Page<Landmark>, ClientError> {
        self.send(self.ask_query(&LIST, &[&map], query)?).await
    }

    /// Adds landmarks without views, at most 2000: all or none. The field of a refusal has the
    /// number of the one at fault.
    pub async fn add_landmarks(&self, map: &str, new: &[NewLandmark]) -> Result<u64, ClientError> {
        let body = NewLandmarks { landmarks: new.to_vec() };
        let done: BulkOutcome = self.send(self.ask(&ADD_ALL, &[&map])?.json(&body)).await?;
        Ok(done.count)
    }

    /// Deletes landmarks with their views and models, at most 2000: all or none. One with a
    /// revision is deleted only if it still has that.
    pub async fn delete_landmarks(
        &self,
        map: &str,
        landmarks: &[LandmarkDeletion],
    ) -> Result<u64, ClientError> {
        let body = LandmarkDeletions { landmarks: landmarks.to_vec() };
        let done: BulkOutcome = self.send(self.ask(&DELETE_ALL, &[&map])?.json(&body)).await?;
        Ok(done.count)
    }

    /// One landmark.
    pub async fn landmark(&self, map: &str, landmark: &str) -> Result<Landmark, ClientError> {
        self.send(self.ask(&GET, &[&map, &landmark])?).await
    }

    /// Renames a landmark; sets or deletes size and place; sets landmark health.
    pub async fn update_landmark(
        &self,
        map: &str,
        landmark: &str,
        patch: &LandmarkPatch,
    ) -> Result<Landmark, ClientError> {
        self.send(self.ask(&UPDATE, &[&map, &landmark])?.json(patch)).await
    }

    /// Makes two landmarks one: `into` gets the views of `from`, and the size and place that it
    /// lacks; `from` is deleted. Learn it again afterwards.
    pub async fn merge_landmarks(&self, map: &str, into: &str, from: &str) -> Result<Landmark, ClientError> {
        let body = LandmarkMerge { from: from.to_owned() };
        self.send(self.ask(&MERGE, &[&map, &into])?.json(&body)).await
    }

    /// Deletes a landmark with its views and model.
    pub async fn delete_landmark(&self, map: &str, landmark: &str) -> Result<(), ClientError> {
        self.done(self.ask(&DELETE, &[&map, &landmark])?).await
    }

    /// The visibility area of a landmark, with these settings instead of the map's.
    pub async fn visibility_area(
        &self,
        map: &str,
        landmark: &str,
        settings: &VisibilitySettingsBody,
    ) -> Result<VisibilityAreaBody, ClientError> {
        self.send(self.ask_query(&AREA, &[&map, &landmark], settings)?).await
    }
}
