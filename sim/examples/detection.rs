//! Detection of the landmarks of a drive by `vision`, against exact truth:
//! `cargo run -p sim --example detection -- [SEED] [FRAMES] [DIRECTORY]`. With a directory, writes
//! the five frames with the largest corner error.

use std::sync::Arc;

use sim::building::{Building, LandmarkKind};
use sim::robot::{Robot, RobotParams, SensorReadings};
use sim::truth::{LandmarkView, ViewState};
use vision::detect::DetectParams;
use vision::detect::detect;
use vision::geometry::polygon::iou;
use vision::trace::NoTrace;
use vision::{detect::QuadKind, geometry::Corners};

/// Root mean square distance of the corners, for the best start corner.
fn corner_error_px(found: &Corners, truth: &Corners) -> f64 {
    let error = |shift: usize| {
        let turned = found.rotated(shift);
        let pairs = turned.points().iter().zip(truth.points());
        (pairs.map(|(a, b)| (a - b).norm_squared()).sum::<f64>() / 4.0).sqrt()
    };
    (0..4).map(error).fold(f64::INFINITY, f64::min)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let seed = arguments.next().map_or(Ok(1), |s| s.parse())?;
    let frames = arguments.next().map_or(Ok(60), |s| s.parse())?;
    let directory = arguments.next();
    let building = Arc::new(Building::corridor(seed));
    let mut params = RobotParams::default();
    params.drive.rate_hz = 2.0;
    let robot = Robot::new(building, &params);
    let (mut total, mut errors, mut other_quads, mut images) = (0, vec![], 0, 0);
    for readings in robot.take(frames) {
        let found = detect(&readings.frame.image, &DetectParams::default(), &mut NoTrace);
        let found: Vec<_> = found.into_iter().filter(|q| q.kind == QuadKind::Full).collect();
        images += 1;
        let landmarks = &readings.frame.truth.landmarks;
        other_quads += found
            .iter()
            .filter(|q| landmarks.iter().all(|l| iou(q.corners_px.points(), l.corners_px.points()) < 0.3))
            .count();
        let large = |l: &&LandmarkView| {
            l.kind == LandmarkKind::Poster && l.state == ViewState::Full && l.min_side_px() > 40.0
        };
        for l in landmarks.iter().filter(large) {
            total += 1;
            let every = found.iter().flat_map(|q| q.alternates.iter().chain([&q.corners_px]));
            let best = every.max_by(|a, b| {
                let overlap = |c: &Corners| iou(c.points(), l.corners_px.points());
                overlap(a).total_cmp(&overlap(b))
            });
            let error = best.filter(|c| iou(c.points(), l.corners_px.points()) > 0.7);
            let error = error.map_or(f64::INFINITY, |c| corner_error_px(c, &l.corners_px));
            errors.push((error, readings.clone(), l.clone()));
        }
    }
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let hits = errors.iter().filter(|e| e.0.is_finite()).count();
    let at = |share: f64| errors.get((share * hits as f64) as usize).map_or(f64::NAN, |e| e.0);
    eprintln!(
        "{images} images, {total} posters, {hits} found; corner error median {:.2} px, 90 % {:.2} px; {other_quads} other quads",
        at(0.5),
        at(0.9)
    );
    for (error, _, l) in errors.iter().rev().take(12) {
        eprintln!(
            "{} {error:.2} px at {:.1} m, {:.0} degrees, shortest side {:.0} px",
            l.name,
            l.distance_m,
            l.view_angle_rad.to_degrees(),
            l.min_side_px()
        );
    }
    if let Some(directory) = directory {
        for (i, (_, readings, _)) in errors.iter().rev().take(5).enumerate() {
            save(readings, &format!("{directory}/worst-{i}.png"))?;
        }
    }
    Ok(())
}

fn save(readings: &SensorReadings, path: &str) -> Result<(), Box<dyn std::error::Error>> {
    let image = &readings.frame.image;
    let size = (image.width() as u32, image.height() as u32);
    Ok(image::save_buffer(path, image.data(), size.0, size.1, image::ExtendedColorType::L8)?)
}
