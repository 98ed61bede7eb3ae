//! Principal components of icons, and the exemplars nearest to them (method 7.2, 7.3).
//!
//! In: the raw icons of one landmark. Out: mean, the two leading modes, and which icons lie nearest
//! to these three. Everything goes through the N x N Gram matrix of the centred icons, never the
//! S^2 x S^2 covariance.

use nalgebra::{DMatrix, SymmetricEigen};

/// Leading modes kept beside the mean.
pub const MODES: usize = 2;
/// Modes below this share of the total variance are dropped.
const MIN_SHARE: f64 = 1e-6;
/// Total variance per pixel, in grey levels squared, below which all icons are the same.
const MIN_VARIANCE: f64 = 1e-6;
/// Bound on the eigenvalue iteration; it needs about three sweeps a row.
const MAX_SWEEPS: usize = 20_000;

/// Mean and leading modes of a set of icons.
#[derive(Debug, Clone, PartialEq)]
pub struct Modes {
    /// Mean icon, S^2 grey levels.
    pub mean: Vec<f64>,
    /// Leading modes, orthonormal, S^2 numbers each; at most [`MODES`], fewer where the icons do
    /// not vary.
    pub modes: Vec<Vec<f64>>,
    /// Variance along each kept mode (eigenvalues of the covariance with 1/N), falling.
    pub eigenvalues: Vec<f64>,
    /// Sum of all eigenvalues.
    pub total_variance: f64,
    /// Squared norm of each centred icon.
    norms: Vec<f64>,
    /// Coordinate of each icon on each kept mode.
    coordinates: Vec<Vec<f64>>,
}

/// Which component an exemplar represents.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Nearest to the mean icon.
    Mean,
    /// Nearest in direction to mode `mode` (0 or 1), on its positive or negative end.
    Mode {
        /// Index of the mode.
        mode: usize,
        /// Which end of the mode the icon lies at.
        positive: bool,
    },
}

/// A training icon chosen to represent the landmark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exemplar {
    /// Index of the icon in the training set.
    pub index: usize,
    /// The component that it represents.
    pub role: Role,
}

/// Principal components of `icons`, each S^2 finite grey levels. `None` without icons, with icons
/// of different sizes, with a number that is not finite.
pub fn modes(icons: &[&[f32]]) -> Option<Modes> {
    let pixels = icons.first()?.len();
    if pixels == 0 || icons.iter().any(|i| i.len() != pixels || i.iter().any(|g| !g.is_finite())) {
        return None;
    }
    let n = icons.len() as f64;
    let mut mean = vec![0.0; pixels];
    for icon in icons {
        for (m, g) in mean.iter_mut().zip(*icon) {
            *m += f64::from(*g) / n;
        }
    }
    let centred: Vec<Vec<f32>> = icons
        .iter()
        .map(|i| i.iter().zip(&mean).map(|(g, m)| (f64::from(*g) - m) as f32).collect())
        .collect();
    let gram = gram(&centred);
    let norms: Vec<f64> = gram.diagonal().iter().copied().collect();
    let total_variance = norms.iter().sum::<f64>() / n;
    let mut result =
        Modes { mean, modes: vec![], eigenvalues: vec![], total_variance, norms, coordinates: vec![] };
    if total_variance < MIN_VARIANCE * pixels as f64 {
        return Some(result);
    }
    let eigen = SymmetricEigen::try_new(gram, f64::EPSILON, MAX_SWEEPS)?;
    for j in falling(eigen.eigenvalues.as_slice()).into_iter().take(MODES) {
        let value = eigen.eigenvalues[j];
        if value / n < MIN_SHARE * total_variance {
            break;
        }
        let vector = eigen.eigenvectors.column(j);
        // e_j = Y^T u_j / sqrt(g_j): unit length, because u_j^T Y Y^T u_j = g_j.
        let mut mode = vec![0.0; pixels];
        for (y, u) in centred.iter().zip(vector.iter()) {
            for (m, g) in mode.iter_mut().zip(y) {
                *m += u * f64::from(*g) / value.sqrt();
            }
        }
        result.coordinates.push(vector.iter().map(|u| u * value.sqrt()).collect());
        result.modes.push(mode);
        result.eigenvalues.push(value / n);
    }
    Some(result)
}

