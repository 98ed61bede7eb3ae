//! A world as strangers to the landmarks of another one. Names mean nothing between worlds; the
//! same picture may hang in both, so landmarks that show it are listed.

use super::world::World;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Which landmarks show the same picture.
const SAME_PICTURES: &str = include_str!("../../../reviewed/same-pictures.json");

#[derive(Deserialize)]
struct List {
    /// Landmarks as `set/landmark`.
    groups: Vec<Vec<String>>,
}

/// `shown` for a robot that knows the landmarks of `taught`: a label has the name of the taught
/// landmark that shows the same picture, else one that is not taught. Without poses.
pub(super) fn as_strangers(shown: &World, taught: &World) -> anyhow::Result<World> {
    let list: List = serde_json::from_str(SAME_PICTURES)?;
    let of = |world: &World, name: &str| format!("{}/{name}", world.truth.name);
    let known: BTreeMap<String, &str> =
        taught.truth.teach.iter().map(|(_, name)| (of(taught, name), name.as_str())).collect();
    let same = |name: &str| {
        let own = of(shown, name);
        let group = list.groups.iter().find(|group| group.contains(&own))?;
        group.iter().find_map(|other| known.get(other)).map(|name| (*name).to_owned())
    };
    let mut world = World { cameras: BTreeMap::new(), landmarks: BTreeMap::new(), ..shown.clone() };
    for quad in world.truth.images.iter_mut().flat_map(|image| &mut image.quads) {
        quad.landmark = quad.landmark.take().map(|name| same(&name).unwrap_or_else(|| of(shown, &name)));
    }
    Ok(world)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::truth::Truth;
    use std::path::Path;

    fn world(folder: &Path, name: &str, landmarks: [&str; 2]) -> World {
        let corners = [[0, 0], [9, 0], [9, 9], [0, 9]];
        let quads = landmarks.map(|l| serde_json::json!({ "corners": corners, "landmark": l }));
        let teach = landmarks.map(|l| serde_json::json!({ "file": format!("{l}.jpg"), "landmark": l }));
        let images = [serde_json::json!({ "file": "a.jpg", "quads": quads })];
        let truth = serde_json::json!({ "name": name, "teach": teach, "images": images });
        std::fs::write(folder.join("truth.json"), truth.to_string()).unwrap();
        let truth = Truth::read(folder).unwrap();
        World { truth, landmarks: BTreeMap::new(), cameras: BTreeMap::new() }
    }

    #[test]
    fn only_the_same_picture_keeps_a_name_that_is_taught() {
        let folder = tempfile::tempdir().unwrap();
        let taught = world(folder.path(), "photoreal-3", ["framed-11", "door-2"]);
        let shown = world(folder.path(), "photoreal-4", ["poster-6", "door-2"]);
        let names = |world: &World| {
            let quads = &world.truth.images[0].quads;
            quads.iter().map(|q| q.landmark.clone().unwrap()).collect::<Vec<_>>()
        };
        let strangers = as_strangers(&shown, &taught).unwrap();
        assert_eq!(names(&strangers), ["framed-11", "photoreal-4/door-2"]);
        let elsewhere = world(folder.path(), "photoreal-5", ["poster-6", "door-2"]);
        assert_eq!(names(&as_strangers(&elsewhere, &taught).unwrap())[0], "photoreal-5/poster-6");
    }
}
