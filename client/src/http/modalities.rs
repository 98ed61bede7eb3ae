//! Modality statistics and fusion mode of a map.

use super::{
    map_client::{MapClient, Revised},
    operation::operations,
};
use crate::ClientError;
use protos::api::{AreaStatsBody, ModalityMapBody, ModalityMapPatch, ModalityQuery};

operations! {
    GET: GET "/maps/{map}/modalities" => modalities,
    SET: PUT "/maps/{map}/modalities" => set_modalities,
    AT: GET "/maps/{map}/modalities/at" => modalities_at,
}

impl MapClient {
    /// Modality statistics by pose cell from reference runs, and the fusion mode.
    pub async fn modalities(&self, map: &str) -> Result<ModalityMapBody, ClientError> {
        self.send(self.ask(&GET, &[&map])?).await
    }

    /// The same with the revision of the fusion mode and the named areas.
    pub async fn modalities_revised(&self, map: &str) -> Result<Revised<ModalityMapBody>, ClientError> {
        self.revised(self.ask(&GET, &[&map])?).await
    }

    /// Sets the fusion mode and the named areas; absent fields do not change.
    pub async fn set_modalities(
        &self,
        map: &str,
        patch: &ModalityMapPatch,
    ) -> Result<ModalityMapBody, ClientError> {
        self.send(self.ask(&SET, &[&map])?.json(patch)).await
    }

    /// Modality statistics at a pose.
    pub async fn modalities_at(
        &self,
        map: &str,
        query: &ModalityQuery,
    ) -> Result<AreaStatsBody, ClientError> {
        self.send(self.ask_query(&AT, &[&map], query)?).await
    }
}
