//! Intrinsics of a camera for a picture of another size than it was calibrated with.

use crate::frame::intrinsics::{Intrinsics, IntrinsicsSigmas};

/// Largest difference of the ratios of sides of a picture that was only made smaller: a row or
/// column is lost in rounding, and sensors crop a few.
const MAX_ASPECT_OFF: f64 = 0.01;
/// Farthest principal point from the middle, as a share of the side, of a calibration that does not
/// say of which size of picture it is. Real ones are within a twentieth; that of a picture of twice
/// the size is a half off.
const MAX_CENTRE_OFF: f64 = 0.2;

/// Why intrinsics are not those of a picture. Sizes are width and height, px.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PictureSizeError {
    /// The camera was held the other way.
    #[error(
        "the camera is calibrated for pictures of {0}x{1} px and this one has {2}x{3}: it was held the other way. \
         Calibrate it with photographs that were held as this one"
    )]
    Turned(usize, usize, usize, usize),
    /// Something was cut off, or it is another camera.
    #[error(
        "the camera is calibrated for pictures of {0}x{1} px and this one has {2}x{3}, which is no other scale of that. \
         Calibrate it with photographs of this size"
    )]
    Aspect(usize, usize, usize, usize),
    /// The principal point is far off the middle, and nothing says that it is of this size.
    #[error(
        "the principal point ({0:.1}, {1:.1}) is far off the middle of {2}x{3} px: the intrinsics are of another picture. \
         If they are of this one, state its size with them: width_px and height_px"
    )]
    Centre(f64, f64, usize, usize),
}

impl Intrinsics {
    /// The intrinsics for a picture of this size (width, height), if they are stated to be of
    /// another one, or none. Errors: the other size has other proportions; without one, the
    /// principal point is far off the middle.
    pub fn for_picture(
        &self,
        stated: Option<[usize; 2]>,
        picture: [usize; 2],
    ) -> Result<Self, PictureSizeError> {
        let [width, height] = picture;
        let Some(stated) = stated else {
            let off = |centre: f64, side: usize| (centre + 0.5) / side as f64 - 0.5;
            let is_off = off(self.cx_px, width).abs().max(off(self.cy_px, height).abs()) > MAX_CENTRE_OFF;
            let error = PictureSizeError::Centre(self.cx_px, self.cy_px, width, height);
            return if is_off { Err(error) } else { Ok(*self) };
        };
        let [by_x, by_y] = [0, 1].map(|i| picture[i] as f64 / stated[i] as f64);
        if stated == picture {
            return Ok(*self);
        }
        if (by_x / by_y - 1.0).abs() > MAX_ASPECT_OFF {
            let is_turned = stated == [height, width];
            let error = if is_turned { PictureSizeError::Turned } else { PictureSizeError::Aspect };
            return Err(error(stated[0], stated[1], width, height));
        }
        // Pixel 0 is the centre of the first one.
        let moved = |centre: f64, by: f64| (centre + 0.5) * by - 0.5;
        let sigmas = self
            .sigmas
            .map(|s| IntrinsicsSigmas { focal_px: s.focal_px * by_x, center_px: s.center_px * by_x });
        Ok(Self {
            fx_px: self.fx_px * by_x,
            fy_px: self.fy_px * by_y,
            cx_px: moved(self.cx_px, by_x),
            cy_px: moved(self.cy_px, by_y),
            distortion: self.distortion,
            sigmas,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Distortion;
    use nalgebra::Vector3;

    fn camera() -> Intrinsics {
        let lens = Distortion::PlumbBob([0.1, 0.01, 1e-3, 1e-3, 0.0]);
        let camera = Intrinsics::new(600.0, 610.0, 330.0, 239.5, lens).unwrap();
        camera.with_sigmas(IntrinsicsSigmas { focal_px: 2.0, center_px: 1.0 }).unwrap()
    }

    #[test]
    fn a_picture_of_another_scale_has_scaled_intrinsics() {
        let twice = camera().for_picture(Some([640, 480]), [1280, 960]).unwrap();
        // The corner between pixels stays where it is.
        let corner = |p: f64, by: f64| (p + 0.5) * by - 0.5;
        for point in [Vector3::new(0.3, -0.2, 1.0), Vector3::new(-0.5, 0.4, 1.1)] {
            let (small, large) = (camera().project(&point), twice.project(&point));
            assert!(
                (large.x - corner(small.x, 2.0)).abs() < 1e-9
                    && (large.y - corner(small.y, 2.0)).abs() < 1e-9
            );
        }
        assert_eq!(twice.sigmas, Some(IntrinsicsSigmas { focal_px: 4.0, center_px: 2.0 }));
        // A row was lost in rounding.
        assert!(camera().for_picture(Some([640, 480]), [320, 239]).is_ok());
        assert_eq!(camera().for_picture(Some([640, 480]), [640, 480]), Ok(camera()));
    }

    #[test]
    fn a_picture_that_is_no_other_scale_is_refused() {
        let of = |stated, picture| camera().for_picture(Some(stated), picture).unwrap_err();
        assert_eq!(of([640, 480], [480, 640]), PictureSizeError::Turned(640, 480, 480, 640));
        assert_eq!(of([640, 480], [1280, 720]), PictureSizeError::Aspect(640, 480, 1280, 720));
        assert_eq!(of([640, 480], [640, 490]), PictureSizeError::Aspect(640, 480, 640, 490));
    }

    #[test]
    fn a_principal_point_far_off_the_middle_is_refused_unless_stated() {
        assert_eq!(camera().for_picture(None, [640, 480]), Ok(camera()));
        assert_eq!(camera().for_picture(None, [660, 470]), Ok(camera()));
        for picture in [[1280, 960], [320, 240], [750, 1000]] {
            let [width, height] = picture;
            let error = PictureSizeError::Centre(330.0, 239.5, width, height);
            assert_eq!(camera().for_picture(None, picture), Err(error));
        }
        // A part of a sensor.
        let part = Intrinsics { cx_px: 20.0, ..camera() };
        assert!(part.for_picture(None, [640, 480]).is_err());
        assert_eq!(part.for_picture(Some([640, 480]), [640, 480]), Ok(part));
    }
}
