//! Which modality is best where, and what is fused.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{AreaStatsBody, ModalityMapBody, ModalityMapPatch, ModalityQuery};

operations! {
    GET: GET "/maps/{map}/modalities" => modalities,
    SET: PUT "/maps/{map}/modalities" => set_modalities,
    AT: GET "/maps/{map}/modalities/at" => modalities_at,
}

impl MapClient {
    /// Which modality is best where, as reference runs have shown, and what is fused.
    pub async fn modalities(&self, map: &str) -> Result<ModalityMapBody, ClientError> {
        self.send(self.ask(&GET, &[&map])?).await
    }

    /// Sets what is fused, and the areas that have names; absent fields stay.
    pub async fn set_modalities(
        &self,
        map: &str,
        patch: &ModalityMapPatch,
    ) -> Result<ModalityMapBody, ClientError> {
        self.send(self.ask(&SET, &[&map])?.json(patch)).await
    }

    /// What is known where a robot would be.
    pub async fn modalities_at(
        &self,
        map: &str,
        query: &ModalityQuery,
    ) -> Result<AreaStatsBody, ClientError> {
        self.send(self.ask_query(&AT, &[&map], query)?).await
    }
}
