//! Quantiles of chi2 and of the normal distribution, for gates.

/// 99 % quantile with 3 degrees of freedom: the gate of a planar pose (method 13.6, 15).
pub const CHI2_3_99: f64 = 11.345;
/// 99.9 % quantile with 3 degrees of freedom: beyond it a landmark is observed elsewhere.
pub const CHI2_3_999: f64 = 16.266;
/// 99.9 % quantile with 2 degrees of freedom: the search gate of one corner.
pub const CHI2_2_999: f64 = 13.816;
/// Standard normal quantile, 95 %.
pub(crate) const Z_95: f64 = 1.644_854;
/// Standard normal quantile, 99.9 %.
pub(crate) const Z_999: f64 = 3.090_232;
/// Standard normal quantile, 99 %.
#[cfg(test)]
pub(crate) const Z_99: f64 = 2.326_348;

/// The quantile of chi2 with `dof` degrees of freedom whose standard normal quantile is `z`
/// (Wilson-Hilferty; within 1 % for `dof` >= 3 and z in 1 to 3.1).
pub(crate) fn chi2_quantile(dof: usize, z: f64) -> f64 {
    let k = dof.max(1) as f64;
    let v = 2.0 / (9.0 * k);
    k * (1.0 - v + z * v.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (dof, z, table) in [
            (3, Z_99, CHI2_3_99),
            (4, Z_99, 13.277),
            (5, Z_95, 11.070),
            (5, Z_99, 15.086),
            (13, Z_99, 27.688),
            (29, Z_95, 42.557),
        ] {
            let got = chi2_quantile(dof, z);
            assert!((got / table - 1.0).abs() < 0.01, "{dof} {z}: {got} for {table}");
        }
    }
}
