//! Mapping: the walls of a map from the scans of a driving robot.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{FinishMappingQuery, MappingProgressBody, NewMapping};

operations! {
    START: POST "/maps/{map}/mapping" => start_mapping,
    GET: GET "/maps/{map}/mapping" => mapping,
    CANCEL: DELETE "/maps/{map}/mapping" => cancel_mapping,
    FINISH: POST "/maps/{map}/mapping/finish" => finish_mapping,
}

impl MapClient {
    /// Begins to make the walls of a map from the scans of a robot.
    pub async fn start_mapping(
        &self,
        map: &str,
        new: &NewMapping,
    ) -> Result<MappingProgressBody, ClientError> {
        self.send(self.ask(&START, &[&map])?.json(new)).await
    }

    /// The present mapping, or the last one since the server started.
    pub async fn mapping(&self, map: &str) -> Result<MappingProgressBody, ClientError> {
        self.send(self.ask(&GET, &[&map])?).await
    }

    /// Cancels a mapping, or deletes one that failed; the map does not change.
    pub async fn cancel_mapping(&self, map: &str) -> Result<(), ClientError> {
        self.done(self.ask(&CANCEL, &[&map])?).await
    }

    /// Ends the drive: the walls are fitted once more and stored. [`MapClient::mapping`] says when
    /// they are.
    pub async fn finish_mapping(&self, map: &str) -> Result<MappingProgressBody, ClientError> {
        self.send(self.ask(&FINISH, &[&map])?).await
    }

    /// Ends the drive, and holds the walls: [`MapClient::mapping`] has them once they are found.
    /// Then [`MapClient::finish_mapping`] stores them, and [`MapClient::cancel_mapping`] gives them
    /// up.
    pub async fn hold_mapping(&self, map: &str) -> Result<MappingProgressBody, ClientError> {
        let query = FinishMappingQuery { hold: true, accept: false };
        self.send(self.ask_query(&FINISH, &[&map], &query)?).await
    }

    /// Ends the drive, stores the walls, and accepts and learns the landmarks that pass every gate.
    pub async fn accept_mapping(&self, map: &str) -> Result<MappingProgressBody, ClientError> {
        let query = FinishMappingQuery { hold: false, accept: true };
        self.send(self.ask_query(&FINISH, &[&map], &query)?).await
    }
}
