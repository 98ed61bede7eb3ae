//! Writes pictures of the corridor and a sheet of posters as PNG files:
//! `cargo run -p sim --example pictures -- DIRECTORY [SEED]`.

use std::time::Instant;

use sim::building::Building;
use sim::camera::Camera;
use sim::posters::poster_of_size;
use sim::render::Renderer;
use sim::sensor::SensorParams;
use vision::frame::GrayImage;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let directory = arguments.next().unwrap_or_else(|| ".".into());
    let seed = arguments.next().map_or(Ok(1), |s| s.parse())?;
    let building = Building::corridor(seed);
    let mut renderer = Renderer::new(Camera::vga());
    for i in 0..10_u64 {
        let (x, y) = (1.0 + 2.4 * i as f64, 0.35 * (i as f64).sin());
        let pan = [0.0, 0.6, -0.6, 0.9][i as usize % 4];
        let robot = map::pose2::Pose2::new(x, y, 0.0).to_isometry3();
        let camera = map::extrinsics::pan_tilt(pan, 0.0, nalgebra::Vector3::new(0.0, 0.0, 1.2));
        let start = Instant::now();
        let rendered = renderer.render(&building, &(robot * camera), &SensorParams::default(), i);
        let took = start.elapsed();
        save(&rendered.image, &format!("{directory}/corridor-{i}.png"))?;
        let states = rendered
            .truth
            .landmarks
            .iter()
            .map(|l| format!("{} {:?} {:.2}", l.name, l.state, l.occluded_share));
        eprintln!("{i}: {took:.1?}  {}", states.collect::<Vec<_>>().join(", "));
    }
    let (columns, width, height) = (12, 110, 154);
    let posters: Vec<_> = (0..48).map(|i| poster_of_size(seed * 1000 + i, 100, 1.4)).collect();
    let sheet = GrayImage::from_fn(columns * width, 4 * height, |u, v| {
        let (x, y) = (u % width, v % height);
        let texture = &posters[v / height * columns + u / width];
        if x < texture.width() && y < texture.height() {
            texture.data()[y * texture.width() + x]
        } else {
            128
        }
    });
    save(&sheet, &format!("{directory}/posters.png"))
}

fn save(image: &GrayImage, path: &str) -> Result<(), Box<dyn std::error::Error>> {
    let size = (image.width() as u32, image.height() as u32);
    Ok(image::save_buffer(path, image.data(), size.0, size.1, image::ExtendedColorType::L8)?)
}
