//! A grey image, checked once: every later stage relies on its size and length.

/// Largest accepted image side, in pixels.
pub const MAX_SIDE_PX: usize = 8192;
/// Largest accepted image area, in pixels.
pub const MAX_AREA_PX: usize = 16 * 1024 * 1024;

/// Why an image or a camera cannot be used. `field` names the offending input.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// Width or height is zero or beyond the limit.
    #[error(
        "image of {width}x{height} px is outside 1x1 to {MAX_SIDE_PX} px a side and {MAX_AREA_PX} px in all"
    )]
    Size {
        /// Claimed width in pixels.
        width: usize,
        /// Claimed height in pixels.
        height: usize,
    },
    /// The buffer does not hold width x height bytes.
    #[error("image data has {actual} bytes, {expected} expected")]
    Length {
        /// Bytes given.
        actual: usize,
        /// Bytes that width x height ask for.
        expected: usize,
    },
    /// A colour plane is not as large as the grey image.
    #[error("a colour plane has {plane_width}x{plane_height} px, the picture {width}x{height}")]
    Planes {
        /// Width of the grey image in pixels.
        width: usize,
        /// Its height.
        height: usize,
        /// Width of the plane.
        plane_width: usize,
        /// Its height.
        plane_height: usize,
    },
    /// A camera parameter is not finite or not in its range.
    #[error("camera parameter {field} = {value} is out of range")]
    Intrinsics {
        /// Name of the parameter.
        field: &'static str,
        /// Its value.
        value: f64,
    },
}

/// An 8-bit grey image, row-major without padding. Pixel (u, v) is `data[v * width + u]`; its
/// centre has the integer coordinates (u, v).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GrayImage {
    width: usize,
    height: usize,
    data: Vec<u8>,
}

impl GrayImage {
    /// Checks size and length. `data` has exactly `width * height` bytes.
    pub fn new(width: usize, height: usize, data: Vec<u8>) -> Result<Self, FrameError> {
        if width == 0
            || height == 0
            || width > MAX_SIDE_PX
            || height > MAX_SIDE_PX
            || width * height > MAX_AREA_PX
        {
            return Err(FrameError::Size { width, height });
        }
        if data.len() != width * height {
            return Err(FrameError::Length { actual: data.len(), expected: width * height });
        }
        Ok(Self { width, height, data })
    }

    /// Builds an image from a function of (u, v). Panics on a size outside the limits: for
    /// generated images only.
    pub fn from_fn(width: usize, height: usize, mut f: impl FnMut(usize, usize) -> u8) -> Self {
        let data = (0..width * height).map(|i| f(i % width, i / width)).collect();
        Self::new(width, height, data).expect("generated image within the limits")
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Row-major grey levels.
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// Grey level at column `u`, row `v`.
    pub fn at(&self, u: usize, v: usize) -> u8 {
        self.data[v * self.width + u]
    }

    /// Bilinear grey level at `p_px`, coordinates clamped to the image.
    pub fn sample(&self, u_px: f64, v_px: f64) -> f32 {
        let u = u_px.clamp(0.0, (self.width - 1) as f64);
        let v = v_px.clamp(0.0, (self.height - 1) as f64);
        let (u0, v0) = (u as usize, v as usize);
        let (u1, v1) = ((u0 + 1).min(self.width - 1), (v0 + 1).min(self.height - 1));
        let (a, b) = ((u - u0 as f64) as f32, (v - v0 as f64) as f32);
        let at = |u, v| f32::from(self.at(u, v));
        (at(u0, v0) * (1.0 - a) + at(u1, v0) * a) * (1.0 - b) + (at(u0, v1) * (1.0 - a) + at(u1, v1) * a) * b
    }
}
