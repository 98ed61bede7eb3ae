//! Where a robot is, without its history.

use super::{form::Form, map_client::MapClient, operation::operations};
use crate::ClientError;
use nalgebra::Isometry3;
use protos::{
    api::{LocaliseResult, ScanBody},
    convert::geometry::{intrinsics_wire, pose3_wire},
};
use serde_json::json;
use vision::frame::Intrinsics;

operations! {
    LOCALISE: POST "/maps/{map}/localise" => localise,
}

/// What a robot senses at one place: a picture, a scan, or both.
#[derive(Debug, Clone, Default)]
pub struct Sensed {
    picture: Option<(Vec<u8>, Intrinsics, Isometry3<f64>)>,
    scan: Option<ScanBody>,
}

impl Sensed {
    /// With a picture, JPEG or PNG, its camera, and where that is on the robot.
    #[must_use]
    pub fn with_picture(
        self,
        image: Vec<u8>,
        camera: &Intrinsics,
        robot_from_camera: &Isometry3<f64>,
    ) -> Self {
        Self { picture: Some((image, *camera, *robot_from_camera)), ..self }
    }

    /// With a laser scan.
    #[must_use]
    pub fn with_scan(self, scan: ScanBody) -> Self {
        Self { scan: Some(scan), ..self }
    }
}

impl MapClient {
    /// Finds where a robot is by what it senses at one place, without knowing anything of it
    /// before. "No match" is an answer.
    pub async fn localise(&self, map: &str, sensed: &Sensed) -> Result<LocaliseResult, ClientError> {
        let mut form = match &sensed.picture {
            Some((image, camera, mounting)) => Form::with_image(image)
                .text("intrinsics", &json!(intrinsics_wire(camera)).to_string())
                .text("mounting", &json!(pose3_wire(mounting)).to_string()),
            None => Form::new(),
        };
        if let Some(scan) = &sensed.scan {
            form = form.text("scan", &json!(scan).to_string());
        }
        self.send(form.of(self.ask(&LOCALISE, &[&map])?)).await
    }
}
