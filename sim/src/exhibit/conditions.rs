//! Conditions under which a picture is photographed.

use crate::{seed, sensor::SensorParams};
use rand::RngExt;
use serde::{Deserialize, Serialize};

/// A shadow whose edge crosses the picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Shadow {
    /// Share of the light that it takes, 0 to 1.
    pub depth: f64,
    /// Direction into the shadow, from the picture's right towards its bottom.
    pub direction_rad: f64,
    /// How far its edge is from the picture's centre along that direction, in sides of the picture.
    pub offset: f64,
}

/// Viewpoint, light, cover, sensor and compression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Conditions {
    /// Angle between the picture's normal and the line of sight in the horizontal plane, at most
    /// `MAX_ANGLE_RAD` either way.
    pub yaw_rad: f64,
    /// The same in the vertical plane.
    pub pitch_rad: f64,
    /// Roll of the camera.
    pub roll_rad: f64,
    /// Square root of the area that the picture would have from the front at the same distance, in
    /// pixels.
    pub size_px: f64,
    /// Offset of the picture's centre from the image's, in pixels.
    pub aim_px: [f64; 2],
    /// Share of the light that is lost from the bright side of the picture to the other, 0 to 1.
    pub side_light: f64,
    /// Direction in which it gets darker, from the picture's right towards its bottom.
    pub side_light_rad: f64,
    /// A shadow on wall and picture.
    pub shadow: Option<Shadow>,
    /// Share of the picture's area that a plain rectangle in its middle hides, 0 to 1.
    pub cover: f64,
    /// Its brightness, 0 to 255.
    pub cover_grey: f64,
    /// Exposure, lens and noise of the sensor.
    pub sensor: SensorParams,
    /// Quality of JPEG compression, 1 to 100; `None`: none.
    pub jpeg: Option<u8>,
    /// Brightness of the wall, as a share of its plaster's own.
    pub wall: f64,
}

impl Default for Conditions {
    fn default() -> Self {
        Self {
            yaw_rad: 0.0,
            pitch_rad: 0.0,
            roll_rad: 0.0,
            size_px: 160.0,
            aim_px: [0.0; 2],
            side_light: 0.0,
            side_light_rad: 0.0,
            shadow: None,
            cover: 0.0,
            cover_grey: 128.0,
            sensor: SensorParams::ideal(),
            jpeg: None,
            wall: 1.0,
        }
    }
}

impl Conditions {
    /// Typical conditions of a robot's camera: slightly tilted, with some blur, noise and
    /// compression, and light that differs a little from that of the lesson. Another `draw` gives
    /// other conditions.
    pub fn realistic(draw: u64) -> Self {
        let mut rng = seed::stream(draw, 0x6578_6869);
        let mut within = |low: f64, high: f64| rng.random_range(low..=high);
        let sensor = SensorParams {
            exposure: within(-0.22, 0.22).exp(),
            offset: within(-8.0, 8.0),
            blur_sigma_px: within(0.3, 0.9),
            motion_px: [within(-1.0, 1.0), within(-0.4, 0.4)],
            read_noise: within(0.8, 3.0),
            shot_noise: 0.012,
            vignetting: 0.0,
        };
        Self {
            yaw_rad: within(-0.5, 0.5),
            pitch_rad: within(-0.15, 0.15),
            roll_rad: within(-0.05, 0.05),
            size_px: within(90f64.ln(), 220f64.ln()).exp(),
            aim_px: [within(-40.0, 40.0), within(-25.0, 25.0)],
            side_light: within(0.0, 0.25),
            side_light_rad: within(0.0, std::f64::consts::TAU),
            cover_grey: within(20.0, 220.0),
            jpeg: (within(0.0, 1.0) < 0.6).then(|| within(70.0, 95.0) as u8),
            wall: within(0.45, 1.1),
            sensor,
            ..Self::default()
        }
    }
}
