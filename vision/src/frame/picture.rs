//! A picture: grey levels always, and the planes of its colour where the camera gave them. Edges
//! are searched in all planes; texture (points, icons, grey levels beside a side) is read from the
//! grey one alone.

use crate::frame::image::{FrameError, GrayImage};

/// Weights of red, green and blue in grey, of 65 536: ITU-R BT.601, the Y of JPEG.
const GREY_WEIGHTS: [u32; 3] = [19_595, 38_470, 7_471];

/// Red, green and blue.
pub const COLOUR_PLANES: usize = 3;

/// Grey level of a colour: ITU-R BT.601 luma, the Y of JPEG, rounded. Of equal `red`, `green` and
/// `blue` it is their level.
pub fn luma(red: u8, green: u8, blue: u8) -> u8 {
    let [r, g, b] = GREY_WEIGHTS;
    ((r * u32::from(red) + g * u32::from(green) + b * u32::from(blue) + 32_768) >> 16) as u8
}

/// A grey image with, for a colour picture, its red, green and blue planes of the same size.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    grey: GrayImage,
    /// Boxed: a grey picture is as small as its image.
    colour: Option<Box<[GrayImage; COLOUR_PLANES]>>,
}

impl Picture {
    /// A grey image with its red, green and blue planes. Planes that are all equal say no more than
    /// the grey image and are dropped. Error: a plane is not as large as the grey image.
    pub fn with_colour(grey: GrayImage, planes: [GrayImage; COLOUR_PLANES]) -> Result<Self, FrameError> {
        let size = |image: &GrayImage| (image.width(), image.height());
        if let Some(other) = planes.iter().find(|plane| size(plane) != size(&grey)) {
            let ((width, height), (plane_width, plane_height)) = (size(&grey), size(other));
            return Err(FrameError::Planes { width, height, plane_width, plane_height });
        }
        let is_grey = planes[0] == planes[1] && planes[1] == planes[2];
        Ok(Self { grey, colour: (!is_grey).then(|| Box::new(planes)) })
    }

    /// A picture of red, green and blue planes; grey is their [`luma`]. Error: the planes differ in
    /// size.
    pub fn from_colour(planes: [GrayImage; COLOUR_PLANES]) -> Result<Self, FrameError> {
        let [red, green, blue] = planes.each_ref().map(GrayImage::data);
        let data = red.iter().zip(green).zip(blue).map(|((r, g), b)| luma(*r, *g, *b)).collect();
        // Planes of different sizes are named by the check of the picture.
        let grey = GrayImage::new(planes[0].width(), planes[0].height(), data);
        Self::with_colour(grey.unwrap_or_else(|_| planes[0].clone()), planes)
    }

    /// Builds a colour picture from a function of (u, v) to red, green and blue. Panics on a size
    /// outside the limits: for generated pictures only.
    pub fn from_fn(width: usize, height: usize, mut f: impl FnMut(usize, usize) -> [u8; 3]) -> Self {
        let pixels: Vec<[u8; 3]> = (0..width * height).map(|i| f(i % width, i / width)).collect();
        let plane = |i: usize| GrayImage::from_fn(width, height, |u, v| pixels[v * width + u][i]);
        Self::from_colour([plane(0), plane(1), plane(2)]).expect("planes of one size")
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.grey.width()
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.grey.height()
    }

    /// The grey image.
    pub fn grey(&self) -> &GrayImage {
        &self.grey
    }

    /// The grey image alone.
    pub fn into_grey(self) -> GrayImage {
        self.grey
    }

    /// Red, green and blue; none of a grey picture.
    pub fn colour(&self) -> Option<&[GrayImage; COLOUR_PLANES]> {
        self.colour.as_deref()
    }

    /// Bytes of all planes.
    pub fn bytes(&self) -> usize {
        let planes = if self.colour.is_some() { 1 + COLOUR_PLANES } else { 1 };
        planes * self.width() * self.height()
    }

    /// Every plane passed through `f`, which must depend on the size alone in what size it returns.
    #[must_use]
    pub fn map(&self, f: impl Fn(&GrayImage) -> GrayImage) -> Self {
        PictureRef::from(self).map(f)
    }
}

