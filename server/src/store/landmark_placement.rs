//! Placement of landmarks by their views (method 11). In: views with a capture, and the walls of
//! the map or a ceiling of given height. Out: a place with covariance, or why there is none. A
//! place by hand is never replaced.

use super::{
    StoreError, Tx,
    db::{self, Executor},
    landmarks::{self, LandmarkGeometry, StoredPlace},
    statements::statements,
    views,
};
use map::{
    extrinsics::CameraExtrinsics,
    place::{LandmarkPlace, PlaceSigmas},
    placement::{
        Ceiling, Placement, PlacementError, PlacementParams, PosedView, ceiling_placement, placement,
        view_on_ceiling, view_on_wall,
    },
    pose2::Pose2Covariance,
    segments::LaserSegment,
};
use nalgebra::{Isometry3, Matrix2, Vector3};
use protos::{Rejection, api::CaptureMetadata, convert::geometry, v1};
use serde::{Deserialize, Serialize};
use vision::{
    detect::BORDER_SIGMA_PX,
    frame::Intrinsics,
    geometry::Corners,
    pose::{LandmarkSize, MAX_CORNER_SIGMA_PX},
    up::Up,
};

statements! {
    CAPTURES = "SELECT corners_px, capture FROM views WHERE landmark_id = $1 AND capture IS NOT NULL \
                ORDER BY id DESC LIMIT 256";
}

/// Views that a placement uses: the newest; the number in `CAPTURES`.
const MAX_CAPTURES: usize = 256;
/// Standard deviation of a taught corner, per coordinate, where nothing is known of it.
const CORNER_SIGMA_PX: f64 = 1.0;
/// Standard deviation of a given ceiling height.
const CEILING_SIGMA_M: f64 = 0.02;

/// Corners (px) and capture (JSON) of a view.
pub(super) type Captured = (Corners, String);

/// How a picture was taken, as it is stored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StoredCapture {
    intrinsics: v1::Intrinsics,
    map_from_robot: v1::Pose2Covariance,
    robot_from_camera: v1::Pose3,
    /// The landmark is under a ceiling so high, not on a wall.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    ceiling_height_m: Option<f64>,
    /// Covariance of each corner by the noise of its edges, px^2: (uu, uv, vv), TL TR BR BL. The
    /// error of borders is added whenever it is used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    corner_covariance_px2: Option<[[f64; 3]; 4]>,
}

/// A capture with checked values.
struct CheckedCapture {
    camera: Intrinsics,
    map_from_robot: Pose2Covariance,
    extrinsics: CameraExtrinsics,
    ceiling: Option<Ceiling>,
    corners_px2: [Matrix2<f64>; 4],
}

/// The camera of a stored capture (JSON); `None` where it cannot be read.
pub(super) fn camera_of(capture: &str) -> Option<Intrinsics> {
    serde_json::from_str::<StoredCapture>(capture).ok()?.camera()
}

impl From<CaptureMetadata> for StoredCapture {
    fn from(body: CaptureMetadata) -> Self {
        Self {
            intrinsics: body.intrinsics,
            map_from_robot: body.map_from_robot,
            robot_from_camera: body.robot_from_camera,
            ceiling_height_m: body.ceiling_height_m,
            corner_covariance_px2: body.corner_covariance_px2,
        }
    }
}

impl StoredCapture {
    /// The capture of a robot's frame, whose values are checked already.
    pub(crate) fn of_robot(
        camera: &Intrinsics,
        map_from_robot: &Pose2Covariance,
        robot_from_camera: &Isometry3<f64>,
    ) -> Self {
        Self {
            intrinsics: geometry::intrinsics_wire(camera),
            map_from_robot: geometry::pose2_covariance_wire(map_from_robot),
            robot_from_camera: geometry::pose3_wire(robot_from_camera),
            ceiling_height_m: None,
            corner_covariance_px2: None,
        }
    }

    /// Sets the covariances that the detector gave the corners, px^2.
    pub(crate) fn set_detected_corners(&mut self, covariance_px2: &[Matrix2<f64>; 4]) {
        self.corner_covariance_px2 = Some(covariance_px2.map(|c| [c.m11, c.m12, c.m22]));
    }

    /// Which corner of a quad, 0 to 3, is the landmark's top-left one. `None` where the mounting
    /// does not decide.
    pub(crate) fn top_left(&self, corners_px: &Corners) -> Option<usize> {
        let taken = self.checked().ok()?;
        Up::new(taken.extrinsics.camera_up())?.top_left(corners_px, Some(&taken.camera))
    }

    /// The camera; `None` where its values are out of range.
    pub(crate) fn camera(&self) -> Option<Intrinsics> {
        geometry::intrinsics(&self.intrinsics).ok()
    }

    /// Errors: a value is out of range; the rejection names its field.
    pub(crate) fn check(&self) -> Result<(), Rejection> {
        self.checked().map(|_| ())
    }

