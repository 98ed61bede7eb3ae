//! Walls and landmarks of a map, as entities of a scene.

use super::Shown;
use crate::{
    foxglove::{
        Color, KeyValuePair, LinePrimitive, Point3, Pose, SceneEntity, SceneEntityDeletion, SceneUpdate,
        TextPrimitive, Timestamp, line_primitive, scene_entity_deletion,
    },
    topics,
};
use map::place::LandmarkPlace;
use nalgebra::{Isometry3, Matrix6, Point3 as Point};
use protos::api::{Landmark, LandmarkStatus, WallsBody};
use vision::pose::LandmarkSize;

const WALLS: Color = Color::opaque(0.35, 0.35, 0.4);
const ACTIVE: Color = Color::opaque(0.1, 0.7, 0.2);
const INACTIVE: Color = Color::opaque(0.8, 0.5, 0.1);
/// Of lines, px of the screen.
const LINE_PX: f64 = 2.0;
/// Of names, m.
const TEXT_M: f64 = 0.15;

/// Walls and landmarks of a version of a map.
#[derive(Debug, Clone, Copy)]
pub struct MapContent<'a> {
    /// The map.
    pub map: &'a str,
    /// Its version.
    pub version: u64,
    /// Its walls.
    pub walls: &'a WallsBody,
    /// Its landmarks; those without place or size are left out.
    pub landmarks: &'a [Landmark],
}

/// The whole map: it replaces what was shown of it before.
pub(super) fn shown(content: &MapContent<'_>, log_time_ns: u64) -> Shown {
    let at = Timestamp::from_ns(i64::try_from(log_time_ns).unwrap_or(i64::MAX));
    let entity = |id: String, metadata: Vec<KeyValuePair>| SceneEntity {
        timestamp: Some(at),
        frame_id: topics::map_frame(content.map),
        id,
        metadata,
        ..SceneEntity::default()
    };
    let version = KeyValuePair { key: "version".to_owned(), value: content.version.to_string() };
    let walls =
        SceneEntity { lines: vec![walls(content.walls)], ..entity("walls".to_owned(), vec![version]) };
    let landmarks = content.landmarks.iter().filter_map(|landmark| {
        let (lines, texts) = landmark_shape(landmark)?;
        let status = KeyValuePair { key: "status".to_owned(), value: landmark.status.to_string() };
        Some(SceneEntity {
            lines: vec![lines],
            texts: vec![texts],
            ..entity(format!("landmark/{}", landmark.name), vec![status])
        })
    });
    let all = SceneEntityDeletion {
        timestamp: Some(at),
        r#type: scene_entity_deletion::Type::All.into(),
        id: String::new(),
    };
    let update =
        SceneUpdate { deletions: vec![all], entities: std::iter::once(walls).chain(landmarks).collect() };
    Shown::new(topics::scene(content.map), "foxglove.SceneUpdate", &update)
}

fn walls(walls: &WallsBody) -> LinePrimitive {
    let point = |[x, y]: [f64; 2]| Point3 { x, y, z: 0.0 };
    LinePrimitive {
        r#type: line_primitive::Type::LineList.into(),
        pose: Some(Isometry3::identity().into()),
        thickness: LINE_PX,
        scale_invariant: true,
        points: walls.segments.iter().flat_map(|wall| [point(wall.a), point(wall.b)]).collect(),
        color: Some(WALLS),
        ..LinePrimitive::default()
    }
}

/// Outline and name in the landmark's own frame.
fn landmark_shape(landmark: &Landmark) -> Option<(LinePrimitive, TextPrimitive)> {
    let (place, size) = (landmark.place.as_ref()?, landmark.size.as_ref()?);
    let size = LandmarkSize { width_m: size.width_m, height_m: size.height_m };
    let place = LandmarkPlace {
        x_m: place.x_m,
        y_m: place.y_m,
        z_m: place.z_m,
        theta_rad: place.theta_rad,
        roll_rad: place.roll_rad,
        tilt_rad: place.tilt_rad,
        size,
        covariance: Matrix6::zeros(),
        shared: None,
    };
    let map_from_landmark = place.map_from_landmark();
    let color = if landmark.status == LandmarkStatus::Active { ACTIVE } else { INACTIVE };
    let (y, z) = (size.width_m / 2.0, size.height_m / 2.0);
    // The landmark's y is the viewer's right, its z up: top-left first, clockwise.
    let corners = [[-y, z], [y, z], [y, -z], [-y, -z]];
    let lines = LinePrimitive {
        r#type: line_primitive::Type::LineLoop.into(),
        pose: Some(Pose::from(map_from_landmark)),
        thickness: LINE_PX,
        scale_invariant: true,
        points: corners.map(|[y, z]| Point::new(0.0, y, z).into()).to_vec(),
        color: Some(color),
        ..LinePrimitive::default()
    };
    let texts = TextPrimitive {
        pose: Some(Pose::from(map_from_landmark)),
        billboard: true,
        font_size: TEXT_M,
        scale_invariant: false,
        color: Some(color),
        text: landmark.name.clone(),
    };
    Some((lines, texts))
}