impl From<GrayImage> for Picture {
    fn from(grey: GrayImage) -> Self {
        Self { grey, colour: None }
    }
}

/// A picture, borrowed: a grey image is one, too.
#[derive(Debug, Clone, Copy)]
pub struct PictureRef<'a> {
    grey: &'a GrayImage,
    colour: Option<&'a [GrayImage; COLOUR_PLANES]>,
}

impl<'a> PictureRef<'a> {
    /// Width in pixels.
    pub fn width(self) -> usize {
        self.grey.width()
    }

    /// Height in pixels.
    pub fn height(self) -> usize {
        self.grey.height()
    }

    /// The grey image.
    pub fn grey(self) -> &'a GrayImage {
        self.grey
    }

    /// Red, green and blue; none of a grey picture.
    pub fn colour(self) -> Option<&'a [GrayImage; COLOUR_PLANES]> {
        self.colour
    }

    /// Every plane passed through `f`, see [`Picture::map`].
    #[must_use]
    pub fn map(self, f: impl Fn(&GrayImage) -> GrayImage) -> Picture {
        Picture { grey: f(self.grey), colour: self.colour.map(|planes| Box::new(planes.each_ref().map(&f))) }
    }
}

impl<'a> From<&'a GrayImage> for PictureRef<'a> {
    fn from(grey: &'a GrayImage) -> Self {
        Self { grey, colour: None }
    }
}

impl<'a> From<&'a Picture> for PictureRef<'a> {
    fn from(picture: &'a Picture) -> Self {
        Self { grey: &picture.grey, colour: picture.colour() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(width: usize, height: usize, level: usize) -> GrayImage {
        GrayImage::from_fn(width, height, |u, v| (level + 3 * u + 7 * v) as u8)
    }

    #[test]
    fn grey_is_the_luma_of_the_planes() {
        let picture = Picture::from_colour([plane(4, 3, 200), plane(4, 3, 20), plane(4, 3, 90)]).unwrap();
        for (v, u) in (0..3).flat_map(|v| (0..4).map(move |u| (v, u))) {
            let [r, g, b] = picture.colour().unwrap().each_ref().map(|p| f64::from(p.at(u, v)));
            let wanted = 0.299 * r + 0.587 * g + 0.114 * b;
            assert!((f64::from(picture.grey().at(u, v)) - wanted).abs() <= 0.51);
        }
        assert!((0..=255).all(|level| luma(level, level, level) == level));
        assert_eq!(picture.bytes(), 48);
    }

    #[test]
    fn planes_that_are_all_equal_make_a_grey_picture() {
        let grey = plane(4, 3, 50);
        let picture = Picture::from_colour([grey.clone(), grey.clone(), grey.clone()]).unwrap();
        assert_eq!(picture, Picture::from(grey.clone()));
        assert_eq!(picture.bytes(), 12);
        let other = Picture::from_colour([grey.clone(), grey.clone(), plane(4, 3, 51)]).unwrap();
        assert!(other.colour().is_some());
    }

    #[test]
    fn planes_of_another_size_are_refused() {
        let (grey, small) = (plane(4, 3, 0), plane(3, 4, 9));
        let error = Picture::with_colour(grey.clone(), [grey.clone(), grey.clone(), small.clone()]);
        assert_eq!(error, Err(FrameError::Planes { width: 4, height: 3, plane_width: 3, plane_height: 4 }));
        for planes in [[small.clone(), grey.clone(), grey.clone()], [grey, plane(2, 1, 5), small]] {
            assert!(matches!(Picture::from_colour(planes), Err(FrameError::Planes { .. })));
        }
    }

    #[test]
    fn every_plane_is_mapped() {
        let picture = Picture::from_fn(4, 3, |u, v| [u as u8, v as u8, 9]);
        let turned = picture.map(|p| GrayImage::from_fn(3, 4, |u, v| p.at(v, u)));
        assert_eq!(turned, Picture::from_fn(3, 4, |u, v| [v as u8, u as u8, 9]));
    }
}
