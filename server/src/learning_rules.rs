//! Weights and gates of a map or of one landmark: as the API has them, as text for the store, as
//! rules for `vision`.

use crate::label::check_label;
use protos::api::LearningSettings;
use vision::learn::LearnRules;

/// Longest reason, characters: the history of a map stores as much.
pub(crate) const MAX_REASON: usize = 200;

/// A field, and what is wrong with it.
pub(crate) type FieldFault = (&'static str, String);

/// The settings as text, checked.
pub(crate) fn text(of: &LearningSettings) -> Result<String, FieldFault> {
    check_label(&of.reason, MAX_REASON).map_err(|e| ("reason", e.to_string()))?;
    let within = |field, value: Option<f64>, [least, most]: [f64; 2]| match value {
        Some(value) if !(least..=most).contains(&value) => Err((field, format!("{least} to {most}"))),
        _ => Ok(()),
    };
    let count = |value: Option<usize>| value.map(|n| n as f64);
    within("false_positive_weight", of.false_positive_weight, [0.1, 1000.0])?;
    within("min_views", count(of.min_views), [1.0, 200.0])?;
    within("min_saliency_f", of.min_saliency_f, [0.0, 1000.0])?;
    within("min_stable_points", count(of.min_stable_points), [0.0, 60.0])?;
    within("min_visibility_confidence", of.min_visibility_confidence, [0.0, 10.0])?;
    serde_json::to_string(of).map_err(|e| ("reason", e.to_string()))
}

/// The settings of a stored text; what is not readable (a file of another program) is none.
pub(crate) fn shown(text: Option<&str>) -> Option<LearningSettings> {
    text.and_then(|text| serde_json::from_str(text).ok())
}

/// The rules of a stored text.
pub(crate) fn rules(text: Option<&str>) -> LearnRules {
    let of = shown(text).unwrap_or_default();
    LearnRules {
        false_positive_weight: of.false_positive_weight,
        min_views: of.min_views,
        min_saliency_f: of.min_saliency_f,
        min_stable_points: of.min_stable_points,
        min_v_c: of.min_visibility_confidence,
        refuse_one_side: of.refuse_one_side,
        use_despite_gates: of.use_despite_gates,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_checked_and_the_longest_fits_its_column() {
        let long = LearningSettings {
            // Four bytes a character; the column counts characters.
            reason: "\u{1f5ff}".repeat(MAX_REASON),
            false_positive_weight: Some(1000.0 / 3.0),
            min_views: Some(200),
            min_saliency_f: Some(1000.0 / 3.0),
            min_stable_points: Some(60),
            min_visibility_confidence: Some(10.0 / 3.0),
            refuse_one_side: Some(false),
            use_despite_gates: Some(true),
        };
        let stored = text(&long).unwrap();
        assert!(stored.chars().count() <= 1024, "{}", stored.chars().count());
        assert_eq!(shown(Some(&stored)).as_ref(), Some(&long));
        let own = rules(Some(&stored));
        assert_eq!(
            (own.min_views, own.min_v_c, own.use_despite_gates),
            (Some(200), Some(10.0 / 3.0), Some(true))
        );
        for none in [None, Some(""), Some("{\"reason\":\"x\",\"other\":1}")] {
            assert_eq!(rules(none), LearnRules::default(), "{none:?}");
        }
        let fault = |change: fn(&mut LearningSettings)| {
            let mut wrong = long.clone();
            change(&mut wrong);
            text(&wrong).unwrap_err().0
        };
        assert_eq!(fault(|s| s.reason = String::new()), "reason");
        assert_eq!(fault(|s| s.reason.push('x')), "reason");
        assert_eq!(fault(|s| s.false_positive_weight = Some(0.09)), "false_positive_weight");
        assert_eq!(fault(|s| s.min_views = Some(201)), "min_views");
        assert_eq!(fault(|s| s.min_saliency_f = Some(f64::NAN)), "min_saliency_f");
        assert_eq!(fault(|s| s.min_stable_points = Some(61)), "min_stable_points");
        assert_eq!(fault(|s| s.min_visibility_confidence = Some(10.1)), "min_visibility_confidence");
    }
}
