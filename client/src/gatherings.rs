//! Gatherings: a robot collects views while it drives, a person decides which tracks become landmarks.

use crate::{
    ClientError, MapClient,
    http::reason,
    lessons::{Accepted, Candidate, Gathering, Pick},
};
use reqwest::Method;
use serde_json::json;

#[derive(serde::Deserialize)]
struct Candidates {
    candidates: Vec<Candidate>,
}

impl MapClient {
    /// Starts gathering with a robot: views of one landmark, or of unknown objects (and of known landmarks if
    /// `known`).
    pub async fn gather(
        &self,
        map: &str,
        robot: &str,
        landmark: Option<&str>,
        known: bool,
    ) -> Result<Gathering, ClientError> {
        let body = json!({ "robot": robot, "landmark": landmark, "known": known });
        self.send(self.request(Method::POST, &format!("/maps/{map}/gatherings")).json(&body)).await
    }

    /// Ends a gathering; its tracks wait for a decision.
    pub async fn stop_gathering(&self, map: &str, gathering: i64) -> Result<Gathering, ClientError> {
        self.send(self.request(Method::POST, &format!("/maps/{map}/gatherings/{gathering}/stop"))).await
    }

    /// All gatherings of a map.
    pub async fn gatherings(&self, map: &str) -> Result<Vec<Gathering>, ClientError> {
        self.all(&format!("/maps/{map}/gatherings")).await
    }

    /// The tracks that wait for a decision.
    pub async fn candidates(&self, map: &str, gathering: i64) -> Result<Vec<Candidate>, ClientError> {
        let path = format!("/maps/{map}/gatherings/{gathering}/candidates");
        let found: Candidates = self.send(self.request(Method::GET, &path)).await?;
        Ok(found.candidates)
    }

    /// The rectified picture of a view of a track, PNG.
    pub async fn candidate_picture(
        &self,
        map: &str,
        gathering: i64,
        candidate: u32,
        view: i64,
    ) -> Result<Vec<u8>, ClientError> {
        let path = format!("/maps/{map}/gatherings/{gathering}/candidates/{candidate}/views/{view}/icon");
        let response = self.checked(self.request(Method::GET, &path)).await?;
        let url = response.url().to_string();
        let bytes = response.bytes().await.map_err(|e| ClientError::Http { url, detail: reason(&e) })?;
        Ok(bytes.to_vec())
    }

    /// Turns tracks into landmarks and starts learning. All or nothing.
    pub async fn accept_candidates(
        &self,
        map: &str,
        gathering: i64,
        picks: &[Pick],
    ) -> Result<Accepted, ClientError> {
        let path = format!("/maps/{map}/gatherings/{gathering}/accept");
        self.send(self.request(Method::POST, &path).json(&json!({ "candidates": picks }))).await
    }

    /// Discards a track.
    pub async fn discard_candidate(
        &self,
        map: &str,
        gathering: i64,
        candidate: u32,
    ) -> Result<(), ClientError> {
        let path = format!("/maps/{map}/gatherings/{gathering}/candidates/{candidate}");
        self.checked(self.request(Method::DELETE, &path)).await.map(drop)
    }
}
