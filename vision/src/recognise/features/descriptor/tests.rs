//! Jets against an analytic image, invariances, whitening.

use super::*;
use proptest::prelude::*;

/// (amplitude, frequency x, frequency y, phase)
const WAVES: [[f64; 4]; 4] =
    [[40.0, 0.21, 0.05, 0.3], [30.0, -0.08, 0.17, 1.1], [20.0, 0.13, 0.24, 2.0], [15.0, 0.3, -0.11, 0.5]];

fn waves_icon(gain: f64, offset: f64) -> Icon {
    let grey =
        |x: f64, y: f64| WAVES.iter().map(|[a, fx, fy, ph]| a * (fx * x + fy * y + ph).sin()).sum::<f64>();
    let pixels =
        (0..75 * 75).map(|i| (offset + gain * grey(f64::from(i % 75), f64::from(i / 75))) as f32).collect();
    Icon { size: 75, pixels, source_scale: 1.0 }
}

#[test]
fn jet_equals_the_analytic_one() {
    // A sinusoid of frequency w blurred by G_sigma is multiplied by exp(-sigma^2 w^2 / 2).
    let (x, y, sigma) = (35.3, 40.7, 2.0);
    let icon = waves_icon(1.0, 128.0);
    let jet = Jet::at(&icon, [35.3, 40.7], sigma);
    let analytic = |i: i32, j: i32| -> f64 {
        WAVES
            .iter()
            .map(|[a, fx, fy, ph]| {
                let quarter = f64::from(i + j) * std::f64::consts::FRAC_PI_2;
                let blur = (-0.5 * sigma * sigma * (fx * fx + fy * fy)).exp();
                a * blur
                    * (sigma * fx).powi(i)
                    * (sigma * fy).powi(j)
                    * (fx * x + fy * y + ph + quarter).sin()
            })
            .sum()
    };
    for (actual, i, j) in [
        (jet.x, 1, 0),
        (jet.y, 0, 1),
        (jet.xx, 2, 0),
        (jet.xy, 1, 1),
        (jet.yy, 0, 2),
        (jet.xxx, 3, 0),
        (jet.xxy, 2, 1),
        (jet.xyy, 1, 2),
        (jet.yyy, 0, 3),
    ] {
        let expected = analytic(i, j);
        assert!((actual - expected).abs() < 0.02 + 0.01 * expected.abs(), "{i}{j}: {actual} {expected}");
    }
}

#[test]
fn steering_equals_the_jet_of_the_turned_image() {
    // Oracle: turn the frame by the gradient's direction analytically; then u is x and w is y.
    let jet = Jet::at(&waves_icon(1.0, 128.0), [33.0, 29.0], 2.0);
    let angle = jet.y.atan2(jet.x);
    let turned: Vec<[f64; 4]> = WAVES
        .iter()
        .map(|[a, fx, fy, ph]| {
            let (c, s) = (angle.cos(), angle.sin());
            [*a, c * fx + s * fy, -s * fx + c * fy, ph + fx * 33.0 + fy * 29.0]
        })
        .collect();
    let derivative = |i: i32, j: i32| -> f64 {
        turned
            .iter()
            .map(|[a, fu, fw, ph]| {
                let blur = (-2.0 * (fu * fu + fw * fw)).exp();
                let quarter = f64::from(i + j) * std::f64::consts::FRAC_PI_2;
                a * blur * (2.0 * fu).powi(i) * (2.0 * fw).powi(j) * (ph + quarter).sin()
            })
            .sum()
    };
    let gradient = derivative(1, 0);
    assert!(derivative(0, 1).abs() < 0.05);
    let orders = [(2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)];
    for (actual, (i, j)) in jet.steered(0.0).into_iter().zip(orders) {
        let expected = derivative(i, j) / gradient;
        assert!((actual - expected).abs() < 0.01, "{i}{j}: {actual} {expected}");
    }
}

