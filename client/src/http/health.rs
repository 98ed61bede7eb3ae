//! Whether the server can do its work, and what runs there.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{Health, Readiness, Version};

operations! {
    HEALTH: GET "/healthz" => health,
    READINESS: GET "/readyz" => readiness,
    VERSION: GET "/version" => version,
}

impl MapClient {
    /// The process lives.
    pub async fn health(&self) -> Result<Health, ClientError> {
        self.send(self.ask(&HEALTH, &[])?).await
    }

    /// Every part of the server runs and the database answers; else refused with 503.
    pub async fn readiness(&self) -> Result<Readiness, ClientError> {
        self.send(self.ask(&READINESS, &[])?).await
    }

    /// What runs there.
    pub async fn version(&self) -> Result<Version, ClientError> {
        self.send(self.ask(&VERSION, &[])?).await
    }
}
