//! Places of landmarks from their views: those that say where the robot stood, on the walls of the map or under a ceiling
//! of given height (method 11). A place by hand is never replaced.

use super::{
    StoreError, Tx,
    landmarks::{self, Measures, Place},
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
use sqlx::{Row, SqliteExecutor, sqlite::SqliteRow};
use vision::{
    detect::BORDER_SIGMA_PX,
    frame::Intrinsics,
    geometry::Corners,
    pose::{LandmarkSize, MAX_CORNER_SIGMA_PX},
};

statements! {
    CAPTURES = "SELECT corners_px, capture FROM views WHERE landmark_id = ?1 AND capture IS NOT NULL \
                ORDER BY id DESC LIMIT 256";
}

/// Views that a place rests on at most, the newest; the number in `CAPTURES`.
const MAX_CAPTURES: usize = 256;
/// Standard deviation of a taught corner, per coordinate, where nothing is known of it.
const CORNER_SIGMA_PX: f64 = 1.0;
/// Of a ceiling's height as it is given.
const CEILING_SIGMA_M: f64 = 0.02;

/// Corners and capture of a view that was taken with a known pose.
pub(super) type Captured = (Corners, String);

/// How a picture was taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Capture {
    intrinsics: v1::Intrinsics,
    map_from_robot: v1::Pose2Covariance,
    robot_from_camera: v1::Pose3,
    /// The landmark is under a ceiling so high, not on a wall.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    ceiling_height_m: Option<f64>,
    /// Covariance of each corner by the noise of its edges: (uu, uv, vv), TL TR BR BL. What borders are off by besides is
    /// added whenever it is used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    corner_covariance_px2: Option<[[f64; 3]; 4]>,
}

/// The same, checked.
struct Taken {
    camera: Intrinsics,
    map_from_robot: Pose2Covariance,
    mounting: CameraExtrinsics,
    ceiling: Option<Ceiling>,
    corners_px2: [Matrix2<f64>; 4],
}

impl From<CaptureMetadata> for Capture {
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

impl Capture {
    /// Of a robot's own frame: everything is checked already.
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

    /// The corners were found by the detector, with these covariances.
    pub(crate) fn corners_by_detector(&mut self, covariance_px2: &[Matrix2<f64>; 4]) {
        self.corner_covariance_px2 = Some(covariance_px2.map(|c| [c.m11, c.m12, c.m22]));
    }

    /// What is wrong with it, by field.
    pub(crate) fn check(&self) -> Result<(), Rejection> {
        self.taken().map(|_| ())
    }

    fn taken(&self) -> Result<Taken, Rejection> {
        let ceiling = self.ceiling_height_m.map(|height_m| Ceiling { height_m, sigma_m: CEILING_SIGMA_M });
        if let Some(Err(e)) = ceiling.map(|c| c.check()) {
            return Err(Rejection::new(protos::Code::OutOfRange, "ceiling_height_m", e.to_string()));
        }
        Ok(Taken {
            camera: geometry::intrinsics(&self.intrinsics).map_err(|r| r.inside("intrinsics"))?,
            map_from_robot: geometry::pose2_covariance(&self.map_from_robot)
                .map_err(|r| r.inside("map_from_robot"))?,
            mounting: geometry::mounting(&self.robot_from_camera)
                .map_err(|r| r.inside("robot_from_camera"))?,
            ceiling,
            corners_px2: self.corners_px2()?,
        })
    }
}

impl Capture {
    /// As far as it can be believed.
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

/// What came of placing.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Placing {
    /// The landmark has a place by its views now.
    pub(crate) placed: bool,
    /// Views with a robot pose that the place rests on.
    pub(crate) views_used: usize,
    /// Why not: `by_hand` (a place by hand stays), or what is wrong with the views, with the residual.
    pub(crate) reason: Option<String>,
}

/// What the views of a landmark say of its place; computed, not stored yet.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Made {
    /// The place by hand stays.
    ByHand,
    /// They do not place it, and why.
    Not(String),
    /// Place and size, and how many views they rest on.
    Placed(Box<Measures>, usize),
}

/// Views of a landmark that say how they were taken, the newest first: as many as its place may rest on.
pub(super) async fn captures(
    db: impl SqliteExecutor<'_>,
    landmark: i64,
) -> Result<Vec<Captured>, StoreError> {
    let rows = sqlx::query(CAPTURES).bind(landmark).fetch_all(db).await;
    let rows = rows.map_err(StoreError::at("read captures"))?;
    let captured = |row: &SqliteRow| {
        Ok((views::corners_in(row)?, row.try_get("capture").map_err(StoreError::at("read captures"))?))
    };
    rows.iter().map(captured).collect()
}

