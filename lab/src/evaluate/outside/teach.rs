//! Teaches the landmarks of a world to a server of its own, as a person would: one frontal picture
//! each, with size and place. In: a world. Out: the version of the map that the server recognises
//! with.

use super::world::World;
use anyhow::Context as _;
use cli::{scratch, screen};
use client::{
    LandmarkRegion, MapClient,
    api::{Job, JobState, NewMap},
};
use engine::snapshot::MapSnapshot;
use server::{RunningServer, Server};
use std::{sync::Arc, time::Duration};
use vision::params::preset::Preset;

/// Longest wait for a lesson.
const LESSON_TIMEOUT: Duration = Duration::from_hours(2);

/// A private server with a map for each world.
pub(super) struct Teacher {
    runtime: tokio::runtime::Runtime,
    server: RunningServer,
    maps: MapClient,
    _folder: scratch::Folder,
}

impl Teacher {
    pub(super) fn start(preset: Preset) -> anyhow::Result<Self> {
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
        let folder = scratch::Folder::new("outside")?;
        let server = runtime.block_on(Server::start(scratch::private_server(folder.path(), preset)?))?;
        let maps = MapClient::new(&format!("http://{}", server.http_addr))?;
        Ok(Self { runtime, server, maps, _folder: folder })
    }

    /// The landmarks of `world` as the map number `index`.
    pub(super) fn teach(&self, world: &World, index: usize) -> anyhow::Result<Arc<MapSnapshot>> {
        let map = format!("world-{index}");
        self.runtime.block_on(self.lesson(world, &map))?;
        self.server.snapshots.get(&map).with_context(|| format!("the server has no map {map}"))
    }

    async fn lesson(&self, world: &World, map: &str) -> anyhow::Result<()> {
        let maps = &self.maps;
        maps.create_map(&NewMap::new(map)).await?;
        let bar = screen::progress(world.truth.teach.len(), "teaching");
        for (path, landmark) in &world.truth.teach {
            let known = world.landmarks.get(landmark).map(super::world::LandmarkTruth::size_and_place);
            let (size, place) = known.unzip();
            if maps.landmark(map, landmark).await.is_err() {
                maps.add_landmark(map, landmark, size, place).await?;
            }
            let image = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
            maps.upload_view(map, landmark, image, LandmarkRegion::WholeImage).await?;
            bar.inc(1);
        }
        bar.finish_and_clear();
        let job = maps.learn(map, None, None).await?;
        let bar = screen::progress(1000, "learning");
        let job = maps
            .wait_for_job(job, LESSON_TIMEOUT, |job: &Job| bar.set_position((job.progress * 1000.0) as u64))
            .await?;
        bar.finish_and_clear();
        anyhow::ensure!(job.state == JobState::Done, "learning ended as {:?}: {}", job.state, job.message);
        Ok(())
    }

    pub(super) fn stop(self) {
        self.runtime.block_on(self.server.stop());
    }
}