    fn checked(&self) -> Result<CheckedCapture, Rejection> {
        let ceiling = self.ceiling_height_m.map(|height_m| Ceiling { height_m, sigma_m: CEILING_SIGMA_M });
        if let Some(Err(e)) = ceiling.map(|c| c.check()) {
            return Err(Rejection::new(protos::Code::OutOfRange, "ceiling_height_m", e.to_string()));
        }
        Ok(CheckedCapture {
            camera: geometry::intrinsics(&self.intrinsics).map_err(|r| r.inside("intrinsics"))?,
            map_from_robot: geometry::pose2_covariance(&self.map_from_robot)
                .map_err(|r| r.inside("map_from_robot"))?,
            extrinsics: geometry::mounting(&self.robot_from_camera)
                .map_err(|r| r.inside("robot_from_camera"))?,
            ceiling,
            corners_px2: self.corners_px2()?,
        })
    }
}

impl StoredCapture {
    /// Covariances of the corners with the error of borders, px^2; a default where none are stated.
    fn corners_px2(&self) -> Result<[Matrix2<f64>; 4], Rejection> {
        let Some(stated) = &self.corner_covariance_px2 else {
            return Ok([Matrix2::identity() * CORNER_SIGMA_PX.powi(2); 4]);
        };
        let mut made = [Matrix2::zeros(); 4];
        for (i, (made, [uu, uv, vv])) in made.iter_mut().zip(stated).enumerate() {
            let noise = Matrix2::new(*uu, *uv, *uv, *vv);
            let most = MAX_CORNER_SIGMA_PX.powi(2);
            let possible = noise.iter().all(|v| v.is_finite())
                && noise.determinant() >= 0.0
                && [uu, vv].iter().all(|v| (0.0..=most).contains(*v));
            if !possible {
                let field = format!("corner_covariance_px2[{i}]");
                let detail = format!("not a covariance (uu, uv, vv) of at most {MAX_CORNER_SIGMA_PX} px");
                return Err(Rejection::new(protos::Code::OutOfRange, &field, detail));
            }
            *made = noise + Matrix2::identity() * BORDER_SIGMA_PX.powi(2);
        }
        Ok(made)
    }
}

/// Whether a landmark was placed, and why not.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PlacementReport {
    /// The landmark has a place by its views now.
    pub(crate) placed: bool,
    /// Views with a robot pose that the place rests on.
    pub(crate) views_used: usize,
    /// Why it was not: `by_hand` (a place by hand stays), or what is wrong with the views, with the
    /// residual.
    pub(crate) reason: Option<String>,
}

/// The placement of a landmark by its views, not stored yet.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum PlacementOutcome {
    /// The place by hand stays.
    ByHand,
    /// The views give no place, and why.
    NotPlaced(String),
    /// Place and size, and the number of views that they rest on.
    Placed(Box<LandmarkGeometry>, usize),
}

/// The views of a landmark with a capture, newest first: at most [`MAX_CAPTURES`].
pub(super) async fn captures(db: impl Executor<'_>, landmark: i64) -> Result<Vec<Captured>, StoreError> {
    let rows = db::query(CAPTURES).bind(landmark).fetch_all(db).await;
    let rows = rows.map_err(StoreError::during("read captures"))?;
    let captured = |row: &db::Row| {
        Ok((views::corners_in(row)?, row.try_get("capture").map_err(StoreError::during("read captures"))?))
    };
    rows.iter().map(captured).collect()
}

/// Places a landmark with the present geometry `now` by its views with a capture, newest first.
pub(super) fn place_landmark(
    captures: &[Captured],
    walls: &[LaserSegment],
    now: &LandmarkGeometry,
) -> PlacementOutcome {
    if now.place.is_some_and(|place| place.covariance.is_none()) {
        return PlacementOutcome::ByHand;
    }
    // A capture that another version of the program stored, and this one cannot read, is left out.
    let taken = |(corners, capture): &Captured| {
        Some((*corners, serde_json::from_str::<StoredCapture>(capture).ok()?.checked().ok()?))
    };
    let views: Vec<(Corners, CheckedCapture)> =
        captures.iter().take(MAX_CAPTURES).filter_map(taken).collect();
    match placed(&views, walls) {
        Ok(made) => {
            let by_hand = now.size_by_hand();
            PlacementOutcome::Placed(Box::new(geometry_of(&made.place, by_hand)), made.used.len())
        }
        Err(error) => PlacementOutcome::NotPlaced(error.to_string()),
    }
}

/// Stores a computed placement.
pub(super) async fn put(
    tx: &mut Tx,
    map: &str,
    landmark: &str,
    outcome: PlacementOutcome,
) -> Result<PlacementReport, StoreError> {
    let not = |reason: String| PlacementReport { placed: false, views_used: 0, reason: Some(reason) };
    Ok(match outcome {
        PlacementOutcome::ByHand => not("by_hand".to_owned()),
        PlacementOutcome::NotPlaced(reason) => not(reason),
        PlacementOutcome::Placed(geometry, views_used) => {
            landmarks::update(tx, map, landmark, move |_| *geometry).await?;
            PlacementReport { placed: true, views_used, reason: None }
        }
    })
}

