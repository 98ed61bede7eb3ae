//! Visibility areas of a map's landmarks. An area of an earlier snapshot is taken over where
//! neither the camera, the landmark's place nor an obstacle within its reach has changed; so is a
//! stored one whose inputs have the same digest.

use crate::store::{StoreError, visibility_areas::StoredArea};
use engine::snapshot::MapSnapshot;
use map::{
    place::LandmarkPlace,
    visibility::{Obstacle, VisibilityMap, VisibilitySettings, inputs, visibility, within_reach},
};
use sha2::{Digest as _, Sha256};
use std::{collections::BTreeMap, sync::Arc};
use vision::model::LandmarkId;

pub(super) type Areas = BTreeMap<LandmarkId, Arc<VisibilityMap>>;

/// A landmark whose area is neither that of the version nor that of the one before.
#[derive(Debug)]
pub(super) struct Missing {
    landmark: LandmarkId,
    place: LandmarkPlace,
    /// The obstacles within its reach.
    near: Vec<Obstacle>,
    inputs: [u8; 32],
}

impl Missing {
    /// What a stored area must be of.
    pub(super) fn wanted(&self) -> (LandmarkId, [u8; 32]) {
        (self.landmark, self.inputs)
    }
}

/// The areas that `map` has or takes over from the version before, and what is missing.
pub(super) fn known(map: &MapSnapshot, before: Option<&MapSnapshot>) -> (Areas, Vec<Missing>) {
    let is_missing = |id: &LandmarkId| !map.visibility.contains_key(id);
    let places: Vec<_> = map
        .landmarks
        .iter()
        .filter(|(id, _)| is_missing(id))
        .filter_map(|(id, l)| Some((*id, l.place?)))
        .collect();
    let obstacles: Vec<Obstacle> = map.walls.iter().map(Obstacle::from).collect();
    let mut areas = map.visibility.clone();
    let missing = taken_over(&mut areas, &places, &obstacles, (&map.visibility_settings, before));
    (areas, missing)
}

/// Adds the areas of places that have not changed; gives the others.
fn taken_over(
    areas: &mut Areas,
    places: &[(LandmarkId, LandmarkPlace)],
    obstacles: &[Obstacle],
    (settings, before): (&VisibilitySettings, Option<&MapSnapshot>),
) -> Vec<Missing> {
    let before = before.filter(|before| before.visibility_settings == *settings);
    let mut missing = Vec::new();
    for (id, place) in places {
        let near = within_reach(place, obstacles, &settings.viewer, &settings.seen);
        let unchanged = before.and_then(|before| {
            let area = before.visibility.get(id)?;
            let same = before.landmarks.get(id)?.place.as_ref() == Some(place) && near == area.obstacles();
            same.then(|| area.clone())
        });
        if let Some(area) = unchanged {
            areas.insert(*id, area);
        } else {
            let inputs = Sha256::digest(inputs(place, &near, settings)).into();
            missing.push(Missing { landmark: *id, place: *place, near, inputs });
        }
    }
    missing
}

/// Adds the missing areas: those that are stored, and new ones for the others, which it gives as
/// they are to be stored.
pub(super) fn complete(
    areas: &mut Areas,
    missing: Vec<Missing>,
    stored: Result<Vec<StoredArea>, StoreError>,
    settings: &VisibilitySettings,
) -> Vec<StoredArea> {
    let stored = stored.unwrap_or_else(|error| {
        let error = &error as &dyn std::error::Error;
        tracing::warn!(error, follows = "visibility areas are computed again", "visibility_areas_not_read");
        Vec::new()
    });
    let stored: BTreeMap<_, _> = stored.into_iter().map(|s| ((s.landmark, s.inputs), s.area)).collect();
    let mut computed = Vec::new();
    for Missing { landmark, place, near, inputs } in missing {
        let bytes = stored.get(&(landmark, inputs));
        let read = bytes.map(|bytes| VisibilityMap::from_bytes(bytes, &place, near.clone(), settings));
        let area = match read {
            Some(Ok(area)) => Ok(area),
            // Damage, or none stored.
            Some(Err(_)) | None => visibility(&place, &near, &settings.viewer, &settings.seen)
                .inspect(|area| computed.push(StoredArea { landmark, inputs, area: area.to_bytes() })),
        };
        match area {
            Ok(area) => {
                areas.insert(landmark, Arc::new(area));
            }
            Err(error) => tracing::error!(%error, landmark = landmark.0, "visibility_area_failed"),
        }
    }
    computed
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::snapshot::LandmarkInfo;
    use map::place::PlaceSigmas;
    use nalgebra::{Point2, Vector3};
    use vision::pose::LandmarkSize;

    #[test]
    fn only_what_changed_is_made_anew() {
        let size = LandmarkSize { width_m: 0.6, height_m: 0.8 };
        let place =
            |x| LandmarkPlace::by_hand(Vector3::new(x, 0.0, 1.5), 0.0, size, PlaceSigmas::default()).unwrap();
        let places = [(LandmarkId(1), place(0.0)), (LandmarkId(2), place(50.0))];
        let wall = |x: f64| Obstacle { a: Point2::new(x, -1.0), b: Point2::new(x, 1.0), height_m: None };
        let usual = VisibilitySettings::default();
        let all = |places: &[_], obstacles: &[_], settings: &_, before: Option<&_>| {
            let mut areas = Areas::new();
            let missing = taken_over(&mut areas, places, obstacles, (settings, before));
            complete(&mut areas, missing, Ok(Vec::new()), settings);
            areas
        };
        let first = all(&places, &[wall(2.0), wall(53.0)], &usual, None);
        let info = |place| LandmarkInfo {
            name: String::new(),
            size: Some(size),
            place: Some(place),
            ..LandmarkInfo::default()
        };
        let snapshot = MapSnapshot {
            landmarks: places.iter().map(|(id, place)| (*id, info(*place))).collect(),
            visibility: first.clone(),
            ..MapSnapshot::empty("hall", 1)
        };
        let again = all(&places, &[wall(2.0), wall(52.5)], &usual, Some(&snapshot));
        assert!(Arc::ptr_eq(&first[&LandmarkId(1)], &again[&LandmarkId(1)]), "nothing near it changed");
        assert!(again[&LandmarkId(2)].area_m2() < first[&LandmarkId(2)].area_m2());
        let mut other = usual.clone();
        other.viewer.focal_px *= 2.0;
        let wide = all(&places, &[wall(2.0), wall(53.0)], &other, Some(&snapshot));
        assert!(wide[&LandmarkId(1)].reach_m() > 1.9 * first[&LandmarkId(1)].reach_m(), "another camera");
        let moved = [(LandmarkId(1), place(0.1)), places[1]];
        let again = all(&moved, &[wall(2.0), wall(53.0)], &usual, Some(&snapshot));
        assert!(!Arc::ptr_eq(&first[&LandmarkId(1)], &again[&LandmarkId(1)]));
        assert!(Arc::ptr_eq(&first[&LandmarkId(2)], &again[&LandmarkId(2)]));
    }
}
