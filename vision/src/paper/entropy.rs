//! Accepted landmarks in, the paper's probabilities and entropies out (method 10). `verdict`
//! decides which landmarks are accepted.

/// The paper's m with the printed 1/(N+1), natural logarithm: `1 - ln K / (N+1)` for K of N
/// accepted.
pub fn entropy_m(accepted: usize, landmarks: usize) -> f64 {
    1.0 - (accepted.max(1) as f64).ln() / (landmarks as f64 + 1.0)
}

/// The same with the factor that normalises: `1 - ln K / ln(N+1)`, in (0, 1].
pub fn entropy_norm(accepted: usize, landmarks: usize) -> f64 {
    if accepted <= 1 { 1.0 } else { 1.0 - (accepted as f64).ln() / (landmarks as f64 + 1.0).ln() }
}

/// `P(C_l | Q)` of one landmark: an equal share for each accepted one.
pub fn probability(is_accepted: bool, accepted: usize) -> f64 {
    if is_accepted { 1.0 / accepted.max(1) as f64 } else { 0.0 }
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
            assert!((entropy_m(k, n) - paper).abs() < 5e-5, "{n} {k}");
            assert!((entropy_norm(k, n) - norm).abs() < 5e-5, "{n} {k}");
        }
        for (n, k) in [(0, 0), (1, 1), (7, 0), (7, 1)] {
            assert!((entropy_m(k, n) - 1.0).abs() < 1e-15 && (entropy_norm(k, n) - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn equal_the_sum_over_all_probabilities() {
        // Oracle: Eq. of method 10 term by term, the empty class included.
        for (n, k) in [(5, 1), (5, 3), (40, 17)] {
            let p: Vec<f64> = (0..=n).map(|l| probability(l < k, k)).collect();
            assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let sum: f64 = p.iter().filter(|p| **p > 0.0).map(|p| p * p.ln()).sum();
            assert!((entropy_m(k, n) - (1.0 + sum / (n as f64 + 1.0))).abs() < 1e-12);
            assert!((entropy_norm(k, n) - (1.0 + sum / (n as f64 + 1.0).ln())).abs() < 1e-12);
        }
    }
}
