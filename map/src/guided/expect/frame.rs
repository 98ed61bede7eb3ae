//! One image: what it shows of each landmark, the covariance of the corners, what obstacles hide.

use crate::{
    guided::{
        expect::{
            expectations::Expected,
            params::ExpectParams,
            search_gate::SearchGate,
            view::{CameraView, InView, KnownLandmark},
        },
        joint::{ByCommon, CommonMatrix, CornerMatrix},
        projection::{clipped, corner_vector, corners, corners_m, derivatives, project, shortest_side_px},
        sight_line::unoccluded_share,
    },
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance},
    visibility::{Obstacle, PoseDraws},
};
use nalgebra::{Isometry3, Matrix2, Point2, Point3, SymmetricEigen, Vector3};
use std::f64::consts::FRAC_PI_2;
use vision::geometry::polygon;

/// Everything that is the same for all landmarks of one image.
pub(super) struct Frame<'a> {
    prior: &'a Pose2Covariance,
    view: &'a CameraView<'a>,
    /// Camera for each draw of the pose, with the draw's error (x, y, theta).
    draws: Vec<(Isometry3<f64>, Vector3<f64>)>,
    /// Camera centre at the prior pose, map frame.
    camera_m: Point3<f64>,
    /// Camera centres at the border of the prior's position, map frame.
    around_m: Vec<Point3<f64>>,
    obstacles: &'a [Obstacle],
    params: &'a ExpectParams,
}

impl<'a> Frame<'a> {
    pub(super) fn new(
        prior: &'a Pose2Covariance,
        view: &'a CameraView<'a>,
        obstacles: &'a [Obstacle],
        params: &'a ExpectParams,
    ) -> Self {
        let camera = view.mounting.robot_from_camera.translation.vector;
        let drawn = |pose: Pose2| (view.camera().camera_from_map(&pose), pose.minus(&prior.pose));
        let center = |pose: &Pose2| pose.to_isometry3() * Point3::from(camera);
        Self {
            prior,
            view,
            draws: PoseDraws::new(prior, camera.xy()).poses().map(drawn).collect(),
            camera_m: center(&prior.pose),
            around_m: around(prior, params.sure_sigmas).iter().map(center).collect(),
            obstacles,
            params,
        }
    }
}

/// Covariance of pose, extrinsics and intrinsics.
pub(super) fn common_covariance(prior: &Pose2Covariance, view: &CameraView<'_>) -> CommonMatrix {
    let mut common = CommonMatrix::zeros();
    common.fixed_view_mut::<3, 3>(0, 0).copy_from(&prior.covariance);
    common.fixed_view_mut::<6, 6>(3, 3).copy_from(&view.mounting.covariance);
    let sigmas = view.intrinsics.error_sigmas();
    common.fixed_view_mut::<3, 3>(9, 9).set_diagonal(&sigmas.component_mul(&sigmas));
    common
}

/// Poses on both sides of the prior along the axes of its position, `sigmas` away.
fn around(prior: &Pose2Covariance, sigmas: f64) -> Vec<Pose2> {
    let eigen = SymmetricEigen::new(Matrix2::from(prior.covariance.fixed_view::<2, 2>(0, 0)));
    let axes = (0..2).map(|k| eigen.eigenvectors.column(k) * (sigmas * eigen.eigenvalues[k].max(0.0).sqrt()));
    axes.flat_map(|d| [d, -d]).map(|d| prior.pose.plus(&Vector3::new(d.x, d.y, 0.0))).collect()
}

