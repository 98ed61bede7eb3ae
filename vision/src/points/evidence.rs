//! The probability of so many consistent matches by chance (a contrario: Moisan and Stival 2004).

/// log10 of the upper tail of the binomial distribution: at least `k` of `n`, each with probability
/// `p`.
pub fn log10_tail(n: usize, k: usize, p: f64) -> f64 {
    if k == 0 {
        return 0.0;
    }
    if k > n {
        return f64::NEG_INFINITY;
    }
    let ln_choose =
        |n: usize, k: usize| -> f64 { (0..k).map(|i| (((n - i) as f64) / ((i + 1) as f64)).ln()).sum() };
    let (lp, lq) = (p.ln(), (-p).ln_1p());
    let first = ln_choose(n, k) + k as f64 * lp + (n - k) as f64 * lq;
    // Ratios of successive terms.
    let (mut sum, mut term) = (1.0, 1.0);
    for i in k..n {
        term *= (n - i) as f64 / (i + 1) as f64 * p / (1.0 - p);
        sum += term;
        if term < 1e-12 * sum {
            break;
        }
    }
    ((first + sum.ln()) / std::f64::consts::LN_10).min(0.0)
}
