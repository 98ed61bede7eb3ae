//! Reference runs: recordings compared with a reference trajectory, and the modality statistics that they give.

use crate::{ClientError, MapClient};
use reqwest::Method;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// The recording of a robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordingStatus {
    /// Name of the map.
    pub map: String,
    /// Name of the robot.
    pub robot: String,
    /// Whether the recording is active.
    pub going: bool,
    /// Why it is not active any more.
    #[serde(default)]
    pub reason: Option<String>,
    /// Distance driven by odometry, metres.
    pub way_m: f64,
    /// Number of fixes by landmarks.
    pub landmarks: u64,
    /// Number of fixes by the laser.
    pub laser: u64,
}

/// Statistics of one modality over a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModalityStats {
    /// The modality: `odometry`, `laser` or `landmarks`.
    pub module: String,
    /// Mean error of its own position: metres along, metres to the left, radians.
    pub mean: [f64; 3],
    /// Standard deviations about the mean, same units.
    pub sigma: [f64; 3],
    /// Share of the distance with a recent fix, 0 to 1.
    pub availability: f64,
    /// Share of measurements off by more than three claimed standard deviations, 0 to 1.
    pub outliers: f64,
}

/// A recording that was compared with a reference trajectory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReferenceRun {
    /// Number of the run.
    pub id: i64,
    /// Name of the robot.
    pub robot: String,
    /// Distance along the reference trajectory, metres.
    pub way_m: f64,
    /// Number of pose cells with statistics.
    pub cells: u64,
    /// Statistics by modality.
    pub modules: Vec<ModalityStats>,
}

/// True poses of a robot by an independent measurement.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReferenceTrajectory {
    /// Time (ns of the robot's clock), x and y in metres, heading in radians, map frame; times rise.
    pub poses: Vec<(i64, f64, f64, f64)>,
    /// Standard deviation of the positions, metres; the server's default if absent.
    pub sigma_m: Option<f64>,
    /// Standard deviation of the headings, radians; the server's default if absent.
    pub sigma_rad: Option<f64>,
}

#[derive(Deserialize)]
struct Runs {
    runs: Vec<ReferenceRun>,
}

impl MapClient {
    /// Starts the recording of a robot.
    pub async fn start_recording(&self, robot: &str) -> Result<RecordingStatus, ClientError> {
        self.send(self.request(Method::POST, &format!("/robots/{robot}/run"))).await
    }

    /// The present recording of a robot.
    pub async fn recording(&self, robot: &str) -> Result<RecordingStatus, ClientError> {
        self.send(self.request(Method::GET, &format!("/robots/{robot}/run"))).await
    }

    /// Cancels the recording.
    pub async fn cancel_recording(&self, robot: &str) -> Result<(), ClientError> {
        self.checked(self.request(Method::DELETE, &format!("/robots/{robot}/run"))).await.map(drop)
    }

    /// Ends the recording and compares it with the robot's true trajectory; the map takes the statistics.
    pub async fn finish_recording(
        &self,
        robot: &str,
        path: &ReferenceTrajectory,
    ) -> Result<ReferenceRun, ClientError> {
        let body = json!({ "poses": path.poses, "sigma_m": path.sigma_m, "sigma_rad": path.sigma_rad });
        self.send(self.request(Method::POST, &format!("/robots/{robot}/run/reference")).json(&body)).await
    }

    /// The reference runs of a map.
    pub async fn reference_runs(&self, map: &str) -> Result<Vec<ReferenceRun>, ClientError> {
        let runs: Runs = self.send(self.request(Method::GET, &format!("/maps/{map}/runs"))).await?;
        Ok(runs.runs)
    }

    /// Deletes a reference run with its statistics.
    pub async fn delete_reference_run(&self, map: &str, run: i64) -> Result<(), ClientError> {
        self.checked(self.request(Method::DELETE, &format!("/maps/{map}/runs/{run}"))).await.map(drop)
    }

    /// The modality statistics of a map, as in the server's API documentation.
    pub async fn modalities(&self, map: &str) -> Result<Value, ClientError> {
        self.send(self.request(Method::GET, &format!("/maps/{map}/areas"))).await
    }

    /// Sets the fusion mode (`mode`) and the named areas (`areas`); absent fields stay.
    pub async fn set_modalities(&self, map: &str, change: &Value) -> Result<Value, ClientError> {
        self.send(self.request(Method::PUT, &format!("/maps/{map}/areas")).json(change)).await
    }
}
