//! Cameras of a robot: intrinsics, calibration, the last frame and its answer.

use super::{
    map_client::{MapClient, whole},
    operation::operations,
};
use crate::ClientError;
use protos::{
    api::{CalibrationReport, CalibrationRequest, Camera, Cameras},
    v1::Answer,
};
use reqwest::{Response, header::CONTENT_TYPE};

operations! {
    LIST: GET "/robots/{robot}/cameras" => cameras,
    CALIBRATE: POST "/robots/{robot}/cameras/{camera}/calibrate" => calibrate_camera,
    FRAME: GET "/robots/{robot}/cameras/{camera}/frame" => camera_frame,
    ANSWER: GET "/robots/{robot}/cameras/{camera}/answer" => camera_answer,
}

/// The last answered frame of a camera.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CameraFrame {
    /// Sequence number of the frame, as in its answer.
    pub seq: u64,
    /// `image/jpeg` or `image/png`.
    pub media_type: String,
    /// The encoded image.
    pub image: Vec<u8>,
}

impl MapClient {
    /// The cameras of a robot in whose frames landmarks of known size were recognised, by name.
    pub async fn cameras(&self, robot: &str) -> Result<Vec<Camera>, ClientError> {
        let found: Cameras = self.send(self.ask(&LIST, &[&robot])?).await?;
        Ok(found.cameras)
    }

    /// Calibrates a camera, from uploaded corners or from stored views of its own frames. The
    /// server's state does not change: a robot sends its intrinsics with its frames.
    pub async fn calibrate_camera(
        &self,
        robot: &str,
        camera: &str,
        request: &CalibrationRequest,
    ) -> Result<CalibrationReport, ClientError> {
        self.send(self.ask(&CALIBRATE, &[&robot, &camera])?.json(request)).await
    }

    /// The last answered frame of a camera.
    pub async fn camera_frame(&self, robot: &str, camera: &str) -> Result<CameraFrame, ClientError> {
        let response = self.checked(self.ask(&FRAME, &[&robot, &camera])?).await?;
        let header = |response: &Response, name: &str| {
            let value = response.headers().get(name).and_then(|v| v.to_str().ok());
            value.map(str::to_owned).unwrap_or_default()
        };
        let media_type = header(&response, CONTENT_TYPE.as_str());
        let seq = header(&response, "x-frame-seq").parse().map_err(|_e| ClientError::Unexpected {
            url: response.url().to_string(),
            detail: "no number in x-frame-seq".to_owned(),
        })?;
        Ok(CameraFrame { seq, media_type, image: whole(response).await? })
    }

    /// The answer to that frame.
    pub async fn camera_answer(&self, robot: &str, camera: &str) -> Result<Answer, ClientError> {
        self.send(self.ask(&ANSWER, &[&robot, &camera])?).await
    }
}
