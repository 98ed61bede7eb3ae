//! Gatherings: training views that a robot collects while it drives, and a person's decision on
//! their tracks.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{AcceptRequest, AcceptanceBody, Gathering, NewGatheringBody, TrackList, TrackSummary};

operations! {
    START: POST "/maps/{map}/gatherings" => start_gathering,
    LIST: GET "/maps/{map}/gatherings" => gatherings,
    GET: GET "/maps/{map}/gatherings/{gathering}" => gathering,
    STOP: POST "/maps/{map}/gatherings/{gathering}/stop" => stop_gathering,
    DELETE: DELETE "/maps/{map}/gatherings/{gathering}" => delete_gathering,
    TRACKS: GET "/maps/{map}/gatherings/{gathering}/tracks" => tracks,
    DISCARD: DELETE "/maps/{map}/gatherings/{gathering}/tracks/{track}" => discard_track,
    ICON: GET "/maps/{map}/gatherings/{gathering}/tracks/{track}/views/{view}/icon" => track_icon,
    ACCEPT: POST "/maps/{map}/gatherings/{gathering}/accept" => accept_tracks,
}

impl MapClient {
    /// Begins to gather views with a robot: of one landmark, or of new objects (with an option of
    /// known landmarks, too).
    pub async fn start_gathering(&self, map: &str, new: &NewGatheringBody) -> Result<Gathering, ClientError> {
        self.send(self.ask(&START, &[&map])?.json(new)).await
    }

    /// All gatherings of a map, by number.
    pub async fn gatherings(&self, map: &str) -> Result<Vec<Gathering>, ClientError> {
        self.all(&LIST, &[&map]).await
    }

    /// One gathering.
    pub async fn gathering(&self, map: &str, gathering: i64) -> Result<Gathering, ClientError> {
        self.send(self.ask(&GET, &[&map, &gathering])?).await
    }

    /// Ends a gathering; its tracks wait for a decision.
    pub async fn stop_gathering(&self, map: &str, gathering: i64) -> Result<Gathering, ClientError> {
        self.send(self.ask(&STOP, &[&map, &gathering])?).await
    }

    /// Ends a gathering and deletes all tracks that nobody has accepted.
    pub async fn delete_gathering(&self, map: &str, gathering: i64) -> Result<(), ClientError> {
        self.done(self.ask(&DELETE, &[&map, &gathering])?).await
    }

    /// The tracks that wait for a decision.
    pub async fn tracks(&self, map: &str, gathering: i64) -> Result<Vec<TrackSummary>, ClientError> {
        let found: TrackList = self.send(self.ask(&TRACKS, &[&map, &gathering])?).await?;
        Ok(found.tracks)
    }

    /// Deletes a track. While the gathering lasts, no more views of that object are stored.
    pub async fn discard_track(&self, map: &str, gathering: i64, track: u32) -> Result<(), ClientError> {
        self.done(self.ask(&DISCARD, &[&map, &gathering, &track])?).await
    }

    /// The rectified picture of a view of a track, PNG.
    pub async fn track_icon(
        &self,
        map: &str,
        gathering: i64,
        track: u32,
        view: i64,
    ) -> Result<Vec<u8>, ClientError> {
        self.bytes(self.ask(&ICON, &[&map, &gathering, &track, &view])?).await
    }

    /// Creates landmarks from tracks, or adds views to the landmarks that they show; all or none.
    pub async fn accept_tracks(
        &self,
        map: &str,
        gathering: i64,
        request: &AcceptRequest,
    ) -> Result<AcceptanceBody, ClientError> {
        self.send(self.ask(&ACCEPT, &[&map, &gathering])?.json(request)).await
    }
}
