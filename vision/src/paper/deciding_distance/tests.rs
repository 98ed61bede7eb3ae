use super::*;
use crate::{
    model::landmark_id::LandmarkId,
    recognise::{
        features::{
            correlation::correlation,
            icon_features::{IconFeatures, features},
        },
        fixture::{model_set, oblique, photograph, poster, quad},
        retrieval::nearest::quad_readings,
    },
};

#[test]
fn nearest_equals_a_full_comparison() {
    let p = Params::default();
    let six = model_set(6, &p);
    // Oracle: C^r and H^r of every reading with every exemplar, sorted.
    let image = photograph(&poster(4), &oblique(), 0.9, 5.0);
    let mut q = quad(oblique());
    q.upright_ambiguous = true;
    let read = quad_readings(&image, &q, &p);
    assert_eq!(read.len(), 4);
    for kind in [DistanceKind::Hausdorff, DistanceKind::Correlation] {
        let mut expected: Vec<(f64, LandmarkId)> = six
            .iter()
            .map(|m| {
                let read: Vec<IconFeatures> =
                    read.iter().map(|s| features(s.icon.clone(), &p.recognise)).collect();
                let learnt = m.features(&p.recognise);
                let least = |d: &dyn Fn(&IconFeatures, &IconFeatures) -> f64| {
                    let pairs = read.iter().flat_map(|s| learnt.iter().map(move |e| (s, e)));
                    pairs.map(|(a, b)| d(a, b)).fold(f64::INFINITY, f64::min)
                };
                let r = &p.recognise;
                let ratio = if kind == DistanceKind::Hausdorff {
                    let d = |a: &IconFeatures, b: &IconFeatures| {
                        crate::recognise::features::hausdorff::hausdorff(&a.points, &b.points, &r.hausdorff)
                    };
                    least(&d) / m.hausdorff.tau
                } else {
                    least(&|a, b| correlation(&a.buckets, &b.buckets, &r.correlation)) / m.correlation.tau
                };
                (ratio, m.id)
            })
            .collect();
        expected.sort_by(|a, b| a.0.total_cmp(&b.0));
        for count in 1..=5 {
            let found = nearest(&read, &six, kind, count, &p);
            assert_eq!(found.len(), count);
            for (near, (ratio, id)) in found.iter().zip(&expected) {
                assert!((near.ratio(kind) - ratio).abs() < 1e-6);
                assert_eq!(near.model.id, *id);
            }
        }
    }
}