#[test]
fn invariant_to_rotation_gain_and_offset() {
    let p = DescriptorParams { regularisation: 0.0, ..DescriptorParams::default() };
    let icon = waves_icon(1.0, 120.0);
    let points: Vec<HarrisPoint> = (0..40)
        .map(|i| HarrisPoint { xy_px: [4.0 + 1.7 * i as f32, 4.0 + (i * 23 % 67) as f32], response: 1.0 })
        // On a flat spot the direction of the gradient is rounding noise.
        .filter(|q| Jet::at(&icon, q.xy_px, 2.0).x.hypot(Jet::at(&icon, q.xy_px, 2.0).y) > 5.0)
        .collect();
    assert!(points.len() > 20);
    let plain = describe(&icon, &points, &p);
    let brighter = describe(&waves_icon(0.4, 150.0), &points, &p);
    for shift in 0..4 {
        let turned = plain.rotated(shift, 75);
        let there: Vec<HarrisPoint> = turned
            .xy_px()
            .iter()
            .zip(turned.responses())
            .map(|(xy_px, response)| HarrisPoint { xy_px: *xy_px, response: *response })
            .collect();
        let again = describe(&icon.rotated(shift), &there, &p);
        for i in 0..plain.len() {
            for c in 0..DIMENSION {
                let reference = plain.descriptors()[i][c];
                assert!((again.descriptors()[i][c] - reference).abs() < 1e-3 * reference.abs().max(1.0));
                assert!((brighter.descriptors()[i][c] - reference).abs() < 1e-3 * reference.abs().max(1.0));
            }
        }
    }
}

#[test]
fn cold_start_whitens_by_the_measured_deviations() {
    let whitening = DescriptorParams::default().whitening;
    for (i, row) in whitening.iter().enumerate() {
        for (j, w) in row.iter().enumerate() {
            let expected = if i == j { 1.0 / COLD_START[i] } else { 0.0 };
            assert!((w - expected).abs() < 1e-12, "{i} {j}");
        }
    }
}

#[test]
fn point_sets_from_external_data_are_checked() {
    let good = PointSet::new(vec![[1.0, 2.0]], vec![[0.0; 7]], vec![3.0]);
    assert_eq!(good.unwrap().len(), 1);
    let field = |set: Result<PointSet, PointSetError>| set.unwrap_err().field;
    assert_eq!(field(PointSet::new(vec![[f32::NAN, 0.0]], vec![[0.0; 7]], vec![3.0])), "xy_px");
    assert_eq!(field(PointSet::new(vec![[1.0, 2.0]], vec![], vec![3.0])), "descriptors");
    assert_eq!(field(PointSet::new(vec![[1.0, 2.0]], vec![[0.0; 7]], vec![f32::INFINITY])), "responses");
    let n = crate::recognise::features::harris::MAX_POINTS;
    assert!(PointSet::new(vec![[1.0; 2]; n], vec![[0.0; 7]; n], vec![1.0; n]).is_ok());
    assert!(PointSet::new(vec![[1.0; 2]; n + 1], vec![[0.0; 7]; n + 1], vec![1.0; n + 1]).is_err());
}

proptest! {
    #[test]
    fn always_finite(
        grey in proptest::collection::vec(prop_oneof![Just(0.0_f32), Just(255.0), 0.0..255.0_f32], 400),
        x in -5.0..30.0_f32,
        y in -5.0..30.0_f32,
        sigma in prop_oneof![Just(f64::NAN), Just(0.0), Just(1e12), 0.5..4.0_f64],
    ) {
        let icon = Icon { size: 20, pixels: grey, source_scale: 1.0 };
        let p = DescriptorParams { sigma, ..DescriptorParams::default() };
        let set = describe(&icon, &[HarrisPoint { xy_px: [x, y], response: 1.0 }], &p);
        prop_assert!(set.descriptors()[0].iter().all(|c| c.is_finite()));
    }
}
