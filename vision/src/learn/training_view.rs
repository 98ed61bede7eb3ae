//! A training view of a landmark: a photograph and the corners in it in, the rectified picture out.

use crate::{
    frame::GrayImage,
    geometry::corners::Corners,
    icon::{Icon, IconError, icon},
    params::Params,
};

/// One training view of a landmark.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingView {
    /// The rectified picture, cut out along corners as inexact as the detector's.
    pub icon: Icon,
    /// The same along its true corners, known for generated views: alignment with it is free of
    /// corner noise.
    pub exact: Option<Icon>,
    /// Its corners in the image.
    pub corners_px: Corners,
    /// Width and height of that image.
    pub image_size_px: [usize; 2],
    /// Generated from a photograph, not photographed: see [`crate::learn::synthesis`].
    pub generated: bool,
}

impl TrainingView {
    /// Cuts the landmark at `corners_px` out of a photograph.
    pub fn photographed(image: &GrayImage, corners_px: &Corners, p: &Params) -> Result<Self, IconError> {
        let icon = icon(image, corners_px, &p.icon)?;
        let image_size_px = [image.width(), image.height()];
        Ok(Self { icon, exact: None, corners_px: *corners_px, image_size_px, generated: false })
    }
}
