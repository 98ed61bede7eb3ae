//! The walls of a map.

use super::{
    map_client::{MapClient, Revised},
    operation::{operations, query_of},
};
use crate::ClientError;
use protos::api::{FileWalls, WallFileQuery, WallsBody};

operations! {
    SET: PUT "/maps/{map}/walls" => set_walls,
    GET: GET "/maps/{map}/walls" => walls,
    READ: POST "/maps/{map}/walls/read" => read_wall_file,
}

impl MapClient {
    /// Replaces the walls; returns those stored.
    pub async fn set_walls(&self, map: &str, walls: &WallsBody) -> Result<WallsBody, ClientError> {
        self.send(self.ask(&SET, &[&map])?.json(walls)).await
    }

    /// The walls, as stored, with their revision.
    pub async fn walls_revised(&self, map: &str) -> Result<Revised<WallsBody>, ClientError> {
        self.revised(self.ask(&GET, &[&map])?).await
    }

    /// The walls of a file, which are stored nowhere.
    pub async fn read_wall_file(
        &self,
        map: &str,
        file: Vec<u8>,
        query: &WallFileQuery,
    ) -> Result<FileWalls, ClientError> {
        self.send(self.ask_at(&READ, &[&map], &query_of(query))?.body(file)).await
    }

    /// The walls, as stored.
    pub async fn walls(&self, map: &str) -> Result<WallsBody, ClientError> {
        self.send(self.ask(&GET, &[&map])?).await
    }
}
