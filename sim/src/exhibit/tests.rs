//! Geometry, light, compression and bounds of exhibits.

use super::*;
use crate::{posters::poster, surfaces::plaster, texture::Edge};

fn paper() -> Texture {
    Texture::new(64, 64, vec![200; 64 * 64], Edge::Clamp)
}

fn mean(rendered: &Exhibit, x: f64, y: f64) -> f64 {
    let [a, b, c, d] = *rendered.corners.points();
    let at = a.coords * (1.0 - x) * (1.0 - y)
        + b.coords * x * (1.0 - y)
        + c.coords * x * y
        + d.coords * (1.0 - x) * y;
    f64::from(rendered.image.sample(at.x, at.y))
}

fn render(conditions: &Conditions) -> Exhibit {
    exhibit(&paper(), &plaster(1), conditions, Extent::Whole, 1).unwrap()
}

#[test]
fn corners_are_where_geometry_puts_them() {
    let rendered = render(&Conditions { size_px: 100.0, ..Conditions::default() });
    let expected = [[269.5, 189.5], [369.5, 189.5], [369.5, 289.5], [269.5, 289.5]];
    for (found, expected) in rendered.corners.points().iter().zip(expected) {
        assert!((found - Point2::from(expected)).norm() < 1e-9, "{found} {expected:?}");
    }
    // Turned by 60 degrees it is half as wide, and its height grows on the near side.
    let rendered =
        render(&Conditions { size_px: 100.0, yaw_rad: 60f64.to_radians(), ..Conditions::default() });
    let [a, b, c, d] = rendered.corners.points();
    assert!(((b - a).x - 50.0).abs() < 1.0, "{}", (b - a).x);
    assert!((d - a).norm() > 105.0 && (c - b).norm() < 95.0);
    assert!((mean(&rendered, 0.5, 0.5) - 180.0).abs() <= 1.0);
}

#[test]
fn cover_light_and_shadow_are_at_their_places() {
    let plain = Conditions { size_px: 200.0, ..Conditions::default() };
    let covered = render(&Conditions { cover: 0.25, cover_grey: 40.0, ..plain.clone() });
    assert!(
        (mean(&covered, 0.5, 0.5) - 36.0).abs() <= 1.0 && (mean(&covered, 0.27, 0.5) - 36.0).abs() <= 1.0
    );
    assert!((mean(&covered, 0.2, 0.5) - 180.0).abs() <= 1.0);
    let dark = (0..200 * 200).filter(|i| {
        let (u, v) = (220 + i % 200, 140 + i / 200);
        covered.image.at(u, v) < 100
    });
    assert!((dark.count() as f64 / 40_000.0 - 0.25).abs() < 0.01);
    let side = render(&Conditions { side_light: 0.5, ..plain.clone() });
    assert!(
        (mean(&side, 0.1, 0.5) - 0.95 * 180.0).abs() < 2.0
            && (mean(&side, 0.9, 0.5) - 0.55 * 180.0).abs() < 2.0
    );
    let shadow = Shadow { depth: 0.6, direction_rad: 0.0, offset: 0.1 };
    let shadow = render(&Conditions { shadow: Some(shadow), ..plain });
    assert!((mean(&shadow, 0.5, 0.5) - 180.0).abs() <= 1.0 && (mean(&shadow, 0.7, 0.5) - 72.0).abs() <= 1.0);
}

#[test]
fn the_cut_equals_that_part_of_the_whole_image() {
    let conditions = Conditions { aim_px: [30.3, -20.7], yaw_rad: 0.4, ..Conditions::default() };
    let poster = poster(3);
    let whole = exhibit(&poster, &plaster(1), &conditions, Extent::Whole, 5).unwrap();
    let cut = exhibit(&poster, &plaster(1), &conditions, Extent::Around, 5).unwrap();
    let shift = whole.corners.points()[0] - cut.corners.points()[0];
    for (u, v) in [(20, 20), (90, 100), (60, 140)] {
        let (a, b) =
            (cut.image.at(u, v), whole.image.at(u + shift.x.round() as usize, v + shift.y.round() as usize));
        assert!(a.abs_diff(b) <= 1, "{a} {b}");
    }
}

#[test]
fn noise_follows_the_draw_and_a_picture_outside_is_none() {
    let poster = poster(1);
    let render =
        |draw| exhibit(&poster, &plaster(1), &Conditions::realistic(4), Extent::Around, draw).unwrap();
    assert_eq!(render(1), render(1));
    assert_ne!(render(1), render(2));
    assert_ne!(Conditions::realistic(1), Conditions::realistic(2));
    let away = Conditions { aim_px: [400.0, 0.0], ..Conditions::default() };
    assert!(exhibit(&poster, &plaster(1), &away, Extent::Whole, 1).is_none());
    let broken = Conditions {
        yaw_rad: f64::NAN,
        size_px: f64::INFINITY,
        aim_px: [f64::NAN, 0.0],
        ..Conditions::default()
    };
    assert!(exhibit(&poster, &plaster(1), &broken, Extent::Whole, 1).is_none());
}
