//! Recognition of one photograph.

use super::{form::Form, map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::{convert::geometry::intrinsics_wire, v1::Answer};
use serde_json::json;
use vision::frame::Intrinsics;

operations! {
    RECOGNISE: POST "/maps/{map}/recognise" => recognise,
}

impl MapClient {
    /// Recognises the landmarks of one photograph, JPEG or PNG. Without intrinsics there is no pose.
    pub async fn recognise(
        &self,
        map: &str,
        image: Vec<u8>,
        camera: Option<&Intrinsics>,
    ) -> Result<Answer, ClientError> {
        let mut form = Form::with_image(&image);
        if let Some(camera) = camera {
            form = form.text("intrinsics", &json!(intrinsics_wire(camera)).to_string());
        }
        self.send(form.of(self.ask(&RECOGNISE, &[&map])?)).await
    }
}
