//! Writes what a fleet sends into a file until it is told to end. In: messages of the SDK's
//! listener, walls and landmarks over HTTP. Out: an MCAP file, and counts.

use super::{PROGRAM, new_file};
use crate::screen;
use client::{
    FleetListener, ListenedMessage, MapClient,
    protos::{Key, Name},
};
use recordings::{Body, DriveWriter, MapContent, Recorded, write::Written};
use serde::Serialize;
use std::{
    collections::{BTreeMap, BTreeSet},
    fs::File,
    io::BufWriter,
    path::{Path, PathBuf},
    time::Duration,
};
use tokio::time::Instant;

/// Longest wait for the server's zenoh.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// A chunk is ended this often, whatever comes.
const FLUSH_EVERY: Duration = Duration::from_secs(1);
/// A map that changes is asked for no more often than this.
const MAP_EVERY: Duration = Duration::from_secs(2);

/// What is recorded, where to.
#[derive(Debug, Clone)]
pub(crate) struct RecorderOptions {
    /// The file; it must not exist.
    pub(crate) file: PathBuf,
    /// The HTTP interface.
    pub(crate) server: MapClient,
    /// Endpoint of zenoh.
    pub(crate) zenoh: String,
    pub(crate) fleet: Name,
    /// The robots; all if empty.
    pub(crate) robots: Vec<Name>,
    /// Maps that are written from the beginning, besides those of the robots.
    pub(crate) maps: Vec<String>,
}

/// Counts of a recording.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct RecordReport {
    /// Messages in the file.
    #[serde(flatten)]
    pub(crate) written: Written,
    /// Messages that came faster than the file took them.
    pub(crate) dropped: u64,
    /// Messages that are not what their key promises.
    pub(crate) malformed: u64,
    /// Maps whose walls and landmarks are in it.
    pub(crate) maps: BTreeSet<String>,
    /// How long it took.
    pub(crate) seconds: f64,
}

impl RecordReport {
    /// For a person.
    pub(crate) fn sentence(&self, file: &Path) -> String {
        let Written { messages, bytes, .. } = self.written;
        let lost = match self.dropped + self.malformed {
            0 => String::new(),
            _ => format!(" {} dropped, {} malformed.", self.dropped, self.malformed),
        };
        format!(
            "{}: {} in {:.0} s, {:.1} MB.{lost}",
            file.display(),
            screen::counted(messages, "message"),
            self.seconds,
            bytes as f64 / 1e6
        )
    }
}

/// A recording that has begun.
pub(crate) struct Recorder {
    listener: FleetListener,
    writer: DriveWriter<BufWriter<File>>,
    maps: MapClient,
    /// Maps in the file, and when they were asked for last.
    written_maps: BTreeMap<String, Instant>,
    /// Maps that have changed since.
    changed_maps: BTreeSet<String>,
    malformed: u64,
}

impl Recorder {
    /// Connects, makes the file, and writes the maps of the robots.
    pub(crate) async fn start(options: &RecorderOptions) -> anyhow::Result<Self> {
        let maps = options.server.clone();
        let robots = maps.robots().await?;
        let is_wanted =
            |name: &str| options.robots.is_empty() || options.robots.iter().any(|r| r.as_str() == name);
        let of_robots = robots.into_iter().filter(|r| is_wanted(&r.name)).map(|r| r.map);
        let changed_maps = of_robots.chain(options.maps.iter().cloned()).collect();
        let listener =
            FleetListener::connect(&options.zenoh, &options.fleet, &options.robots, CONNECT_TIMEOUT).await?;
        let file = new_file(&options.file)?;
        let writer = DriveWriter::create(BufWriter::new(file), &options.fleet, PROGRAM)?;
        let mut recorder =
            Self { listener, writer, maps, written_maps: BTreeMap::new(), changed_maps, malformed: 0 };
        recorder.write_changed_maps().await?;
        Ok(recorder)
    }

    /// Records until `end` is ready, and ends the file.
    pub(crate) async fn run(mut self, end: impl Future<Output = ()>) -> anyhow::Result<RecordReport> {
        let began = Instant::now();
        let mut end = std::pin::pin!(end);
        let mut flush = tokio::time::interval(FLUSH_EVERY);
        loop {
            tokio::select! {
                () = &mut end => break,
                message = self.listener.next() => match message {
                    Some(message) => self.write(message)?,
                    None => break,
                },
                _ = flush.tick() => {
                    self.write_changed_maps().await?;
                    tokio::task::block_in_place(|| self.writer.flush())?;
                }
            }
        }
        let dropped = self.listener.dropped();
        self.listener.close().await?;
        Ok(RecordReport {
            written: self.writer.finish()?,
            dropped,
            malformed: self.malformed,
            maps: self.written_maps.into_keys().collect(),
            seconds: began.elapsed().as_secs_f64(),
        })
    }

    fn write(&mut self, message: ListenedMessage) -> anyhow::Result<()> {
        let ListenedMessage { key, bytes, received_ns } = message;
        let Ok(Some(body)) = Body::decode(&key, &bytes) else {
            self.malformed += 1;
            return Ok(());
        };
        if let Key::MapChanged(map) = &key {
            if !self.written_maps.contains_key(map.as_str()) {
                return Ok(());
            }
            self.changed_maps.insert(map.to_string());
        }
        let recorded = Recorded { log_time_ns: received_ns.unsigned_abs(), key, body };
        Ok(tokio::task::block_in_place(|| self.writer.write(recorded))?)
    }

    /// Asks for maps that have changed, and writes them. One that is gone stays as it was.
    async fn write_changed_maps(&mut self) -> anyhow::Result<()> {
        let is_due = |map: &&String| self.written_maps.get(*map).is_none_or(|at| at.elapsed() >= MAP_EVERY);
        let due: Vec<String> = self.changed_maps.iter().filter(is_due).cloned().collect();
        for map in due {
            self.changed_maps.remove(&map);
            self.written_maps.insert(map.clone(), Instant::now());
            let asked = async {
                let version = self.maps.map(&map).await?.version;
                anyhow::Ok((version, self.maps.walls(&map).await?, self.maps.landmarks(&map).await?))
            };
            let (version, walls, landmarks) = match asked.await {
                Ok(content) => content,
                Err(error) => {
                    screen::complain(&format!("Map {map} is not in the recording: {error:#}"));
                    continue;
                }
            };
            let content = MapContent { map: &map, version, walls: &walls, landmarks: &landmarks };
            self.writer.write_map(&content, now_ns())?;
        }
        Ok(())
    }
}

fn now_ns() -> u64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or(0, |since| u64::try_from(since.as_nanos()).unwrap_or(u64::MAX))
}
