//! Harris points in, described points out (method 5): seven steered derivatives divided by the
//! gradient, invariant to rotation and to I -> a I + b, whitened by its covariance between views of
//! one point.

use crate::{icon::Icon, recognise::features::harris::HarrisPoint};
use serde::{Deserialize, Serialize};

/// Components of a descriptor.
pub const DIMENSION: usize = 7;
/// A described point: `L_uu, L_uw, L_ww, L_uuu, L_uuw, L_uww, L_www` over `L_u`, whitened.
pub type Descriptor = [f32; DIMENSION];
/// Standard deviations of the raw components between views of one point, measured on synthetic
/// posters (method 5).
const COLD_START: [f64; DIMENSION] = [0.29, 0.21, 0.30, 0.26, 0.12, 0.13, 0.25];
/// Largest kernel radius in icon pixels, whatever the parameters say.
const MAX_RADIUS: i32 = 32;

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DescriptorParams {
    /// Scale of the jet, in icon pixels.
    pub sigma: f64,
    /// The gradient is regularised by this share of the icon's standard deviation.
    pub regularisation: f64,
    /// Raw components are clipped to this magnitude.
    pub clip: f64,
    /// W, row by row: whitened = W raw. The default divides each component by its standard
    /// deviation over views.
    pub whitening: [[f64; DIMENSION]; DIMENSION],
}

impl Default for DescriptorParams {
    fn default() -> Self {
        let row = |i| std::array::from_fn(|j| if i == j { 1.0 / COLD_START[i] } else { 0.0 });
        Self { sigma: 2.0, regularisation: 0.05, clip: 10.0, whitening: std::array::from_fn(row) }
    }
}

/// The points of an icon with their whitened descriptors, strongest first.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(try_from = "UncheckedPoints")]
pub struct PointSet {
    xy_px: Vec<[f32; 2]>,
    descriptors: Vec<Descriptor>,
    responses: Vec<f32>,
}

/// Why a point set from external data is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("point set field {field} is malformed")]
pub struct PointSetError {
    /// Name of the field.
    pub field: &'static str,
}

#[derive(Deserialize)]
struct UncheckedPoints {
    xy_px: Vec<[f32; 2]>,
    descriptors: Vec<Descriptor>,
    responses: Vec<f32>,
}

impl TryFrom<UncheckedPoints> for PointSet {
    type Error = PointSetError;
    fn try_from(p: UncheckedPoints) -> Result<Self, PointSetError> {
        Self::new(p.xy_px, p.descriptors, p.responses)
    }
}

impl PointSet {
    /// Checks that the three lists have one length, at most
    /// [`crate::recognise::features::harris::MAX_POINTS`], and are finite.
    pub fn new(
        xy_px: Vec<[f32; 2]>,
        descriptors: Vec<Descriptor>,
        responses: Vec<f32>,
    ) -> Result<Self, PointSetError> {
        if xy_px.len() > crate::recognise::features::harris::MAX_POINTS
            || xy_px.iter().flatten().any(|c| !c.is_finite())
        {
            return Err(PointSetError { field: "xy_px" });
        }
        if descriptors.len() != xy_px.len() || descriptors.iter().flatten().any(|c| !c.is_finite()) {
            return Err(PointSetError { field: "descriptors" });
        }
        if responses.len() != xy_px.len() || responses.iter().any(|r| !r.is_finite()) {
            return Err(PointSetError { field: "responses" });
        }
        Ok(Self { xy_px, descriptors, responses })
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.xy_px.len()
    }

    /// Memory that they take, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.xy_px) + size_of_val(&*self.descriptors) + size_of_val(&*self.responses)
    }

    /// No point at all.
    pub fn is_empty(&self) -> bool {
        self.xy_px.is_empty()
    }

    /// Column and row of each point, in icon pixels.
    pub fn xy_px(&self) -> &[[f32; 2]] {
        &self.xy_px
    }

    /// Whitened descriptors: their Euclidean distance is the Mahalanobis distance `d_nu`.
    pub fn descriptors(&self) -> &[Descriptor] {
        &self.descriptors
    }

    /// Harris response of each point.
    pub fn responses(&self) -> &[f32] {
        &self.responses
    }

    /// The points of `Icon::rotated(shift)` of an icon of side `size`. Descriptors do not change
    /// under rotation.
    #[must_use]
    pub fn rotated(&self, shift: usize, size: usize) -> Self {
        let last = size as f32 - 1.0;
        let turn = |[x, y]: &[f32; 2]| match shift % 4 {
            0 => [*x, *y],
            1 => [*y, last - x],
            2 => [last - x, last - y],
            _ => [last - y, *x],
        };
        Self { xy_px: self.xy_px.iter().map(turn).collect(), ..self.clone() }
    }
}

/// Describes `points` of `icon`.
pub fn describe(icon: &Icon, points: &[HarrisPoint], p: &DescriptorParams) -> PointSet {
    let n = icon.pixels.len().max(1) as f64;
    let mean = icon.pixels.iter().map(|g| f64::from(*g)).sum::<f64>() / n;
    let variance = icon.pixels.iter().map(|g| (f64::from(*g) - mean).powi(2)).sum::<f64>() / n;
    let floor = p.regularisation * variance.sqrt();
    let mut set = PointSet::default();
    for point in points {
        let raw = Jet::at(icon, point.xy_px, p.sigma).steered(floor).map(|c| clipped(c, p.clip));
        set.xy_px.push(point.xy_px);
        set.responses.push(point.response);
        set.descriptors
            .push(p.whitening.map(|row| row.iter().zip(&raw).map(|(w, r)| w * r).sum::<f64>() as f32));
    }
    set
}

