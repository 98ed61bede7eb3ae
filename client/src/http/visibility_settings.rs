//! The visibility settings of a map: camera, and limits that define "visible".

use super::{
    map_client::{MapClient, Revised},
    operation::operations,
};
use crate::ClientError;
use protos::api::VisibilitySettingsBody;

operations! {
    GET: GET "/maps/{map}/visibility-settings" => visibility_settings,
    SET: PUT "/maps/{map}/visibility-settings" => set_visibility_settings,
}

impl MapClient {
    /// The visibility settings; every field is there.
    pub async fn visibility_settings(&self, map: &str) -> Result<VisibilitySettingsBody, ClientError> {
        self.send(self.ask(&GET, &[&map])?).await
    }

    /// The same with their revision.
    pub async fn visibility_settings_revised(
        &self,
        map: &str,
    ) -> Result<Revised<VisibilitySettingsBody>, ClientError> {
        self.revised(self.ask(&GET, &[&map])?).await
    }

    /// Replaces the visibility settings; absent fields take their defaults.
    pub async fn set_visibility_settings(
        &self,
        map: &str,
        settings: &VisibilitySettingsBody,
    ) -> Result<VisibilitySettingsBody, ClientError> {
        self.send(self.ask(&SET, &[&map])?.json(settings)).await
    }
}
