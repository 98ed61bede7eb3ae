//! Weights and gates of a map or of one landmark, where a person wants others than the parameters
//! have.

use crate::params::Params;

/// What is absent is as in the parameters.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LearnRules {
    /// Cost of a wrong acceptance, of a refused own view 1 (lambda : mu).
    pub false_positive_weight: Option<f64>,
    /// Fewest views.
    pub min_views: Option<usize>,
    /// Least saliency F, of photographs and of generated views.
    pub min_saliency_f: Option<f64>,
    /// Fewest stable points.
    pub min_stable_points: Option<usize>,
    /// Least visibility confidence of the photographs.
    pub min_v_c: Option<f64>,
    /// Whether a smaller visibility confidence refuses the landmark.
    pub refuse_one_side: Option<bool>,
    /// Whether no measured gate refuses the landmark.
    pub use_despite_gates: Option<bool>,
}

impl LearnRules {
    /// The parameters with these rules.
    pub fn over(&self, p: &Params) -> Params {
        let mut made = p.clone();
        let (gates, threshold) = (&mut made.learn.gates, &mut made.learn.threshold);
        let set = |value: &mut f64, rule: Option<f64>| *value = rule.unwrap_or(*value);
        set(&mut threshold.false_positive_weight, self.false_positive_weight);
        set(&mut gates.min_saliency_f, self.min_saliency_f);
        set(&mut gates.min_saliency_f_generated, self.min_saliency_f);
        set(&mut gates.min_v_c, self.min_v_c);
        gates.min_views = self.min_views.unwrap_or(gates.min_views);
        gates.min_stable_points = self.min_stable_points.unwrap_or(gates.min_stable_points);
        gates.refuse_one_side = self.refuse_one_side.unwrap_or(gates.refuse_one_side);
        gates.refuse_nothing = self.use_despite_gates.unwrap_or(gates.refuse_nothing);
        made
    }
}
