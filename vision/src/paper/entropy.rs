//! What a verdict leaves in, the paper's probabilities and entropies out (method 10). `verdict`
//! and `by_points` decide which landmarks are accepted.

/// What a quad may be by its verdict. Each possibility has the same probability.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Possibilities {
    /// Landmarks accepted by their own thresholds.
    accepted: usize,
    /// Whether none of the map is one more.
    none: bool,
}

impl Possibilities {
    /// None of the map is left where nothing was accepted, and where the only landmark is
    /// `doubtful`. Departs from the paper, which knows no doubt: the landmark would be certain.
    pub fn new(accepted: usize, doubtful: bool) -> Self {
        Self { accepted, none: accepted == 0 || accepted == 1 && doubtful }
    }

    fn count(self) -> usize {
        self.accepted + usize::from(self.none)
    }

    /// `P(C_l | Q)` of one landmark.
    pub fn probability(self, is_accepted: bool) -> f64 {
        if is_accepted { 1.0 / self.count() as f64 } else { 0.0 }
    }

    /// `P(none | Q)`.
    pub fn probability_none(self) -> f64 {
        self.probability(self.none)
    }

    /// The paper's m with the printed 1/(N+1), natural logarithm: `1 - ln K / (N+1)` for K
    /// possibilities among N landmarks and none.
    pub fn entropy_m(self, landmarks: usize) -> f64 {
        1.0 - (self.count() as f64).ln() / (landmarks as f64 + 1.0)
    }

    /// The same with the factor that normalises: `1 - ln K / ln(N+1)`, in [0, 1].
    pub fn entropy_norm(self, landmarks: usize) -> f64 {
        if self.count() == 1 { 1.0 } else { 1.0 - (self.count() as f64).ln() / (landmarks as f64 + 1.0).ln() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entropies_equal_the_papers_table() {
        for (n, k, paper, norm) in [
            (4, 2, 0.8614, 0.5693),
            (4, 4, 0.7227, 0.1386),
            (10, 2, 0.9370, 0.7109),
            (10, 10, 0.7907, 0.0397),
            (20, 3, 0.9477, 0.6392),
            (20, 20, 0.8573, 0.0160),
        ] {
            let left = Possibilities::new(k, false);
            assert!((left.entropy_m(n) - paper).abs() < 5e-5, "{n} {k}");
            assert!((left.entropy_norm(n) - norm).abs() < 5e-5, "{n} {k}");
        }
        for (n, k) in [(0, 0), (1, 1), (7, 0), (7, 1)] {
            let left = Possibilities::new(k, false);
            assert!((left.entropy_m(n) - 1.0).abs() < 1e-15 && (left.entropy_norm(n) - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn equal_the_sum_over_all_probabilities() {
        // Oracle: Eq. of method 10 term by term, the empty class included.
        let cases =
            [(5, 1, false), (5, 3, false), (40, 17, false), (40, 17, true), (5, 0, false), (5, 1, true)];
        for (n, k, doubtful) in cases.into_iter().chain([(1, 1, true)]) {
            let left = Possibilities::new(k, doubtful);
            let mut p: Vec<f64> = (0..n).map(|l| left.probability(l < k)).collect();
            p.push(left.probability_none());
            assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let sum: f64 = p.iter().filter(|p| **p > 0.0).map(|p| p * p.ln()).sum();
            assert!((left.entropy_m(n) - (1.0 + sum / (n as f64 + 1.0))).abs() < 1e-12);
            assert!((left.entropy_norm(n) - (1.0 + sum / (n as f64 + 1.0).ln())).abs() < 1e-12);
        }
        let doubtful = Possibilities::new(1, true);
        assert!((doubtful.probability(true) - 0.5).abs() < 1e-15);
        assert!((doubtful.probability_none() - 0.5).abs() < 1e-15 && doubtful.entropy_norm(9) < 1.0);
    }
}
