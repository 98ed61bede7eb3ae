//! Visibility areas of a map's landmarks. An area of an earlier snapshot is taken over where neither the camera, the landmark's
//! place nor an obstacle within its reach has changed.

use engine::snapshot::MapSnapshot;
use map::{
    place::LandmarkPlace,
    visibility::{Obstacle, VisibilityMap, VisibilitySettings, visibility, within_reach},
};
use std::{collections::BTreeMap, sync::Arc};
use vision::model::LandmarkId;

type Areas = BTreeMap<LandmarkId, Arc<VisibilityMap>>;

/// The visibility areas of all placed landmarks of `map`: those that it has, and new ones for the others.
pub(super) fn areas(map: &MapSnapshot, before: Option<&MapSnapshot>) -> Areas {
    let is_missing = |id: &LandmarkId| !map.visibility.contains_key(id);
    let places: Vec<_> = map
        .landmarks
        .iter()
        .filter(|(id, _)| is_missing(id))
        .filter_map(|(id, l)| Some((*id, l.place?)))
        .collect();
    let obstacles: Vec<Obstacle> = map.walls.iter().map(Obstacle::from).collect();
    let mut areas = map.visibility.clone();
    areas.extend(all(&places, &obstacles, &map.visibility_settings, before));
    areas
}

fn all(
    places: &[(LandmarkId, LandmarkPlace)],
    obstacles: &[Obstacle],
    settings: &VisibilitySettings,
    before: Option<&MapSnapshot>,
) -> Areas {
    let before = before.filter(|before| before.visibility_settings == *settings);
    let unchanged = |id: &LandmarkId, place: &LandmarkPlace| {
        let before = before?;
        let area = before.visibility.get(id)?;
        let same = before.landmarks.get(id)?.place.as_ref() == Some(place)
            && within_reach(place, obstacles, &settings.viewer, &settings.seen) == area.obstacles();
        same.then(|| area.clone())
    };
    let one = |(id, place): &(LandmarkId, LandmarkPlace)| {
        let made = || visibility(place, obstacles, &settings.viewer, &settings.seen).map(Arc::new);
        let area = unchanged(id, place).map_or_else(made, Ok);
        let area =
            area.inspect_err(|error| tracing::error!(%error, landmark = id.0, "visibility_area_failed"));
        Some((*id, area.ok()?))
    };
    places.iter().filter_map(one).collect()
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
