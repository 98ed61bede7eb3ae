//! A map as one file, out and in.

use super::{
    backups::FileDownload,
    map_client::MapClient,
    operation::{operations, query_of},
};
use crate::ClientError;
use protos::api::{BundleQuery, Map};
use reqwest::header::CONTENT_TYPE;
use std::time::Duration;

operations! {
    SAVE: GET "/maps/{map}/bundle" => save_map,
    LOAD: POST "/bundles" => load_map,
}

/// Longest time for a bundle.
const TIMEOUT: Duration = Duration::from_hours(1);

impl MapClient {
    /// The whole map as one file, a bundle.
    pub async fn save_map(&self, map: &str) -> Result<FileDownload, ClientError> {
        self.download(self.ask(&SAVE, &[&map])?.timeout(TIMEOUT)).await
    }

    /// Makes a new map of a bundle.
    pub async fn load_map(&self, bundle: Vec<u8>, query: &BundleQuery) -> Result<Map, ClientError> {
        let request = self.ask_at(&LOAD, &[], &query_of(query))?.header(CONTENT_TYPE, "application/zip");
        self.send(request.timeout(TIMEOUT).body(bundle)).await
    }
}
