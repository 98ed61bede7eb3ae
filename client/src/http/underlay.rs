//! The picture that is shown under a map.

use super::{
    form::Form,
    map_client::{MapClient, Revised},
    operation::operations,
};
use crate::ClientError;
use protos::api::{Underlay, UnderlayPlace};

operations! {
    SET: PUT "/maps/{map}/underlay" => set_underlay,
    GET: GET "/maps/{map}/underlay" => underlay,
    IMAGE: GET "/maps/{map}/underlay/image" => underlay_image,
    DELETE: DELETE "/maps/{map}/underlay" => delete_underlay,
}

impl MapClient {
    /// Replaces the picture under a map: JPEG or PNG.
    pub async fn set_underlay(
        &self,
        map: &str,
        image: Vec<u8>,
        place: &UnderlayPlace,
    ) -> Result<Underlay, ClientError> {
        let UnderlayPlace { metres_per_pixel, x_m, y_m, theta_rad } = place;
        let mut form = Form::with_image(&image);
        for (name, value) in
            [("metres_per_pixel", metres_per_pixel), ("x_m", x_m), ("y_m", y_m), ("theta_rad", theta_rad)]
        {
            form = form.text(name, &value.to_string());
        }
        self.send(form.of(self.ask(&SET, &[&map])?)).await
    }

    /// Where the picture under a map lies.
    pub async fn underlay(&self, map: &str) -> Result<Underlay, ClientError> {
        self.send(self.ask(&GET, &[&map])?).await
    }

    /// The same with its revision.
    pub async fn underlay_revised(&self, map: &str) -> Result<Revised<Underlay>, ClientError> {
        self.revised(self.ask(&GET, &[&map])?).await
    }

    /// The picture under a map, as it was uploaded.
    pub async fn underlay_image(&self, map: &str) -> Result<Vec<u8>, ClientError> {
        self.bytes(self.ask(&IMAGE, &[&map])?).await
    }

    /// Deletes the picture under a map.
    pub async fn delete_underlay(&self, map: &str) -> Result<(), ClientError> {
        self.done(self.ask(&DELETE, &[&map])?).await
    }
}
