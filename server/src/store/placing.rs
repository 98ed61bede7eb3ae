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
pub(super) mod tests {
    use super::*;
    use crate::{
        publication::Catalogue,
        store::{
            laser, maps,
            teaching::{self, Teaching},
            views::NewView,
        },
    };
    use map::{extrinsics::pan_tilt, pose2::Pose2};
    use nalgebra::{Matrix3, Matrix6};
    use vision::{
        icon::Icon,
        model::LandmarkId,
        pose::reprojection::{corner_points, pixel},
        recognise::DistanceKind,
    };

    const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };

    /// On the wall y = 0 of a room above it, 2 m from the origin.
    fn truth() -> LandmarkPlace {
        LandmarkPlace {
            x_m: 2.0,
            y_m: 0.0,
            z_m: 1.5,
            theta_rad: std::f64::consts::FRAC_PI_2,
            roll_rad: 0.0,
            tilt_rad: 0.0,
            size: SIZE,
            covariance: Matrix6::zeros(),
        }
    }

    pub(in crate::store) fn seen_from(x: f64, number: u8, shift_px: f64) -> NewView {
        let camera = Intrinsics::new(500.0, 500.0, 320.0, 240.0, vision::frame::Distortion::None).unwrap();
        let heading = (-2.0_f64).atan2(2.0 - x);
        let robot = Pose2::new(x, 2.0, heading);
        let mounting = pan_tilt(0.0, 0.1, Vector3::new(0.1, 0.0, 1.2));
        let seen = mounting.inverse() * robot.to_isometry3().inverse() * truth().map_from_landmark();
        let mut px = corner_points(&SIZE).map(|p| pixel(&seen, &p, &camera).unwrap());
        px[1].y += shift_px;
        let spread = Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 1e-5));
        let capture = Capture {
            intrinsics: geometry::intrinsics_wire(&camera),
            map_from_robot: geometry::pose2_covariance_wire(&Pose2Covariance {
                pose: robot,
                covariance: spread,
            }),
            robot_from_camera: geometry::pose3_wire(&mounting),
            ceiling_height_m: None,
            corner_covariance_px2: None,
        };
        capture.check().unwrap();
        NewView {
            image: vec![number],
            image_sha256: [number; 32],
            image_kind: "png",
            size_px: [640, 480],
            cut: views::Cut {
                corners_px: Corners::new(px).unwrap(),
                icon: Icon::new(20, vec![7.0; 400], 1.0).unwrap(),
            },
            strangers: vec![],
            capture: Some(serde_json::to_string(&capture).unwrap()),
        }
    }

    async fn taught(store: &Catalogue, view: NewView) -> Placing {
        let (map, landmark) = ("a".to_owned(), "p1".to_owned());
        let teaching = Teaching { map, landmark, view, max: 100, thinning: None };
        teaching::add(store, teaching).await.unwrap().2.unwrap()
    }

    #[tokio::test]
    async fn a_taught_landmark_is_placed_on_its_wall_and_a_place_by_hand_stays() {
        let dir = tempfile::tempdir().unwrap();
        let config = crate::publication::tests::config(dir.path());
        let (store, _task) = Catalogue::open(&config).await.unwrap();
        store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
        let made = store
            .write(|tx| Box::pin(landmarks::create(tx, "a", "p1", Measures::default(), 5)))
            .await
            .unwrap();
        let none = taught(&store, seen_from(1.0, 1, 0.0)).await;
        assert!(!none.placed && none.reason.as_ref().is_some_and(|r| r.contains("no wall")), "{none:?}");
        store.write(|tx| Box::pin(laser::replace(tx, "a", &[[0.0, 0.0, 6.0, 0.0]]))).await.unwrap();
        let placed = taught(&store, seen_from(3.2, 2, 0.0)).await;
        assert_eq!(placed, Placing { placed: true, views_used: 2, reason: None });
        let of = |store: &Catalogue| {
            store.snapshots().get("a").unwrap().landmarks[&LandmarkId(made.id as u64)].place
        };
        let place = of(&store).unwrap();
        assert!((place.x_m - 2.0).abs() < 1e-6 && place.y_m.abs() < 1e-6 && (place.z_m - 1.5).abs() < 1e-6);
        assert!((place.size.width_m - 0.6).abs() < 1e-6);
        // Its covariance, not a tape's: one look at 1 px is worth less across the wall than the wall itself.
        let hand = PlaceSigmas::default();
        let row = landmarks::get(store.reads(), "a", "p1").await.unwrap().measures;
        assert!(row.size_from_views && row.place.unwrap().covariance.is_some());
        assert!((place.covariance[(0, 0)].sqrt() - hand.position_m).abs() > 1e-6);
        // A view that is no rectangle on that wall is said to be so when there is no other.
        let by_hand = store.write(|tx| {
            Box::pin(landmarks::update(tx, "a", "p1", |old| Measures {
                place: old.place.map(|p| Place { x_m: 2.5, covariance: None, ..p }),
                ..old
            }))
        });
        by_hand.await.unwrap();
        let kept = taught(&store, seen_from(2.5, 3, 0.0)).await;
        assert_eq!(kept.reason.as_deref(), Some("by_hand"));
        assert!((of(&store).unwrap().x_m - 2.5).abs() < 1e-12);
    }

    #[test]
    fn what_is_not_on_the_wall_is_refused_with_the_residual() {
        let wall = LaserSegment::by_hand(&[0.0, 0.0, 6.0, 0.0]).unwrap();
        let new = seen_from(1.0, 1, 60.0);
        let capture: Capture = serde_json::from_str(new.capture.as_deref().unwrap()).unwrap();
        let refused = placed(&[(new.cut.corners_px, capture.taken().unwrap())], &[wall]).unwrap_err();
        assert!(matches!(refused, PlacementError::NotOnWall { rms_m, .. } if rms_m > 0.05), "{refused:?}");
        assert!(refused.to_string().contains("not on this wall"));
        let high = Capture { ceiling_height_m: Some(101.0), ..capture };
        assert_eq!(high.check().unwrap_err().field, "ceiling_height_m");
    }

    #[test]
    fn corners_are_worth_what_is_known_of_them_and_no_more_than_borders_are() {
        let wall = LaserSegment::by_hand(&[0.0, 0.0, 6.0, 0.0]).unwrap();
        let new = seen_from(1.0, 1, 0.0);
        let silent: Capture = serde_json::from_str(new.capture.as_deref().unwrap()).unwrap();
        let with = |corner| Capture { corner_covariance_px2: Some([corner; 4]), ..silent.clone() };
        let width = |capture: &Capture| {
            let made = placed(&[(new.cut.corners_px, capture.taken().unwrap())], std::slice::from_ref(&wall));
            made.unwrap().place.covariance[(4, 4)]
        };
        let by_detector = {
            let mut capture = silent.clone();
            capture.corners_by_detector(&[Matrix2::identity() * 0.04; 4]);
            // It comes back from the store as it went in.
            serde_json::from_str::<Capture>(&serde_json::to_string(&capture).unwrap()).unwrap()
        };
        // The width is all corners', so its variance goes with theirs: 1 px; 0.2 px and what borders are off by.
        let camera = width(&Capture {
            intrinsics: v1::Intrinsics {
                focal_sigma_px: Some(0.0),
                center_sigma_px: Some(0.0),
                ..silent.intrinsics.clone()
            },
            ..silent.clone()
        });
        assert!(width(&by_detector) < width(&silent) && camera < width(&silent));
        assert_eq!(by_detector.taken().unwrap().corners_px2[3], Matrix2::identity() * 0.13);
        assert_eq!(silent.taken().unwrap().corners_px2[0], Matrix2::identity());
        // Whoever states nothing but certainty is not believed.
        assert_eq!(with([0.0; 3]).taken().unwrap().corners_px2[0], Matrix2::identity() * 0.09);
        assert!(with([1e8, 0.0, 1e8]).check().is_ok());
        for bad in [[1.1e8, 0.0, 1.0], [1.0, 1.1, 1.0], [-0.1, 0.0, -0.1], [1.0, f64::NAN, 1.0]] {
            assert_eq!(with(bad).check().unwrap_err().field, "corner_covariance_px2[0]");
        }
    }
}