/// Places a landmark, that is measured as `now`, by views that say where the robot stood, the newest first.
pub(super) fn made(captures: &[Captured], walls: &[LaserSegment], now: &Measures) -> Made {
    if now.place.is_some_and(|place| place.covariance.is_none()) {
        return Made::ByHand;
    }
    // What an older or newer program stored and this one does not understand is left out.
    let taken = |(corners, capture): &Captured| {
        Some((*corners, serde_json::from_str::<Capture>(capture).ok()?.taken().ok()?))
    };
    let looks: Vec<(Corners, Taken)> = captures.iter().take(MAX_CAPTURES).filter_map(taken).collect();
    match placed(&looks, walls) {
        Ok(made) => {
            let by_hand = now.size.filter(|_| !now.size_from_views);
            Made::Placed(Box::new(measures(&made.place, by_hand)), made.used.len())
        }
        Err(error) => Made::Not(error.to_string()),
    }
}

/// Stores a place that was computed.
pub(super) async fn put(tx: &mut Tx, map: &str, landmark: &str, made: Made) -> Result<Placing, StoreError> {
    let not = |reason: String| Placing { placed: false, views_used: 0, reason: Some(reason) };
    Ok(match made {
        Made::ByHand => not("by_hand".to_owned()),
        Made::Not(reason) => not(reason),
        Made::Placed(measures, views_used) => {
            landmarks::update(tx, map, landmark, move |_| *measures).await?;
            Placing { placed: true, views_used, reason: None }
        }
    })
}

/// Where a thing hangs by its views, without storing anything.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Preview {
    pub(crate) place: LandmarkPlace,
    /// Which of the views given do not agree with it: they saw another border of the same thing, or something else.
    pub(crate) apart: Vec<usize>,
    /// How far off the normal the camera looked in the others, radians.
    pub(crate) angles_rad: Vec<f64>,
}

/// Places a thing by views: corners and the JSON of the capture. A view without a capture agrees with everything.
pub(crate) fn preview<'a>(
    views: impl Iterator<Item = (&'a Corners, Option<&'a str>)>,
    walls: &[LaserSegment],
) -> Result<Preview, String> {
    let taken = |text: &str| serde_json::from_str::<Capture>(text).ok()?.taken().ok();
    let (numbers, looks): (Vec<usize>, Vec<(Corners, Taken)>) = views
        .enumerate()
        .filter_map(|(i, (corners, capture))| Some((i, (*corners, taken(capture?)?))))
        .unzip();
    let made = placed(&looks, walls).map_err(|error| error.to_string())?;
    let pose = made.place.map_from_landmark();
    let (normal, centre) = (pose.rotation * Vector3::x(), pose.translation.vector);
    let angle = |i: &usize| {
        let (_, taken) = &looks[*i];
        let camera = taken.map_from_robot.pose.to_isometry3() * taken.mounting.robot_from_camera;
        normal.angle(&(camera.translation.vector - centre))
    };
    Ok(Preview {
        place: made.place,
        apart: (0..looks.len()).filter(|i| !made.used.contains(i)).map(|i| numbers[i]).collect(),
        angles_rad: made.used.iter().map(angle).collect(),
    })
}

fn view((corners, taken): &(Corners, Taken)) -> PosedView<'_> {
    PosedView {
        corners,
        covariance_px2: &taken.corners_px2,
        camera: &taken.camera,
        map_from_robot: &taken.map_from_robot,
        mounting: &taken.mounting,
    }
}

/// `used` are indices of `looks`.
fn placed(looks: &[(Corners, Taken)], walls: &[LaserSegment]) -> Result<Placement, PlacementError> {
    let p = PlacementParams::default();
    // The last view says what it hangs on.
    let ceiling = looks.first().and_then(|(_, taken)| taken.ceiling);
    let mut why = PlacementError::NoView;
    if let Some(ceiling) = ceiling {
        let (mut seen, mut from) = (vec![], vec![]);
        for (i, look) in looks.iter().enumerate() {
            match view_on_ceiling(&view(look), &ceiling, &p) {
                Ok(view) => {
                    seen.push(view);
                    from.push(i);
                }
                Err(error) => why = error,
            }
        }
        return if seen.is_empty() {
            Err(why)
        } else {
            Ok(named(&ceiling_placement(&seen, &ceiling, &p)?, &from))
        };
    }
    let (mut seen, mut from) = (vec![], vec![]);
    for (i, look) in looks.iter().enumerate() {
        match view_on_wall(&view(look), walls, &p) {
            Ok(view) => {
                seen.push(view);
                from.push(i);
            }
            Err(error) => why = error,
        }
    }
    if seen.is_empty() { Err(why) } else { Ok(named(&placement(&seen, walls, &p)?, &from)) }
}

/// `used` by the numbers that views had before the unfit ones were left out.
fn named(made: &Placement, from: &[usize]) -> Placement {
    Placement { used: made.used.iter().filter_map(|i| from.get(*i).copied()).collect(), place: made.place }
}

/// A size by hand stays, and is as sure as a tape.
fn measures(place: &LandmarkPlace, by_hand: Option<LandmarkSize>) -> Measures {
    let mut covariance = place.covariance;
    if by_hand.is_some() {
        let variance = PlaceSigmas::default().size_m.powi(2);
        for k in [4, 5] {
            covariance.fill_row(k, 0.0);
            covariance.fill_column(k, 0.0);
            covariance[(k, k)] = variance;
        }
    }
    Measures {
        size: Some(by_hand.unwrap_or(place.size)),
        place: Some(Place {
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
pub(super) mod tests;
