//! The surroundings of a quad, rectified, in which its corners may move: at a third of the icon's
//! resolution for the coarse level, at full resolution for the fine ones, each computed on first
//! use.

use crate::{
    frame::GrayImage,
    geometry::{corners::Corners, homography::Homography},
    icon::{Icon, sample_cells},
    recognise::{
        alignment::{align_params::AlignParams, sampling_grid::PaddedIcon},
        features::harris::blurred,
    },
};
use nalgebra::{Matrix3, Point2};
use std::cell::OnceCell;

/// Icon pixels along the side of a pixel of the coarse level.
const COARSE: usize = 3;

/// Side of the coarse picture of an icon.
pub(crate) fn coarse_size(size: usize) -> usize {
    size / COARSE
}

/// The icon at a third of its resolution, smoothed for the coarse level.
pub fn coarse(icon: &Icon, p: &AlignParams) -> Vec<f32> {
    let size = coarse_size(icon.size);
    blurred(&thirds(icon), size, coarse_sigma(icon.size, p))
}

fn coarse_sigma(size: usize, p: &AlignParams) -> f64 {
    p.sigmas[0] * coarse_size(size) as f64 / size as f64
}

/// Means over the cells of the coarse grid.
fn thirds(icon: &Icon) -> Vec<f32> {
    let size = coarse_size(icon.size);
    let edge = |i: usize| i * icon.size / size.max(1);
    let mean = |i: usize| {
        let (columns, rows) = (edge(i % size)..edge(i % size + 1), edge(i / size)..edge(i / size + 1));
        let count = (columns.len() * rows.len()) as f32;
        rows.map(|y| icon.pixels[y * icon.size..][columns.clone()].iter().sum::<f32>()).sum::<f32>() / count
    };
    (0..size * size).map(mean).collect()
}

/// Source of the pixels around an icon.
#[derive(Debug)]
enum Around<'a> {
    /// The image that the icon was cut from.
    Image(&'a GrayImage),
    /// No image: the icon's border pixels are repeated.
    Nothing,
}

/// The surroundings of an icon. The icon itself lies in the middle as it was cut.
#[derive(Debug)]
pub struct Surroundings<'a> {
    pub(crate) image_from_icon: Homography,
    pub(crate) icon: &'a Icon,
    around: Around<'a>,
    /// Pixels around the coarse and the full icon.
    margins: [usize; 2],
    coarse: OnceCell<Vec<f32>>,
    full: OnceCell<Vec<f32>>,
    /// The picture of the second level.
    smooth: OnceCell<Vec<f32>>,
}

impl<'a> Surroundings<'a> {
    /// Of `icon`, cut from `image` along `corners_px`. `None` when the quad is too close to the
    /// horizon.
    pub fn new(image: &'a GrayImage, corners_px: &Corners, icon: &'a Icon, p: &AlignParams) -> Option<Self> {
        let image_from_icon = Homography::square_to_quad(icon.size, corners_px).ok()?;
        let all = Self::with(image_from_icon, icon, Around::Image(image), p)?;
        let reach = all.margins[1].max(COARSE * all.margins[0] + COARSE) as f64;
        let (low, high) = (-0.5 - reach, icon.size as f64 - 0.5 + reach);
        let wide = [[low, low], [high, low], [high, high], [low, high]].map(Point2::from);
        wide.iter().all(|c| all.image_from_icon.denominator(c) > 0.0).then_some(all)
    }

    /// An icon alone, its border pixels repeated around it: for icons without their image.
    pub fn of_icon(icon: &'a Icon, p: &AlignParams) -> Option<Self> {
        Self::with(Homography::from_matrix(Matrix3::identity())?, icon, Around::Nothing, p)
    }

    fn with(
        image_from_icon: Homography,
        icon: &'a Icon,
        around: Around<'a>,
        p: &AlignParams,
    ) -> Option<Self> {
        let margin = |size: usize| (p.max_shift.clamp(0.0, 0.5) * size as f64).ceil() as usize + 1;
        let margins = [margin(coarse_size(icon.size)), margin(icon.size)];
        (icon.pixels.len() == icon.size * icon.size && coarse_size(icon.size) > 0).then(|| Self {
            image_from_icon,
            icon,
            around,
            margins,
            coarse: OnceCell::new(),
            full: OnceCell::new(),
            smooth: OnceCell::new(),
        })
    }

    /// The picture of the coarse level.
    pub(crate) fn coarse(&self, p: &AlignParams) -> PaddedIcon<'_> {
        let size = coarse_size(self.icon.size);
        let (margin, width) = (self.margins[0], size + 2 * self.margins[0]);
        let pixels = self.coarse.get_or_init(|| {
            let scale = self.icon.size as f64 / size as f64;
            let shift = 0.5 * scale - 0.5;
            let icon_from_coarse = Matrix3::new(scale, 0.0, shift, 0.0, scale, shift, 0.0, 0.0, 1.0);
            let map = Homography::from_matrix(self.image_from_icon.matrix() * icon_from_coarse);
            let wide = self.framed(&thirds(self.icon), size, margin, map.as_ref());
            blurred(&wide, width, coarse_sigma(self.icon.size, p))
        });
        PaddedIcon { pixels, width, margin }
    }

    /// The picture, not smoothed.
    pub(crate) fn full(&self) -> PaddedIcon<'_> {
        let (size, margin) = (self.icon.size, self.margins[1]);
        let map = Some(&self.image_from_icon);
        let pixels = self.full.get_or_init(|| self.framed(&self.icon.pixels, size, margin, map));
        PaddedIcon { pixels, width: size + 2 * margin, margin }
    }

    /// The same, smoothed.
    pub(crate) fn smooth(&self, sigma: f64) -> PaddedIcon<'_> {
        let full = self.full();
        let pixels = self.smooth.get_or_init(|| blurred(full.pixels, full.width, sigma));
        PaddedIcon { pixels, ..full }
    }

    /// `inner` of `size` with `margin` pixels around, from the image or, without a map into one,
    /// from its own border.
    fn framed(&self, inner: &[f32], size: usize, margin: usize, map: Option<&Homography>) -> Vec<f32> {
        let width = size + 2 * margin;
        let inside = |i: usize| i.saturating_sub(margin).min(size - 1);
        let mut pixels = Vec::with_capacity(width * width);
        for row in 0..width {
            pixels.extend((0..width).map(|column| inner[inside(row) * size + inside(column)]));
        }
        let (Around::Image(image), Some(map)) = (&self.around, map) else { return pixels };
        let per_cell = self.icon.source_scale * self.icon.size as f64 / size as f64;
        let first = -(margin as i32);
        for (line, row) in pixels.chunks_exact_mut(width).zip(first..) {
            let (left, right) = line.split_at_mut(width - margin);
            if (0..size as i32).contains(&row) {
                sample_cells(image, map, first, row, per_cell, &mut left[..margin]);
                sample_cells(image, map, size as i32, row, per_cell, right);
            } else {
                sample_cells(image, map, first, row, per_cell, line);
            }
        }
        pixels
    }
}