impl Modes {
    /// Coordinate of each icon on each kept mode, mode by mode.
    pub fn coordinates(&self) -> &[Vec<f64>] {
        &self.coordinates
    }
}

/// The exemplars of mean and modes: nearest to the mean; then, for each mode, the largest cosine
/// with it, of those not chosen before. Ties go to the lowest index. Between one and three.
pub fn exemplars(modes: &Modes) -> Vec<Exemplar> {
    let nearest =
        (0..modes.norms.len()).min_by(|a, b| modes.norms[*a].total_cmp(&modes.norms[*b]).then(a.cmp(b)));
    let mut chosen: Vec<Exemplar> =
        nearest.map(|index| Exemplar { index, role: Role::Mean }).into_iter().collect();
    for (mode, coordinates) in modes.coordinates.iter().enumerate() {
        let cosine = |i: usize| coordinates[i].abs() / modes.norms[i].sqrt().max(f64::MIN_POSITIVE);
        let best = (0..coordinates.len())
            .filter(|i| chosen.iter().all(|e| e.index != *i))
            .max_by(|a, b| cosine(*a).total_cmp(&cosine(*b)).then(b.cmp(a)));
        chosen.extend(
            best.map(|index| Exemplar {
                index,
                role: Role::Mode { mode, positive: coordinates[index] >= 0.0 },
            }),
        );
    }
    chosen
}

/// Y Y^T of the centred icons. Products in f32 lanes, sums in f64 by blocks: exact to 1e-6 of the
/// norm.
fn gram(centred: &[Vec<f32>]) -> DMatrix<f64> {
    let n = centred.len();
    let mut gram = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in i..n {
            let dot = dot(&centred[i], &centred[j]);
            gram[(i, j)] = dot;
            gram[(j, i)] = dot;
        }
    }
    gram
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    const LANES: usize = 8;
    let (mut sum, blocks) = ([0.0f64; LANES], a.chunks_exact(LANES).zip(b.chunks_exact(LANES)));
    for (x, y) in blocks {
        for lane in 0..LANES {
            sum[lane] += f64::from(x[lane]) * f64::from(y[lane]);
        }
    }
    let tail = a.len() - a.len() % LANES;
    sum.iter().sum::<f64>() + a[tail..].iter().zip(&b[tail..]).map(|(x, y)| f64::from(x * y)).sum::<f64>()
}

