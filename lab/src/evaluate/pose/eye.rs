//! The camera that looks and what is said of it: the same, or off by the errors of a usual calibration.

use nalgebra::{Isometry3, Point2, Vector2};
use serde::Serialize;
use vision::{
    frame::{Intrinsics, IntrinsicsSigmas},
    geometry::Corners,
    pose::{
        LandmarkPose, LandmarkSize, landmark_pose,
        reprojection::{corner_points, pixel},
    },
    random::Random,
};

/// What is wrong with cameras.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Cameras {
    /// Nothing, and so it is said.
    Exact,
    /// What is wrong with a usual one, and it is said that nothing is.
    WrongUntold,
    /// What is wrong with a usual one, and so it is said.
    WrongTold,
}

/// One of them.
pub(crate) struct StatedCamera {
    real: Intrinsics,
    stated: Intrinsics,
}

impl StatedCamera {
    /// A camera like `base` with errors of its own.
    pub(crate) fn drawn(base: &Intrinsics, cameras: Cameras, random: &mut Random) -> Self {
        let usual = base.with_sigmas(IntrinsicsSigmas::usual(base.fx_px)).unwrap_or(*base);
        if cameras == Cameras::Exact {
            return Self { real: *base, stated: *base };
        }
        let e = usual.error_sigmas().map(|s| s * random.normal());
        let (fx_px, fy_px) = (base.fx_px * (1.0 + e.x), base.fy_px * (1.0 + e.x));
        let real = Intrinsics { fx_px, fy_px, cx_px: base.cx_px + e.y, cy_px: base.cy_px + e.z, ..*base };
        Self { real, stated: if cameras == Cameras::WrongTold { usual } else { *base } }
    }

    /// A thing of `size` that is taken to be of `believed` size; `None` where not all of it is in the picture.
    pub(crate) fn look(
        &self,
        camera_from_landmark: &Isometry3<f64>,
        (size, believed): (LandmarkSize, LandmarkSize),
        sigma_px: f64,
        random: &mut Random,
    ) -> Option<LandmarkPose> {
        let mut points = [Point2::origin(); 4];
        for (px, p) in points.iter_mut().zip(corner_points(&size)) {
            let noise = Vector2::new(random.normal(), random.normal()) * sigma_px;
            *px = pixel(camera_from_landmark, &p, &self.real)? + noise;
        }
        let inside = |p: &Point2<f64>| (0.0..640.0).contains(&p.x) && (0.0..480.0).contains(&p.y);
        let corners = Corners::new(points).ok().filter(|_| points.iter().all(inside))?;
        landmark_pose(&corners, &super::scene::isotropic(sigma_px), believed, &self.stated).ok()
    }
}
