use super::*;
use crate::{
    detect::{
        edges::{
            deriche::{gradients, tests::levels},
            edge_map::{EdgeParams, edges},
            maxima::Maxima,
        },
        tests::rendering::Noise,
    },
    frame::Picture,
};
use fearless_simd::{Level, dispatch};

type Gradients = (Vec<f32>, Vec<f32>);

fn of_grey(image: &GrayImage) -> Gradients {
    let (mut gx, mut gy) = (vec![0.0; image.data().len()], vec![0.0; image.data().len()]);
    let mut memory = FilterMemory::default();
    dispatch!(Level::new(), s => gradients(s, image, 1.0, &mut memory, [&mut gx, &mut gy], &mut ()));
    (gx, gy)
}

fn of_colour(level: Level, planes: &[GrayImage; COLOUR_PLANES], found: &mut Maxima) -> Gradients {
    let n = planes[0].data().len();
    let (mut gx, mut gy) = (vec![0.0; n], vec![0.0; n]);
    let mut memory = ColourMemory::default();
    found.restart(planes[0].width(), planes[0].height(), 6.0);
    dispatch!(level, s => colour_gradients(s, planes, 1.0, &mut memory, [&mut gx, &mut gy], found));
    (gx, gy)
}

fn bits((gx, gy): &Gradients) -> Vec<[u32; 2]> {
    gx.iter().zip(gy).map(|(x, y)| [x.to_bits(), y.to_bits()]).collect()
}

fn texture(width: usize, height: usize, seed: usize) -> GrayImage {
    GrayImage::from_fn(width, height, |u, v| {
        let step = if (3 + seed) * u + v > 80 { 30 * seed } else { 0 };
        (step + u * u * (5 + seed) % 17 + v * v * 7 % (23 + seed)) as u8
    })
}

#[test]
fn every_instruction_set_gives_the_bits_of_the_choice_pixel_by_pixel() {
    for (width, height) in [(1, 1), (3, 3), (5, 5), (20, 37), (37, 20), (131, 70)] {
        let planes = [1, 2, 3].map(|seed| texture(width, height, seed));
        let each = planes.each_ref().map(of_grey);
        let pixel = |at: usize| strongest_of(each.each_ref().map(|(gx, gy)| [gx[at], gy[at]]));
        let wanted: Vec<_> = (0..width * height).map(|at| pixel(at).map(f32::to_bits)).collect();
        let mut maxima = Vec::new();
        for (i, level) in levels().into_iter().enumerate() {
            let mut found = Maxima::default();
            let gradients = of_colour(level, &planes, &mut found);
            assert!(bits(&gradients) == wanted, "level {i} {width}x{height}");
            maxima.push(found.found);
        }
        assert!(maxima.windows(2).all(|w| w[0] == w[1]) && (height < 48 || maxima[0].len() > 60));
    }
}

#[test]
fn equal_planes_give_the_gradient_of_grey_bit_for_bit() {
    let grey = texture(131, 70, 2);
    let planes = [grey.clone(), grey.clone(), grey.clone()];
    assert!(bits(&of_colour(Level::new(), &planes, &mut Maxima::default())) == bits(&of_grey(&grey)));
}

#[test]
fn the_strongest_plane_gives_the_gradient() {
    // Steps of red, green and blue, and the step expected: signed as grey, or as itself where grey
    // hardly changes.
    let cases = [
        ([40, 10, 0], 40.0),
        ([10, 40, -5], 40.0),
        ([0, 5, 60], 60.0),
        // Red falls most, grey rises: 0.299 * -40 + 0.587 * 38 = 10.3.
        ([-40, 38, 0], 40.0),
        // Grey falls by 0.7, less than a sixth.
        ([0, -13, 60], 60.0),
        // Grey falls by 17, more than a sixth.
        ([0, -40, 60], -60.0),
        ([0, 0, 0], 0.0),
    ];
    for (steps, wanted) in cases {
        let planes =
            steps.map(|step| GrayImage::from_fn(40, 30, |u, _| (100 + if u < 20 { 0 } else { step }) as u8));
        let (gx, gy) = of_colour(Level::new(), &planes, &mut Maxima::default());
        for at in [15 * 40 + 19, 15 * 40 + 20] {
            assert!(
                (gx[at] - wanted).abs() < 0.01 && gy[at].abs() < 0.01,
                "{steps:?}: {} {}",
                gx[at],
                gy[at]
            );
        }
    }
}

#[test]
fn the_sign_is_the_same_all_along_an_edge_between_two_colours_of_equal_grey() {
    // A slanted edge between two colours of grey 120, with noise; round the circle of hues.
    let mut random = Noise(5);
    for i in 0..36 {
        let hue = f64::from(i) * std::f64::consts::TAU / 36.0;
        let (red, blue) = (50.0 * hue.cos(), 50.0 * hue.sin());
        let green = -(0.299 * red + 0.114 * blue) / 0.587;
        let picture = Picture::from_fn(80, 60, |u, v| {
            let side = if 4 * u + v < 190 { -0.5 } else { 0.5 };
            [red, green, blue].map(|step| (120.0 + side * step + 1.5 * random.gaussian()).round() as u8)
        });
        let grey: Vec<u8> = [(10, 30), (70, 30)].map(|(u, v)| picture.grey().at(u, v)).to_vec();
        assert!(grey[0].abs_diff(grey[1]) < 8, "{grey:?}");
        let map = edges(&picture, &EdgeParams::default());
        let along = map.pixels().iter().filter(|at| {
            let (u, v) = (**at as usize % 80, **at as usize / 80);
            (4 * u + v).abs_diff(190) < 8 && (5..55).contains(&v)
        });
        let signs: Vec<bool> = along.map(|at| map.gx()[*at as usize] > 0.0).collect();
        let rising = signs.iter().filter(|s| **s).count();
        assert!(signs.len() >= 48, "hue {i}: {} points", signs.len());
        assert!(rising == 0 || rising == signs.len(), "hue {i}: {rising} of {}", signs.len());
    }
}