impl Frame<'_> {
    /// Whether a place is within range on the floor, or not a number.
    pub(super) fn is_near(&self, place: &LandmarkPlace) -> bool {
        let far = (place.x_m - self.camera_m.x).hypot(place.y_m - self.camera_m.y) > self.params.max_range_m;
        !far
    }

    /// What the image shows of one landmark; `None` when it is left out.
    pub(super) fn expected(&self, known: &KnownLandmark<'_>) -> Option<Expected> {
        let (place, p) = (known.place, self.params);
        let range_m = (Point3::new(place.x_m, place.y_m, place.z_m) - self.camera_m).norm();
        let incidence_rad = place.incidence_rad(&self.camera_m);
        if range_m > p.max_range_m || incidence_rad >= FRAC_PI_2 {
            return None;
        }
        let camera = self.view.camera();
        let corners_px = corners(&self.prior.pose, place, &camera)?;
        let visible_px = clipped(&corners_px, self.view.image_px);
        let share = polygon::area(&visible_px) / polygon::area(&corners_px);
        if !polygon::is_convex(&corners_px) || share.is_nan() || share < p.min_image_share {
            return None;
        }
        let (by_common, by_place) = derivatives(&self.prior.pose, place, &camera, &corners_px)?;
        let by_place_px2 = symmetric(&(by_place * place.covariance * by_place.transpose()));
        let own = by_place_px2 + self.not_linear(place, &corners_px, &by_common);
        let common = common_covariance(self.prior, self.view);
        let covariance_px2 = symmetric(&(by_common * common * by_common.transpose() + own));
        if covariance_px2.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let gates = std::array::from_fn(|c| self.gate(&corners_px[c], &covariance_px2, c));
        let gate_px = gates.iter().map(|g| g.half_extent_px().max()).fold(0.0, f64::max);
        let side_px = shortest_side_px(&corners_px);
        let (unoccluded_share, around_share, is_free) = self.occlusion(known);
        let view = if side_px < p.min_side_px {
            InView::TooSmall { side_px }
        } else if incidence_rad > p.max_incidence_rad {
            InView::TooOblique { incidence_rad }
        } else if unoccluded_share < p.min_unoccluded_share {
            InView::Occluded { unoccluded_share }
        } else if gate_px > p.max_gate_px {
            InView::TooUncertain { gate_px }
        } else if share < 1.0 - 1e-9 {
            InView::Cut { visible_px, share }
        } else {
            InView::Full
        };
        let is_sure = view == InView::Full && is_free && self.is_well_inside(&corners_px, &covariance_px2);
        Some(Expected {
            landmark: known.landmark,
            view,
            corners_px,
            covariance_px2,
            gates,
            range_m,
            incidence_rad,
            side_px,
            unoccluded_share,
            is_sure,
            is_hidden: around_share <= 0.0,
            place: *place,
            by_place_px2,
        })
    }

    /// Second moment of what the derivative by the pose leaves over, over draws of the pose. A draw
    /// from which a corner has no pixel counts as far off as the image is large.
    fn not_linear(
        &self,
        place: &LandmarkPlace,
        at_px: &[Point2<f64>; 4],
        by_common: &ByCommon,
    ) -> CornerMatrix {
        let (mut sum, mut count) = (CornerMatrix::zeros(), 0.0);
        let mean = corner_vector(at_px);
        let by_pose = by_common.fixed_columns::<3>(0);
        let lost_px2 = self.view.image_px.iter().map(|side| side * side).sum::<f64>();
        let points_m = corners_m(place);
        for (camera_from_map, error) in &self.draws {
            count += 1.0;
            match project(camera_from_map, &points_m, self.view.intrinsics) {
                Some(drawn_px) => {
                    let left = corner_vector(&drawn_px) - mean - by_pose * error;
                    sum += left * left.transpose();
                }
                None => sum += CornerMatrix::identity() * lost_px2,
            }
        }
        sum / count
    }

    fn gate(&self, corner_px: &Point2<f64>, covariance_px2: &CornerMatrix, c: usize) -> SearchGate {
        let measured = Matrix2::identity() * self.params.corner_sigma_px.powi(2);
        let predicted: Matrix2<f64> = covariance_px2.fixed_view::<2, 2>(2 * c, 2 * c).into();
        SearchGate {
            center_px: *corner_px,
            covariance_px2: predicted + measured,
            chi2: self.params.gate_chi2,
        }
    }

    /// Share in sight from the prior pose; largest share in sight from there and around; whether
    /// all is in sight from all of them.
    fn occlusion(&self, known: &KnownLandmark<'_>) -> (f64, f64, bool) {
        let share = |camera: &Point3<f64>| {
            if known.visible.is_some_and(|area| area.contains(&camera.xy())) {
                return 1.0;
            }
            unoccluded_share(camera, known.place, self.obstacles, self.params.standoff_m)
        };
        let here = share(&self.camera_m);
        let (mut most, mut least) = (here, here);
        for camera in &self.around_m {
            let there = share(camera);
            (most, least) = (most.max(there), least.min(there));
        }
        (here, most, least >= 1.0)
    }

    fn is_well_inside(&self, corners_px: &[Point2<f64>; 4], covariance_px2: &CornerMatrix) -> bool {
        let [width, height] = self.view.image_px;
        corners_px.iter().enumerate().all(|(c, px)| {
            let room = |value: f64, side: f64, k: usize| {
                let margin = self.params.sure_sigmas * covariance_px2[(k, k)].max(0.0).sqrt();
                value - margin >= -0.5 && value + margin <= side - 0.5
            };
            room(px.x, width, 2 * c) && room(px.y, height, 2 * c + 1)
        })
    }
}

fn symmetric(m: &CornerMatrix) -> CornerMatrix {
    0.5 * (m + m.transpose())
}
