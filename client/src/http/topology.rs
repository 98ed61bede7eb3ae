//! Places and passages of a site, and routes.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{SiteTopologyBody, TopologyQuery};

operations! {
    TOPOLOGY: GET "/sites/{site}/topology" => site_topology,
}

impl MapClient {
    /// Places and passages of the maps of a site, and with both ends of the query a route with the
    /// landmarks to look for.
    pub async fn site_topology(
        &self,
        site: &str,
        query: &TopologyQuery,
    ) -> Result<SiteTopologyBody, ClientError> {
        self.send(self.ask_query(&TOPOLOGY, &[&site], query)?).await
    }
}
