//! Photographs of a phone that is held upright: 12 megapixels, JPEG, stored on their side with the
//! orientation in their Exif. They show the office of the guides, with a frame around the poster
//! and the shadow that it casts.

use sim::{
    building::Building,
    camera::Camera,
    framing::Framing,
    office::{PHOTOGRAPHS, office, photograph},
    render::Renderer,
};
use std::{fs, path::Path};
use vision::frame::{Distortion, GrayImage, Intrinsics};

/// Focal length of the phone, px: that of 26 mm on 35 mm film.
pub const FOCAL_PX: f64 = 3004.0;
/// Width and height of a photograph as people see it.
pub const SIZE_PX: [usize; 2] = [3000, 4000];

/// A wooden frame of 3 cm on the poster, and its shadow: 12 mm, soft, by a lamp above to the left.
const FRAMING: Framing =
    Framing { width_m: 0.03, grey: 70, shadow_m: [0.008, 0.012], darkness: 0.35, penumbra_m: 0.006 };

/// Writes the photographs of `first-pose.md`: `poster1.jpg` to `poster3.jpg`, and `here.jpg`.
pub fn write(folder: &Path) {
    let building: Building = office().framed("poster-0", &FRAMING);
    let [width, height] = SIZE_PX;
    let centre = SIZE_PX.map(|side| 0.5 * (side as f64 - 1.0));
    let intrinsics = Intrinsics::new(FOCAL_PX, FOCAL_PX, centre[0], centre[1], Distortion::None);
    let mut renderer = Renderer::new(Camera::new(intrinsics.expect("a camera"), width, height));
    for (number, (name, standpoint)) in PHOTOGRAPHS.iter().enumerate() {
        if ["poster1.jpg", "poster2.jpg", "poster3.jpg", "here.jpg"].contains(name) {
            let image = photograph(&mut renderer, &building, standpoint, number as u64);
            fs::write(folder.join(name), on_its_side(&image)).expect("a photograph");
        }
    }
}

/// The JPEG file of a sensor that lies on its side: rows of the file are columns of the picture,
/// and the Exif says that a quarter turn clockwise makes it upright (orientation 6).
fn on_its_side(image: &GrayImage) -> Vec<u8> {
    let (width, height) = (image.width(), image.height());
    let mut stored = Vec::with_capacity(width * height);
    for x in (0..width).rev() {
        stored.extend(image.data().iter().skip(x).step_by(width));
    }
    let stored = GrayImage::new(height, width, stored).expect("as many pixels");
    let file = crate::guide_files::jpeg(&stored);
    let tiff = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    let head = [0xff, 0xd8, 0xff, 0xe1, 0, (tiff.len() + 2) as u8];
    [&head[..], tiff, &file[2..]].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::{
        decode::ImageLimits,
        picture::{decode, upright_size},
    };

    #[test]
    fn a_photograph_is_upright_again_when_it_is_read() {
        let image = GrayImage::from_fn(16, 32, |x, y| (x * 4 + y * 5) as u8);
        let file = on_its_side(&image);
        assert_eq!(upright_size(&file), Some([16, 32]));
        let read = decode(&file, ImageLimits::UPLOAD).expect("a picture");
        let worst = read.grey().data().iter().zip(image.data()).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst.expect("pixels") < 12, "{worst:?}");
    }
}
