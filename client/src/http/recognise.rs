//! Recognition of one photograph.

use super::{map_client::MapClient, operation::operations, views::image_part};
use crate::ClientError;
use protos::{convert::geometry::intrinsics_wire, v1::Answer};
use reqwest::multipart::Form;
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
        let mut form = Form::new().part("image", image_part(image));
        if let Some(camera) = camera {
            form = form.text("intrinsics", json!(intrinsics_wire(camera)).to_string());
        }
        self.send(self.ask(&RECOGNISE, &[&map])?.multipart(form)).await
    }
}
