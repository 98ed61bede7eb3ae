//! Two classes of distances in, modelled as normal; the threshold where their weighted densities
//! cross out (method 8).

/// Normal model of a class of distances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gaussian {
    pub(crate) mean: f64,
    /// Standard deviation, positive.
    pub(crate) deviation: f64,
}

impl Gaussian {
    /// Fits the finite values; `None` with fewer than two or without spread.
    pub(crate) fn fit(values: &[f64]) -> Option<Self> {
        let finite: Vec<f64> = values.iter().copied().filter(|d| d.is_finite()).collect();
        let n = finite.len() as f64;
        let mean = finite.iter().sum::<f64>() / n;
        let variance = finite.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (finite.len() >= 2 && variance > 0.0).then(|| Self { mean, deviation: variance.sqrt() })
    }
}

/// Where the weighted densities cross between the means: for small sets (n+ < 30 or n- < 300).
/// `None` if the mean of `own` is not the smaller one or the curves do not cross there.
pub(crate) fn crossing(own: Gaussian, others: Gaussian, weight: f64) -> Option<f64> {
    let (m1, s1, m0, s0) = (own.mean, own.deviation, others.mean, others.deviation);
    let a = 0.5 / (s0 * s0) - 0.5 / (s1 * s1);
    let b = m1 / (s1 * s1) - m0 / (s0 * s0);
    let c = 0.5 * (m0 / s0).powi(2) - 0.5 * (m1 / s1).powi(2) - (weight * s1 / s0).ln();
    let roots = if a.abs() < 1e-12 * (1.0 / (s0 * s0)).max(1.0 / (s1 * s1)) {
        [-c / b, f64::NAN]
    } else {
        let root = (b * b - 4.0 * a * c).sqrt();
        [(-b - root) / (2.0 * a), (-b + root) / (2.0 * a)]
    };
    // Without m1 < m0 nothing lies between them.
    roots.into_iter().find(|tau| *tau > m1 && *tau < m0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Golden value of method 8, and a numerical minimum of the Gaussian cost as oracle.
    #[test]
    fn golden_gaussians() {
        let (own, others) = (Gaussian { mean: 2.0, deviation: 0.7 }, Gaussian { mean: 5.0, deviation: 1.2 });
        let tau = crossing(own, others, 6.0).unwrap();
        assert!((tau - 2.7276).abs() < 5e-5, "{tau}");
        // d(cost)/d(tau) by a fine sum of the densities: the cost falls before tau and rises after
        // it.
        let density = |g: Gaussian, x: f64| (-0.5 * ((x - g.mean) / g.deviation).powi(2)).exp() / g.deviation;
        let slope = |x: f64| 6.0 * density(others, x) - density(own, x);
        assert!(slope(tau - 1e-4) < 0.0 && slope(tau + 1e-4) > 0.0);
    }

    #[test]
    fn equal_deviations_give_the_linear_case() {
        let own = Gaussian { mean: 1.0, deviation: 0.5 };
        let others = Gaussian { mean: 4.0, deviation: 0.5 };
        // (m1 + m0)/2 - s^2 ln(6) / (m0 - m1)
        let expected = 2.5 - 0.25 * 6.0_f64.ln() / 3.0;
        assert!((crossing(own, others, 6.0).unwrap() - expected).abs() < 1e-9);
        assert!(crossing(others, own, 6.0).is_none());
        assert!(crossing(own, own, 6.0).is_none());
    }

    #[test]
    fn gaussian_fit() {
        let fit = Gaussian::fit(&[1.0, 2.0, 3.0, f64::INFINITY]).unwrap();
        assert!((fit.mean - 2.0).abs() < 1e-12 && (fit.deviation - 1.0).abs() < 1e-12);
        assert!(Gaussian::fit(&[1.0, f64::INFINITY]).is_none());
        assert!(Gaussian::fit(&[1.0, 1.0]).is_none());
    }
}
