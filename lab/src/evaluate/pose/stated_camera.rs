//! True and stated intrinsics of a camera: equal, or apart by the errors of a usual calibration.

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

/// Errors of stated intrinsics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Cameras {
    /// None, and none are stated.
    Exact,
    /// Errors of a usual calibration, but none are stated.
    WithoutSigmas,
    /// Errors of a usual calibration, with their standard deviations stated.
    WithSigmas,
}

/// A camera with true and stated intrinsics.
pub(crate) struct StatedCamera {
    real: Intrinsics,
    stated: Intrinsics,
}

impl StatedCamera {
    /// A camera with the stated intrinsics `base` and drawn errors.
    pub(crate) fn drawn(base: &Intrinsics, cameras: Cameras, random: &mut Random) -> Self {
        let usual = base.with_sigmas(IntrinsicsSigmas::usual(base.fx_px)).unwrap_or(*base);
        if cameras == Cameras::Exact {
            return Self { real: *base, stated: *base };
        }
        let e = usual.error_sigmas().map(|s| s * random.normal());
        let (fx_px, fy_px) = (base.fx_px * (1.0 + e.x), base.fy_px * (1.0 + e.x));
        let real = Intrinsics { fx_px, fy_px, cx_px: base.cx_px + e.y, cy_px: base.cy_px + e.z, ..*base };
        Self { real, stated: if cameras == Cameras::WithSigmas { usual } else { *base } }
    }

    /// Pose of an object of `size` for which `believed` is assumed; `None` if it is not wholly in
    /// the image.
    pub(crate) fn observe(
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