/// Indices by falling value; ties by index.
fn falling(values: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*b].total_cmp(&values[*a]).then(a.cmp(b)));
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use proptest::prelude::*;

    fn icons(n: usize, pixels: usize, seed: u64) -> Vec<Vec<f32>> {
        let mut random = Random::new(seed);
        let bases: Vec<Vec<f64>> = (0..4).map(|_| (0..pixels).map(|_| random.normal()).collect()).collect();
        (0..n)
            .map(|_| {
                let weights = [30.0, 15.0, 6.0, 3.0].map(|w| w * random.normal());
                (0..pixels)
                    .map(|p| {
                        let texture: f64 = weights.iter().zip(&bases).map(|(w, b)| w * b[p]).sum();
                        (128.0 + texture + 0.5 * random.normal()) as f32
                    })
                    .collect()
            })
            .collect()
    }

    fn slices(icons: &[Vec<f32>]) -> Vec<&[f32]> {
        icons.iter().map(Vec::as_slice).collect()
    }

    /// Oracle: singular value decomposition of the whole centred matrix.
    #[test]
    fn modes_are_those_of_the_full_svd() {
        let icons = icons(12, 60, 1);
        let found = modes(&slices(&icons)).unwrap();
        let y = DMatrix::from_fn(12, 60, |i, p| f64::from(icons[i][p]) - found.mean[p]);
        let svd = y.svd(false, true);
        let v_t = svd.v_t.unwrap();
        for (j, row) in falling(svd.singular_values.as_slice()).into_iter().take(MODES).enumerate() {
            let cosine: f64 = found.modes[j].iter().zip(v_t.row(row).iter()).map(|(a, b)| a * b).sum();
            assert!((cosine.abs() - 1.0).abs() < 1e-9, "mode {j}: cosine {cosine}");
            let expected = svd.singular_values[row].powi(2) / 12.0;
            assert!((found.eigenvalues[j] / expected - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn reconstruction_error_is_the_dropped_variance() {
        let icons = icons(15, 49, 7);
        let found = modes(&slices(&icons)).unwrap();
        let mut error = 0.0;
        for (i, icon) in icons.iter().enumerate() {
            for p in 0..49 {
                let rebuilt: f64 = found.modes.iter().zip(&found.coordinates).map(|(m, c)| m[p] * c[i]).sum();
                error += (f64::from(icon[p]) - found.mean[p] - rebuilt).powi(2) / 15.0;
            }
        }
        let dropped = found.total_variance - found.eigenvalues.iter().sum::<f64>();
        assert!((error / dropped - 1.0).abs() < 1e-4, "{error} {dropped}");
    }

    /// Oracle: distances and cosines pixel by pixel.
    #[test]
    fn exemplars_are_those_of_brute_force() {
        for seed in 0..20 {
            let icons = icons(9, 36, seed);
            let found = modes(&slices(&icons)).unwrap();
            let centred: Vec<Vec<f64>> = icons
                .iter()
                .map(|i| i.iter().zip(&found.mean).map(|(g, m)| f64::from(*g) - m).collect())
                .collect();
            let norm = |i: usize| centred[i].iter().map(|g| g * g).sum::<f64>().sqrt();
            let mut expected = vec![(0..9).min_by(|a, b| norm(*a).total_cmp(&norm(*b))).unwrap()];
            for mode in &found.modes {
                let cosine =
                    |i: usize| centred[i].iter().zip(mode).map(|(a, b)| a * b).sum::<f64>().abs() / norm(i);
                let best = (0..9)
                    .filter(|i| !expected.contains(i))
                    .max_by(|a, b| cosine(*a).total_cmp(&cosine(*b)))
                    .unwrap();
                expected.push(best);
            }
            let chosen: Vec<usize> = exemplars(&found).iter().map(|e| e.index).collect();
            assert_eq!(chosen, expected, "seed {seed}");
        }
    }

    #[test]
    fn the_sign_of_an_exemplar_is_recorded() {
        let base: Vec<f32> = (0..25).map(|p| if p % 2 == 0 { 10.0 } else { -10.0 }).collect();
        let at = |w: f32| base.iter().map(|b| 100.0 + w * b).collect::<Vec<f32>>();
        let icons = [at(-3.0), at(0.1), at(1.0), at(1.9)];
        let found = modes(&slices(&icons)).unwrap();
        let chosen = exemplars(&found);
        assert_eq!(chosen[0], Exemplar { index: 1, role: Role::Mean });
        // Every icon lies exactly on the mode, so the cosine ties at 1 up to rounding; the sign
        // must be the icon's.
        let Role::Mode { mode: 0, positive } = chosen[1].role else { panic!("{chosen:?}") };
        assert_eq!(positive, found.coordinates[0][chosen[1].index] > 0.0);
        assert_eq!(chosen.len(), 2, "the second mode has no variance");
    }

    #[test]
    fn degenerate_sets_give_fewer_exemplars() {
        assert!(modes(&[]).is_none());
        assert!(modes(&[&[1.0, 2.0], &[1.0]]).is_none());
        assert!(modes(&[&[1.0, f32::NAN]]).is_none());
        let one = modes(&[&[1.0, 2.0, 3.0]]).unwrap();
        assert_eq!(exemplars(&one), vec![Exemplar { index: 0, role: Role::Mean }]);
        let same = modes(&[&[5.0; 9], &[5.0; 9], &[5.0; 9]]).unwrap();
        assert_eq!(exemplars(&same).len(), 1);
        let two = modes(&[&[0.0, 10.0], &[10.0, 0.0]]).unwrap();
        assert_eq!(exemplars(&two).iter().map(|e| e.index).collect::<Vec<_>>(), vec![0, 1]);
    }

    proptest! {
        #[test]
        fn exemplars_are_distinct_and_within_the_set(n in 1usize..12, seed in any::<u64>()) {
            let icons = icons(n, 16, seed);
            let chosen = exemplars(&modes(&slices(&icons)).unwrap());
            prop_assert!((1..=3).contains(&chosen.len()));
            for (i, a) in chosen.iter().enumerate() {
                prop_assert!(a.index < n);
                prop_assert!(chosen[..i].iter().all(|b| b.index != a.index));
            }
        }
    }
}
