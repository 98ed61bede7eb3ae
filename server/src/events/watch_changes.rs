//! Tells what changes of maps, landmarks, robots and tokens: by what is published, so that the
//! writer does no more work.

use super::EventLog;
use crate::identity::TokenRegistry;
use engine::{
    live::{LiveEvent, LiveHub},
    snapshot::{MapChange, MapSnapshot, Snapshots},
    vitals::Pulse,
};
use protos::api::{LandmarkChange, ServerEventBody};
use std::{collections::BTreeMap, sync::Arc};
use tokio::sync::{broadcast::error::RecvError, watch};

/// Landmarks of one version that are named; more are counted.
const MAX_NAMED: usize = 100;

/// Maps as they were told last.
type PublishedVersions = BTreeMap<String, Arc<MapSnapshot>>;

/// Tells changes until the server stops.
pub(crate) async fn watch_changes(
    log: Arc<EventLog>,
    (snapshots, tokens, live): (Arc<Snapshots>, Arc<TokenRegistry>, Arc<LiveHub>),
    (pulse, mut stopping): (Pulse, watch::Receiver<bool>),
) {
    let (mut maps, mut robots, mut token_changes) = (snapshots.changes(), live.events(), tokens.changes());
    let mut told: PublishedVersions =
        snapshots.all().into_iter().map(|map| (map.name.clone(), map)).collect();
    loop {
        tokio::select! {
            _ = stopping.wait_for(|stop| *stop) => break,
            change = maps.recv() => match change {
                Ok(MapChange { map, .. }) => tell_map(&log, &snapshots, &mut told, &map),
                Err(RecvError::Lagged(_)) => tell_all(&log, &snapshots, &mut told),
                Err(RecvError::Closed) => break,
            },
            event = robots.recv() => match event.as_deref() {
                Ok(LiveEvent::Presence { robot, map, alive }) => log.tell(ServerEventBody::Presence {
                    map: (!map.is_empty()).then(|| map.clone()),
                    robot: robot.to_string(),
                    present: *alive,
                }),
                Err(RecvError::Closed) => break,
                // Of those that were missed, the list of robots has who is there.
                Ok(_) | Err(RecvError::Lagged(_)) => {}
            },
            changed = token_changes.changed() => match changed {
                Ok(()) => log.tell(ServerEventBody::TokensChanged),
                Err(_) => break,
            },
        }
    }
    pulse.end();
}

fn tell_all(log: &EventLog, snapshots: &Snapshots, told: &mut PublishedVersions) {
    let mut names: Vec<String> = told.keys().cloned().collect();
    names.extend(snapshots.all().iter().map(|map| map.name.clone()));
    names.sort();
    names.dedup();
    for name in names {
        tell_map(log, snapshots, told, &name);
    }
}

/// Tells what is new of a map since it was told last.
fn tell_map(log: &EventLog, snapshots: &Snapshots, told: &mut PublishedVersions, name: &str) {
    let Some(map) = snapshots.get(name) else {
        if told.remove(name).is_some() {
            log.tell(ServerEventBody::MapChanged { map: name.to_owned(), version: None });
        }
        return;
    };
    let before = told.insert(name.to_owned(), map.clone());
    if before.as_ref().is_some_and(|before| before.version == map.version) {
        // Derived data of the same version.
        return;
    }
    log.tell(ServerEventBody::MapChanged { map: name.to_owned(), version: Some(map.version) });
    let changes = landmark_changes(before.as_deref(), &map);
    if changes.len() > MAX_NAMED {
        let count = changes.len() as u64;
        return log.tell(ServerEventBody::LandmarksChanged { map: name.to_owned(), count });
    }
    for (landmark, change) in changes {
        log.tell(ServerEventBody::LandmarkChanged { map: name.to_owned(), landmark, change });
    }
}

/// The landmarks that are other than before, by their present names.
fn landmark_changes(before: Option<&MapSnapshot>, map: &MapSnapshot) -> Vec<(String, LandmarkChange)> {
    let digest = |map: &MapSnapshot, id| map.learnt.get(id).map(|learnt| learnt.digest);
    let mut changes = Vec::new();
    for (id, landmark) in &map.landmarks {
        let was = before.and_then(|before| Some((before.landmarks.get(id)?, digest(before, id))));
        let change = match was {
            None => LandmarkChange::Added,
            Some(was) if was == (landmark, digest(map, id)) => continue,
            Some(_) => LandmarkChange::Changed,
        };
        changes.push((landmark.name.clone(), change));
    }
    let gone = before.into_iter().flat_map(|before| &before.landmarks);
    let gone = gone.filter(|(id, _)| !map.landmarks.contains_key(id));
    changes.extend(gone.map(|(_, landmark)| (landmark.name.clone(), LandmarkChange::Removed)));
    changes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::events::Since;
    use engine::snapshot::LandmarkInfo;
    use vision::model::LandmarkId;

    fn map(version: u64, names: impl IntoIterator<Item = (u64, String)>) -> Arc<MapSnapshot> {
        let info = |name| LandmarkInfo { name, ..LandmarkInfo::default() };
        let landmarks = names.into_iter().map(|(id, name)| (LandmarkId(id), info(name))).collect();
        Arc::new(MapSnapshot { landmarks, ..MapSnapshot::empty("hall", version) })
    }

    #[test]
    fn each_landmark_that_changes_is_named_once_and_many_are_counted() {
        let (log, snapshots, mut told) =
            (EventLog::default(), Snapshots::default(), PublishedVersions::new());
        let mut after = 0;
        let mut told_of = |map: Option<Arc<MapSnapshot>>| {
            match map {
                Some(map) => snapshots.publish(map),
                None => snapshots.remove_map("hall"),
            }
            tell_map(&log, &snapshots, &mut told, "hall");
            let Since::Events(events) = log.since(after) else { panic!("forgotten") };
            after = log.newest();
            events.iter().map(|event| event.what.clone()).collect::<Vec<_>>()
        };
        let changed = |version| ServerEventBody::MapChanged { map: "hall".into(), version };
        let landmark = |landmark: &str, change| ServerEventBody::LandmarkChanged {
            map: "hall".into(),
            landmark: landmark.into(),
            change,
        };
        let first = || map(1, [(1, "door".to_owned()), (2, "sign".to_owned())]);
        assert_eq!(
            told_of(Some(first())),
            [
                changed(Some(1)),
                landmark("door", LandmarkChange::Added),
                landmark("sign", LandmarkChange::Added)
            ]
        );
        assert_eq!(told_of(Some(first())), [], "derived data");
        let second = map(2, [(2, "poster".to_owned())]);
        assert_eq!(
            told_of(Some(second)),
            [
                changed(Some(2)),
                landmark("poster", LandmarkChange::Changed),
                landmark("door", LandmarkChange::Removed)
            ]
        );
        let many = map(3, (2..104).map(|id| (id, format!("l{id}"))));
        let counted = ServerEventBody::LandmarksChanged { map: "hall".into(), count: 102 };
        assert_eq!(told_of(Some(many)), [changed(Some(3)), counted]);
        assert_eq!(told_of(None), [changed(None)]);
    }
}
