//! Landmarks with size, place and health.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{
    Landmark, LandmarkPatch, NewLandmark, Place, Size, VisibilityAreaBody, VisibilitySettingsBody,
};

operations! {
    ADD: POST "/maps/{map}/landmarks" => add_landmark,
    LIST: GET "/maps/{map}/landmarks" => landmarks,
    GET: GET "/maps/{map}/landmarks/{landmark}" => landmark,
    UPDATE: PATCH "/maps/{map}/landmarks/{landmark}" => update_landmark,
    DELETE: DELETE "/maps/{map}/landmarks/{landmark}" => delete_landmark,
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