/// The placement of a track by its views, without storing anything.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PlacementPreview {
    pub(crate) place: LandmarkPlace,
    /// Indices of views that do not agree with the place: they show another border of the same
    /// object, or another object.
    pub(crate) inconsistent: Vec<usize>,
    /// Angles between the landmark's normal and the direction to the camera in the other views,
    /// rad.
    pub(crate) angles_rad: Vec<f64>,
}

/// Places a track by its views: corners (px) and the JSON of the capture. A view without a capture
/// agrees with any place.
pub(crate) fn preview<'a>(
    views: impl Iterator<Item = (&'a Corners, Option<&'a str>)>,
    walls: &[LaserSegment],
) -> Result<PlacementPreview, String> {
    let taken = |text: &str| serde_json::from_str::<StoredCapture>(text).ok()?.checked().ok();
    let (numbers, used): (Vec<usize>, Vec<(Corners, CheckedCapture)>) = views
        .enumerate()
        .filter_map(|(i, (corners, capture))| Some((i, (*corners, taken(capture?)?))))
        .unzip();
    let made = placed(&used, walls).map_err(|error| error.to_string())?;
    let pose = made.place.map_from_landmark();
    let (normal, centre) = (pose.rotation * Vector3::x(), pose.translation.vector);
    let angle = |i: &usize| {
        let (_, taken) = &used[*i];
        let camera = taken.map_from_robot.pose.to_isometry3() * taken.extrinsics.robot_from_camera;
        normal.angle(&(camera.translation.vector - centre))
    };
    Ok(PlacementPreview {
        place: made.place,
        inconsistent: (0..used.len()).filter(|i| !made.used.contains(i)).map(|i| numbers[i]).collect(),
        angles_rad: made.used.iter().map(angle).collect(),
    })
}

fn view((corners, taken): &(Corners, CheckedCapture)) -> PosedView<'_> {
    PosedView {
        corners,
        covariance_px2: &taken.corners_px2,
        camera: &taken.camera,
        map_from_robot: &taken.map_from_robot,
        mounting: &taken.extrinsics,
    }
}

/// A placement by walls, or by the ceiling that the first view states. `used` are indices of
/// `views`.
fn placed(views: &[(Corners, CheckedCapture)], walls: &[LaserSegment]) -> Result<Placement, PlacementError> {
    let p = PlacementParams::default();
    // The newest view decides between wall and ceiling.
    let ceiling = views.first().and_then(|(_, taken)| taken.ceiling);
    let mut why = PlacementError::NoView;
    if let Some(ceiling) = ceiling {
        let (mut rectangles, mut from) = (vec![], vec![]);
        for (i, posed) in views.iter().enumerate() {
            match view_on_ceiling(&view(posed), &ceiling, &p) {
                Ok(view) => {
                    rectangles.push(view);
                    from.push(i);
                }
                Err(error) => why = error,
            }
        }
        return if rectangles.is_empty() {
            Err(why)
        } else {
            Ok(with_indices(&ceiling_placement(&rectangles, &ceiling, &p)?, &from))
        };
    }
    let (mut rectangles, mut from) = (vec![], vec![]);
    for (i, posed) in views.iter().enumerate() {
        match view_on_wall(&view(posed), walls, &p) {
            Ok(view) => {
                rectangles.push(view);
                from.push(i);
            }
            Err(error) => why = error,
        }
    }
    if rectangles.is_empty() {
        Err(why)
    } else {
        Ok(with_indices(&placement(&rectangles, walls, &p)?, &from))
    }
}

/// The placement with `used` as indices of all views, before unfit ones were left out.
fn with_indices(made: &Placement, from: &[usize]) -> Placement {
    Placement { used: made.used.iter().filter_map(|i| from.get(*i).copied()).collect(), place: made.place }
}

/// Geometry by views. A size by hand stays, with the covariance of a size by hand.
fn geometry_of(place: &LandmarkPlace, by_hand: Option<LandmarkSize>) -> LandmarkGeometry {
    let mut covariance = place.covariance;
    if by_hand.is_some() {
        let variance = PlaceSigmas::default().size_m.powi(2);
        for k in [4, 5] {
            covariance.fill_row(k, 0.0);
            covariance.fill_column(k, 0.0);
            covariance[(k, k)] = variance;
        }
    }
    LandmarkGeometry {
        size: Some(by_hand.unwrap_or(place.size)),
        place: Some(StoredPlace {
            x_m: place.x_m,
            y_m: place.y_m,
            z_m: place.z_m,
            theta_rad: place.theta_rad,
            roll_rad: place.roll_rad,
            tilt_rad: place.tilt_rad,
            covariance: Some(covariance),
        }),
        size_from_views: by_hand.is_none(),
    }
}

#[cfg(test)]
pub(crate) mod tests;