/// `value` within +-`limit`; 0 when it is not a number.
fn clipped(value: f64, limit: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value.min(limit).max(-limit) }
}

/// Scale-normalised Gaussian derivatives of the grey levels at one place, by order.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Jet {
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    xxx: f64,
    xxy: f64,
    xyy: f64,
    yyy: f64,
}

impl Jet {
    /// The jet at a sub-pixel place, border replicated.
    fn at(icon: &Icon, [x, y]: [f32; 2], sigma: f64) -> Self {
        let (column, across) = kernels(f64::from(x), sigma);
        let (row, down) = kernels(f64::from(y), sigma);
        let last = icon.size as i32 - 1;
        // d[i][j]: derivative of order i in x and j in y.
        let mut d = [[0.0; 4]; 4];
        for (j, wy) in down.iter().enumerate() {
            let line = (row + j as i32).clamp(0, last) * icon.size as i32;
            let mut sums = [0.0; 4];
            for (i, wx) in across.iter().enumerate() {
                let grey = f64::from(icon.pixels[(line + (column + i as i32).clamp(0, last)) as usize]);
                for (sum, w) in sums.iter_mut().zip(wx) {
                    *sum += w * grey;
                }
            }
            for (i, sum) in sums.iter().enumerate() {
                for (k, w) in wy.iter().enumerate() {
                    d[i][k] += sum * w;
                }
            }
        }
        Self {
            x: d[1][0],
            y: d[0][1],
            xx: d[2][0],
            xy: d[1][1],
            yy: d[0][2],
            xxx: d[3][0],
            xxy: d[2][1],
            xyy: d[1][2],
            yyy: d[0][3],
        }
    }

    /// `(L_uu, L_uw, L_ww, L_uuu, L_uuw, L_uww, L_www) / sqrt(L_u^2 + floor^2)`, u along the
    /// gradient, w across.
    fn steered(&self, floor: f64) -> [f64; DIMENSION] {
        let gradient = self.x.hypot(self.y);
        let norm = gradient.hypot(floor);
        if norm < 1e-9 {
            return [0.0; DIMENSION];
        }
        let (c, s) = if gradient > 0.0 { (self.x / gradient, self.y / gradient) } else { (1.0, 0.0) };
        let (cc, cs, ss) = (c * c, c * s, s * s);
        [
            cc * self.xx + 2.0 * cs * self.xy + ss * self.yy,
            cs * (self.yy - self.xx) + (cc - ss) * self.xy,
            ss * self.xx - 2.0 * cs * self.xy + cc * self.yy,
            c * cc * self.xxx + 3.0 * cc * s * self.xxy + 3.0 * c * ss * self.xyy + s * ss * self.yyy,
            -cc * s * self.xxx
                + (c * cc - 2.0 * c * ss) * self.xxy
                + (2.0 * cc * s - s * ss) * self.xyy
                + c * ss * self.yyy,
            c * ss * self.xxx
                + (s * ss - 2.0 * cc * s) * self.xxy
                + (c * cc - 2.0 * c * ss) * self.xyy
                + cc * s * self.yyy,
            -s * ss * self.xxx + 3.0 * ss * c * self.xxy - 3.0 * s * cc * self.xyy + c * cc * self.yyy,
        ]
        .map(|v| v / norm)
    }
}

/// First sample and the weights of orders 0 to 3 of each sample around `centre`: correlation
/// kernels of `sigma^n d^n/dx^n (G * I)`. Orders 1 to 3 sum to 0, so that a constant never leaks
/// in.
fn kernels(centre: f64, sigma: f64) -> (i32, Vec<[f64; 4]>) {
    let sigma = if sigma > 0.1 { sigma } else { 0.1 };
    let radius = ((5.0 * sigma).ceil() as i32).clamp(1, MAX_RADIUS);
    let first = centre.round() as i32 - radius;
    let mut weights: Vec<[f64; 4]> = (0..=2 * radius)
        .map(|i| {
            let t = (f64::from(first + i) - centre) / sigma;
            let g = (-0.5 * t * t).exp();
            // (-1)^n He_n(-t) = He_n(t): the sample at +t weighs the derivative at the centre with
            // He_n(t) G.
            [g, t * g, (t * t - 1.0) * g, (t * t - 3.0) * t * g]
        })
        .collect();
    let total: f64 = weights.iter().map(|w| w[0]).sum();
    let leak: [f64; 4] = std::array::from_fn(|n| weights.iter().map(|w| w[n]).sum::<f64>() / total);
    for w in &mut weights {
        let plain = w[0];
        for (n, weight) in w.iter_mut().enumerate() {
            *weight = if n == 0 { plain / total } else { (*weight - leak[n] * plain) / total };
        }
    }
    (first, weights)
}

#[cfg(test)]
mod tests;
