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
    /// Begins to gather views with a robot: of one landmark, or of whatever is new (and of known landmarks, too).
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

    /// Ends a gathering; what was gathered waits for a decision.
    pub async fn stop_gathering(&self, map: &str, gathering: i64) -> Result<Gathering, ClientError> {
        self.send(self.request(Method::POST, &format!("/maps/{map}/gatherings/{gathering}/stop"))).await
    }

    /// All gatherings of a map.
    pub async fn gatherings(&self, map: &str) -> Result<Vec<Gathering>, ClientError> {
        self.all(&format!("/maps/{map}/gatherings")).await
    }

    /// What waits for a decision.
    pub async fn candidates(&self, map: &str, gathering: i64) -> Result<Vec<Candidate>, ClientError> {
        let path = format!("/maps/{map}/gatherings/{gathering}/candidates");
        let found: Candidates = self.send(self.request(Method::GET, &path)).await?;
        Ok(found.candidates)
    }

    /// The rectified picture of a view of a candidate, PNG.
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

    /// Makes landmarks of candidates and begins to learn them. All or nothing.
    pub async fn accept_candidates(
        &self,
        map: &str,
        gathering: i64,
        picks: &[Pick],
    ) -> Result<Accepted, ClientError> {
        let path = format!("/maps/{map}/gatherings/{gathering}/accept");
        self.send(self.request(Method::POST, &path).json(&json!({ "candidates": picks }))).await
    }

    /// Throws a candidate away.
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
