//! Recognition of one photograph.

use super::{form::Form, map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::{convert::geometry::intrinsics_wire, v1::Answer};
use serde_json::{Value, json};
use vision::frame::Intrinsics;

operations! {
    RECOGNISE: POST "/maps/{map}/recognise" => recognise,
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
        self.recognise_by(map, image, camera.map(|camera| json!(intrinsics_wire(camera)))).await
    }

    /// The same by a camera that was calibrated with pictures of this width and height, px: a
    /// photograph of another scale has scaled intrinsics, and one of other proportions is refused.
    pub async fn recognise_of_size(
        &self,
        map: &str,
        image: Vec<u8>,
        (camera, [width_px, height_px]): (&Intrinsics, [usize; 2]),
    ) -> Result<Answer, ClientError> {
        let mut intrinsics = json!(intrinsics_wire(camera));
        intrinsics["width_px"] = json!(width_px);
        intrinsics["height_px"] = json!(height_px);
        self.recognise_by(map, image, Some(intrinsics)).await
    }

    async fn recognise_by(
        &self,
        map: &str,
        image: Vec<u8>,
        intrinsics: Option<Value>,
    ) -> Result<Answer, ClientError> {
        let mut form = Form::with_image(&image);
        if let Some(intrinsics) = intrinsics {
            form = form.text("intrinsics", &intrinsics.to_string());
        }
        self.send(form.of(self.ask(&RECOGNISE, &[&map])?)).await
    }
}
