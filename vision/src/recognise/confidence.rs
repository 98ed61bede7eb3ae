//! Accepted landmarks in, the paper's probabilities and entropies out (method 10), and a confidence of ours. Which
//! landmarks are accepted is the verdict's business.

/// The paper's m with the printed 1/(N+1), natural logarithm: `1 - ln K / (N+1)` for K of N accepted.
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

/// How sure an accepted identity is, 0 to 1: 1 minus the greater of `ratio` (distance / tau) and `margin` (ratio over
/// the runner-up's). It rises with the evidence but is *not calibrated*: 0.8 does not mean right in 80 of 100 cases.
pub fn confidence(ratio: f64, margin: f64) -> f64 {
    let weakest = ratio.max(margin);
    if weakest.is_finite() { (1.0 - weakest).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn golden_table() {
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

    #[test]
    fn confidence_follows_the_weaker_evidence() {
        assert!((confidence(0.2, 0.3) - 0.7).abs() < 1e-12);
        assert!(confidence(0.9, 0.1) < confidence(0.8, 0.1));
        assert!(confidence(0.1, 0.9) < confidence(0.1, 0.8));
        for (ratio, margin) in [(1.5, 0.1), (f64::INFINITY, 0.0), (f64::NAN, f64::NAN)] {
            assert!(confidence(ratio, margin).abs() < 1e-12);
        }
    }
}
