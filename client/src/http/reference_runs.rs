//! Recordings of robots, and the reference runs that maps have learnt from.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{RecordingStatusBody, ReferenceRunBody, ReferenceRuns, ReferenceTrajectoryBody};

operations! {
    START: POST "/robots/{robot}/recording" => start_recording,
    GET: GET "/robots/{robot}/recording" => recording,
    CANCEL: DELETE "/robots/{robot}/recording" => cancel_recording,
    FINISH: POST "/robots/{robot}/recording/reference" => finish_recording,
    LIST: GET "/maps/{map}/reference-runs" => reference_runs,
    DELETE: DELETE "/maps/{map}/reference-runs/{run}" => delete_reference_run,
}

impl MapClient {
    /// Begins a recording of a robot, in the server's memory.
    pub async fn start_recording(&self, robot: &str) -> Result<RecordingStatusBody, ClientError> {
        self.send(self.ask(&START, &[&robot])?).await
    }

    /// Status of the recording.
    pub async fn recording(&self, robot: &str) -> Result<RecordingStatusBody, ClientError> {
        self.send(self.ask(&GET, &[&robot])?).await
    }

    /// Cancels the recording.
    pub async fn cancel_recording(&self, robot: &str) -> Result<(), ClientError> {
        self.done(self.ask(&CANCEL, &[&robot])?).await
    }

    /// Ends the recording with a reference trajectory; the map learns modality statistics from it.
    pub async fn finish_recording(
        &self,
        robot: &str,
        trajectory: &ReferenceTrajectoryBody,
    ) -> Result<ReferenceRunBody, ClientError> {
        self.send(self.ask(&FINISH, &[&robot])?.json(trajectory)).await
    }

    /// The reference runs of a map, oldest first.
    pub async fn reference_runs(&self, map: &str) -> Result<Vec<ReferenceRunBody>, ClientError> {
        let found: ReferenceRuns = self.send(self.ask(&LIST, &[&map])?).await?;
        Ok(found.runs)
    }

    /// Deletes a reference run with its statistics.
    pub async fn delete_reference_run(&self, map: &str, run: i64) -> Result<(), ClientError> {
        self.done(self.ask(&DELETE, &[&map, &run])?).await
    }
}
