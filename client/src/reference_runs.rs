//! Runs whose path is known, and what they show: which modality to trust where.

use crate::{ClientError, MapClient};
use reqwest::Method;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// A run as it is recorded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordingStatus {
    /// The map.
    pub map: String,
    /// Whose run.
    pub robot: String,
    /// It goes on.
    pub going: bool,
    /// Why it goes on no longer.
    #[serde(default)]
    pub reason: Option<String>,
    /// Way driven by odometry, metres.
    pub way_m: f64,
    /// Fixes by landmarks.
    pub landmarks: u64,
    /// Fixes by the laser.
    pub laser: u64,
}

/// What a run showed of one module.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModalityStats {
    /// `odometry`, `laser` or `landmarks`.
    pub module: String,
    /// Mean error of its own position: metres along, metres to the left, radians.
    pub mean: [f64; 3],
    /// Standard deviations about that.
    pub sigma: [f64; 3],
    /// Share of the way on which it knew something lately.
    pub availability: f64,
    /// Share of measurements off by more than three standard deviations.
    pub outliers: f64,
}

/// A run that was learnt from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReferenceRun {
    /// Its number.
    pub id: i64,
    /// Whose.
    pub robot: String,
    /// Way of which the path was known, metres.
    pub way_m: f64,
    /// Square metres by heading that it tells of.
    pub cells: u64,
    /// What it showed.
    pub modules: Vec<ModalityStats>,
}

/// Where a robot really was.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReferenceTrajectory {
    /// Time (ns of the robot's clock), x and y in metres on the map, heading in radians; times rise.
    pub poses: Vec<(i64, f64, f64, f64)>,
    /// Standard deviation of its positions, metres; the server's usual one if absent.
    pub sigma_m: Option<f64>,
    /// Of its headings, radians.
    pub sigma_rad: Option<f64>,
}

#[derive(Deserialize)]
struct Runs {
    runs: Vec<ReferenceRun>,
}

impl MapClient {
    /// Begins to record a run of a robot.
    pub async fn start_recording(&self, robot: &str) -> Result<RecordingStatus, ClientError> {
        self.send(self.request(Method::POST, &format!("/robots/{robot}/run"))).await
    }

    /// What was recorded so far.
    pub async fn recording(&self, robot: &str) -> Result<RecordingStatus, ClientError> {
        self.send(self.request(Method::GET, &format!("/robots/{robot}/run"))).await
    }

    /// Gives the recording up.
    pub async fn cancel_recording(&self, robot: &str) -> Result<(), ClientError> {
        self.checked(self.request(Method::DELETE, &format!("/robots/{robot}/run"))).await.map(drop)
    }

    /// Ends the recording by telling where the robot really was; the map learns from it.
    pub async fn finish_recording(
        &self,
        robot: &str,
        path: &ReferenceTrajectory,
    ) -> Result<ReferenceRun, ClientError> {
        let body = json!({ "poses": path.poses, "sigma_m": path.sigma_m, "sigma_rad": path.sigma_rad });
        self.send(self.request(Method::POST, &format!("/robots/{robot}/run/reference")).json(&body)).await
    }

    /// The runs that a map has learnt from.
    pub async fn reference_runs(&self, map: &str) -> Result<Vec<ReferenceRun>, ClientError> {
        let runs: Runs = self.send(self.request(Method::GET, &format!("/maps/{map}/runs"))).await?;
        Ok(runs.runs)
    }

    /// Forgets a run and what it showed.
    pub async fn delete_reference_run(&self, map: &str, run: i64) -> Result<(), ClientError> {
        self.checked(self.request(Method::DELETE, &format!("/maps/{map}/runs/{run}"))).await.map(drop)
    }

    /// Which modality is best where, as the server's documentation has it.
    pub async fn modalities(&self, map: &str) -> Result<Value, ClientError> {
        self.send(self.request(Method::GET, &format!("/maps/{map}/areas"))).await
    }

    /// Sets what is fused (`mode`) and the areas that have names (`areas`); what is not named stays.
    pub async fn set_modalities(&self, map: &str, change: &Value) -> Result<Value, ClientError> {
        self.send(self.request(Method::PUT, &format!("/maps/{map}/areas")).json(change)).await
    }
}
