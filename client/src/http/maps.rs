//! Maps, their locations (site, building, floor), and map links.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{ListQuery, Map, MapPatch, NewCopy, NewMap, Page, TransformQuery, TransformResponse};

operations! {
    CREATE: POST "/maps" => create_map,
    LIST: GET "/maps" => maps,
    GET: GET "/maps/{map}" => map,
    LOCATE: PATCH "/maps/{map}" => locate_map,
    DELETE: DELETE "/maps/{map}" => delete_map,
    COPY: POST "/maps/{map}/copies" => copy_map,
    TRANSFORM: GET "/maps/{map}/transform" => transform,
}

impl MapClient {
    /// Creates an empty map.
    pub async fn create_map(&self, new: &NewMap) -> Result<Map, ClientError> {
        self.send(self.ask(&CREATE, &[])?.json(new)).await
    }

    /// All maps, by name.
    pub async fn maps(&self) -> Result<Vec<Map>, ClientError> {
        self.all(&LIST, &[]).await
    }

    /// A page of the maps that a query selects, with their number on all pages.
    pub async fn find_maps(&self, query: &ListQuery) -> Result<Page<Map>, ClientError> {
        self.send(self.ask_query(&LIST, &[], query)?).await
    }

    /// One map.
    pub async fn map(&self, map: &str) -> Result<Map, ClientError> {
        self.send(self.ask(&GET, &[&map])?).await
    }

    /// Sets the location of a map: site, building, floor, parent.
    pub async fn locate_map(&self, map: &str, patch: &MapPatch) -> Result<Map, ClientError> {
        self.send(self.ask(&LOCATE, &[&map])?.json(patch)).await
    }

    /// Gives a map another name.
    pub async fn rename_map(&self, map: &str, new: &str) -> Result<Map, ClientError> {
        self.locate_map(map, &MapPatch { name: Some(new.to_owned()), ..MapPatch::default() }).await
    }

    /// Deletes a map and all that is in it.
    pub async fn delete_map(&self, map: &str) -> Result<(), ClientError> {
        self.done(self.ask(&DELETE, &[&map])?).await
    }

    /// Makes a new map of all that a map has. Refused with `exists`.
    pub async fn copy_map(&self, map: &str, name: &str) -> Result<Map, ClientError> {
        self.send(self.ask(&COPY, &[&map])?.json(&NewCopy { name: name.to_owned() })).await
    }

    /// The transform from a map to another one, and a pose converted by it.
    pub async fn transform(
        &self,
        map: &str,
        query: &TransformQuery,
    ) -> Result<TransformResponse, ClientError> {
        self.send(self.ask_query(&TRANSFORM, &[&map], query)?).await
    }
}
