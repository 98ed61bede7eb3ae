//! Recognition of one photograph.

use super::{form::Form, map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::{convert::geometry::intrinsics_wire, v1::Answer};
use serde_json::json;
use vision::{frame::Intrinsics, params::preset::Preset};

operations! {
    RECOGNISE: POST "/maps/{map}/recognise" => recognise,
}

/// What is known of a photograph, and how it is recognised.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecogniseOptions {
    /// Without it there is no pose.
    pub camera: Option<Intrinsics>,
    /// Width and height of the pictures that the camera was calibrated with, px: a photograph of
    /// another scale has scaled intrinsics, and one of other proportions is refused.
    pub camera_size_px: Option<[usize; 2]>,
    /// Another detector and decision than the map's, for this photograph.
    pub preset: Option<Preset>,
}

impl MapClient {
    /// Recognises the landmarks of one photograph, JPEG or PNG. Without intrinsics there is no
    /// pose. Those of a photograph of another size are refused where the principal point shows it.
    pub async fn recognise(
        &self,
        map: &str,
        image: Vec<u8>,
        camera: Option<&Intrinsics>,
    ) -> Result<Answer, ClientError> {
        let options = RecogniseOptions { camera: camera.copied(), ..RecogniseOptions::default() };
        self.recognise_with(map, image, &options).await
    }

    /// The same with more known of the photograph, or by another pipeline than the map's.
    pub async fn recognise_with(
        &self,
        map: &str,
        image: Vec<u8>,
        options: &RecogniseOptions,
    ) -> Result<Answer, ClientError> {
        let mut form = Form::with_image(&image);
        if let Some(camera) = &options.camera {
            let mut intrinsics = json!(intrinsics_wire(camera));
            if let Some([width_px, height_px]) = options.camera_size_px {
                intrinsics["width_px"] = json!(width_px);
                intrinsics["height_px"] = json!(height_px);
            }
            form = form.text("intrinsics", &intrinsics.to_string());
        }
        if let Some(preset) = options.preset {
            form = form.text("preset", preset.word());
        }
        self.send(form.of(self.ask(&RECOGNISE, &[&map])?)).await
    }
}
