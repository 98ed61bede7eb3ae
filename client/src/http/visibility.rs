//! What is seen from a pose and along a path, and where to look.

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
    /// Which landmarks a robot may see from an uncertain pose.
    pub async fn visible(&self, map: &str, request: &VisibleRequest) -> Result<VisibleResponse, ClientError> {
        self.send(self.ask(&VISIBLE, &[&map])?.json(request)).await
    }

    /// Which landmarks are seen along a path, and where none is.
    pub async fn coverage(
        &self,
        map: &str,
        request: &CoverageRequest,
    ) -> Result<CoverageResponse, ClientError> {
        self.send(self.ask(&COVERAGE, &[&map])?.json(request)).await
    }

    /// Which landmarks are worth looking at from a pose, with pan and tilt. It leaves no trace; a robot that turns its
    /// camera asks with [`crate::RobotClient::gaze`].
    pub async fn gaze_ranking(
        &self,
        map: &str,
        query: &GazeQueryBody,
    ) -> Result<GazeRankingBody, ClientError> {
        self.send(self.ask(&GAZE, &[&map])?.json(query)).await
    }
}
