//! Landmarks visible from a pose and along a path, and gaze.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{
    CoverageRequest, CoverageResponse, GazeQueryBody, GazeRankingBody, VisibleRequest, VisibleResponse,
};

operations! {
    VISIBLE: POST "/maps/{map}/visible" => visible,
    COVERAGE: POST "/maps/{map}/coverage" => coverage,
    GAZE: POST "/maps/{map}/gaze" => gaze_ranking,
}

impl MapClient {
    /// Landmarks that may be visible from an uncertain pose.
    pub async fn visible(&self, map: &str, request: &VisibleRequest) -> Result<VisibleResponse, ClientError> {
        self.send(self.ask(&VISIBLE, &[&map])?.json(request)).await
    }

    /// Landmarks that are visible along a path, and the parts without any.
    pub async fn coverage(
        &self,
        map: &str,
        request: &CoverageRequest,
    ) -> Result<CoverageResponse, ClientError> {
        self.send(self.ask(&COVERAGE, &[&map])?.json(request)).await
    }

    /// Ranks landmarks as gaze targets from a pose, with pan and tilt. The server's state does not
    /// change; a robot that turns its camera uses [`crate::RobotClient::gaze`].
    pub async fn gaze_ranking(
        &self,
        map: &str,
        query: &GazeQueryBody,
    ) -> Result<GazeRankingBody, ClientError> {
        self.send(self.ask(&GAZE, &[&map])?.json(query)).await
    }
}
