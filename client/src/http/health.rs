//! Health, readiness and version of the server.

use super::{
    map_client::{MapClient, whole},
    operation::operations,
};
use crate::ClientError;
use protos::api::{Health, Readiness, Servers, Version};

operations! {
    HEALTH: GET "/healthz" => health,
    READINESS: GET "/readyz" => readiness,
    VERSION: GET "/version" => version,
    METRICS: GET "/metrics" => metrics,
    SERVERS: GET "/servers" => servers,
}

impl MapClient {
    /// Whether the process answers.
    pub async fn health(&self) -> Result<Health, ClientError> {
        self.send(self.ask(&HEALTH, &[])?).await
    }

    /// Whether every part of the server runs and the database answers; an error with status 503
    /// otherwise. With a token it names what is wrong: the local one is looked for, since the
    /// server asks nobody for one here.
    pub async fn readiness(&self) -> Result<Readiness, ClientError> {
        if self.token().is_none() {
            // Whoever is refused is told what strangers are.
            self.token_in_use().await.ok();
        }
        self.send(self.ask(&READINESS, &[])?).await
    }

    /// Metrics, in the text format of Prometheus.
    pub async fn metrics(&self) -> Result<String, ClientError> {
        let text = whole(self.checked(self.ask(&METRICS, &[])?).await?).await?;
        Ok(String::from_utf8_lossy(&text).into_owned())
    }

    /// The servers that share a router, with their maps, and what more than one of them has.
    pub async fn servers(&self) -> Result<Servers, ClientError> {
        self.send(self.ask(&SERVERS, &[])?).await
    }

    /// Version of the server.
    pub async fn version(&self) -> Result<Version, ClientError> {
        self.send(self.ask(&VERSION, &[])?).await
    }
}
