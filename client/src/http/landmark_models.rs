//! What was learnt of landmarks.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{
    DuplicatePair, DuplicateQuery, LandmarkDistances, LandmarkEvidence, LandmarkModelDetail,
    LandmarkModelQuery, ModelPictureQuery, Page,
};

operations! {
    MODEL: GET "/maps/{map}/landmarks/{landmark}/model" => landmark_model,
    DISTANCES: GET "/maps/{map}/landmarks/{landmark}/distances" => landmark_distances,
    EVIDENCE: GET "/maps/{map}/landmarks/{landmark}/evidence" => landmark_evidence,
    ICON: GET "/maps/{map}/landmarks/{landmark}/icon" => landmark_icon,
    DUPLICATES: GET "/maps/{map}/duplicates" => duplicates,
}

impl MapClient {
    /// Thresholds, keypoints, points and sizes of a landmark's model, and on request the Harris
    /// points of its icons with descriptors. Refused with `not_learnt` if there is none.
    pub async fn landmark_model(
        &self,
        map: &str,
        landmark: &str,
        query: LandmarkModelQuery,
    ) -> Result<LandmarkModelDetail, ClientError> {
        self.send(self.ask_query(&MODEL, &[&map, &landmark], &query)?).await
    }

    /// Histograms of the distances that its thresholds were fitted to.
    pub async fn landmark_distances(
        &self,
        map: &str,
        landmark: &str,
    ) -> Result<LandmarkDistances, ClientError> {
        self.send(self.ask(&DISTANCES, &[&map, &landmark])?).await
    }

    /// How strongly points spoke for it in the newest stored answers.
    pub async fn landmark_evidence(
        &self,
        map: &str,
        landmark: &str,
    ) -> Result<LandmarkEvidence, ClientError> {
        self.send(self.ask(&EVIDENCE, &[&map, &landmark])?).await
    }

    /// A learnt icon, the mean of the views, or a mode: PNG.
    pub async fn landmark_icon(
        &self,
        map: &str,
        landmark: &str,
        query: ModelPictureQuery,
    ) -> Result<Vec<u8>, ClientError> {
        self.bytes(self.ask_query(&ICON, &[&map, &landmark], &query)?).await
    }

    /// A page of the pairs of landmarks that look alike.
    pub async fn duplicates(
        &self,
        map: &str,
        query: &DuplicateQuery,
    ) -> Result<Page<DuplicatePair>, ClientError> {
        self.send(self.ask_query(&DUPLICATES, &[&map], query)?).await
    }
}
