//! What was learnt of landmarks.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{
    DuplicatePair, DuplicateQuery, LandmarkDistances, LandmarkEvidence, LandmarkModelDetail, Page,
};

operations! {
    MODEL: GET "/maps/{map}/landmarks/{landmark}/model" => landmark_model,
    DISTANCES: GET "/maps/{map}/landmarks/{landmark}/distances" => landmark_distances,
    EVIDENCE: GET "/maps/{map}/landmarks/{landmark}/evidence" => landmark_evidence,
    ICON: GET "/maps/{map}/landmarks/{landmark}/icon" => landmark_icon,
    DUPLICATES: GET "/maps/{map}/duplicates" => duplicates,
}

impl MapClient {
    /// Thresholds, keypoints, points and sizes of a landmark's model. Refused with `not_learnt` if
    /// there is none.
    pub async fn landmark_model(
        &self,
        map: &str,
        landmark: &str,
    ) -> Result<LandmarkModelDetail, ClientError> {
        self.send(self.ask(&MODEL, &[&map, &landmark])?).await
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

    /// The learnt icon that is nearest to the mean of its views: PNG.
    pub async fn landmark_icon(&self, map: &str, landmark: &str) -> Result<Vec<u8>, ClientError> {
        self.bytes(self.ask(&ICON, &[&map, &landmark])?).await
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
