//! Options for weights and gates of learning, where a person wants others than the server has.

use crate::arg_parsers::numbers;
use client::api::LearningSettings;

/// What is to change, and why.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct LearningArgs {
    #[command(flatten)]
    changes: Changes,
    /// Why, for each change: one line of up to 200 characters, kept with the settings and in the
    /// history.
    #[arg(long, value_name = "TEXT", requires = "changes")]
    pub(crate) why: Option<String>,
}

/// Options that are absent change nothing.
#[derive(Debug, Clone, Default, clap::Args)]
#[group(id = "changes", multiple = true, requires = "why")]
struct Changes {
    /// Cost of a wrong acceptance to that of a refused own view, such as 12:1; the quotient is 0.1
    /// to 1000.
    #[arg(long, value_name = "L:M", value_parser = weights)]
    weights: Option<f64>,
    /// Fewest views, 1 to 200.
    #[arg(long, value_name = "N")]
    min_views: Option<usize>,
    /// Least saliency F, 0 to 1000.
    #[arg(long, value_name = "F", value_parser = number)]
    min_saliency_f: Option<f64>,
    /// Fewest stable points, 0 to 60.
    #[arg(long, value_name = "N")]
    min_stable_points: Option<usize>,
    /// Least visibility confidence of the photographs, 0 to 10.
    #[arg(long, value_name = "C", value_parser = number)]
    min_visibility_confidence: Option<f64>,
    /// Whether a smaller visibility confidence keeps a landmark out of use.
    #[arg(long, value_name = "true|false")]
    refuse_one_side: Option<bool>,
    /// Whether a landmark is used whatever these gates say. A missing threshold and a look-alike
    /// keep it out of use still.
    #[arg(long, value_name = "true|false")]
    use_despite_gates: Option<bool>,
    /// Start without own settings.
    #[arg(long)]
    defaults: bool,
}

fn number(text: &str) -> Result<f64, String> {
    numbers(text, ',').map(|[value]: [f64; 1]| value).ok_or_else(|| "a number".to_owned())
}

/// Lambda : mu as one number, lambda where mu is 1.
fn weights(text: &str) -> Result<f64, String> {
    match numbers(text, ':') {
        Some([lambda, mu]) if lambda > 0.0 && mu > 0.0 => Ok(lambda / mu),
        _ => Err("two numbers above 0, such as 12:1".to_owned()),
    }
}

impl LearningArgs {
    /// The settings after the changes, for this reason; `None`: none of its own.
    pub(crate) fn over(&self, own: Option<LearningSettings>, why: &str) -> Option<LearningSettings> {
        let changes = &self.changes;
        let now = own.filter(|_| !changes.defaults).unwrap_or_default();
        let after = LearningSettings {
            reason: String::new(),
            false_positive_weight: changes.weights.or(now.false_positive_weight),
            min_views: changes.min_views.or(now.min_views),
            min_saliency_f: changes.min_saliency_f.or(now.min_saliency_f),
            min_stable_points: changes.min_stable_points.or(now.min_stable_points),
            min_visibility_confidence: changes.min_visibility_confidence.or(now.min_visibility_confidence),
            refuse_one_side: changes.refuse_one_side.or(now.refuse_one_side),
            use_despite_gates: changes.use_despite_gates.or(now.use_despite_gates),
        };
        (after != LearningSettings::default()).then(|| LearningSettings { reason: why.to_owned(), ..after })
    }
}

/// Weights and gates as the options that make them, and the reason.
pub(crate) fn text(own: &LearningSettings) -> String {
    let fields = serde_json::to_value(own).unwrap_or_default();
    let options = fields.as_object().into_iter().flatten().filter(|(field, _)| *field != "reason");
    let words = options.map(|(field, value)| match field.as_str() {
        "false_positive_weight" => format!("--weights {value}:1"),
        _ => format!("--{} {value}", field.replace('_', "-")),
    });
    format!("{}, because: {}", words.collect::<Vec<_>>().join(" "), own.reason)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        args: LearningArgs,
    }

    fn parsed(line: &str) -> Option<LearningArgs> {
        let words = ["x"].into_iter().chain(line.split_whitespace());
        Line::try_parse_from(words).ok().map(|line| line.args)
    }

    /// The settings after a command line where these were before.
    fn after(own: Option<&LearningSettings>, line: &str) -> Option<LearningSettings> {
        let args = parsed(line).unwrap();
        args.over(own.cloned(), args.why.as_ref().unwrap())
    }

    #[test]
    fn every_setting_is_an_option_and_what_is_absent_stays() {
        let options = "--weights 9:3 --min-views 4 --min-saliency-f 1.5 --min-stable-points 0 \
                       --min-visibility-confidence 0.25 --refuse-one-side true --use-despite-gates false";
        let all = LearningSettings {
            reason: "one".to_owned(),
            false_positive_weight: Some(3.0),
            min_views: Some(4),
            min_saliency_f: Some(1.5),
            min_stable_points: Some(0),
            min_visibility_confidence: Some(0.25),
            refuse_one_side: Some(true),
            use_despite_gates: Some(false),
        };
        assert_eq!(after(None, &format!("{options} --why one")).as_ref(), Some(&all));
        let one = LearningSettings { reason: "two".to_owned(), min_views: Some(7), ..all.clone() };
        assert_eq!(after(Some(&all), "--min-views 7 --why two"), Some(one));
        let alone = LearningSettings {
            reason: "three".to_owned(),
            use_despite_gates: Some(true),
            ..LearningSettings::default()
        };
        assert_eq!(after(Some(&all), "--defaults --use-despite-gates true --why three"), Some(alone));
        assert_eq!(after(Some(&all), "--defaults --why four"), None);
        // Shown as the options that make it.
        let shown = text(&all);
        let (options, reason) = shown.split_once(", because: ").unwrap();
        assert_eq!(after(None, &format!("{options} --why {reason}")), Some(all));
    }

    #[test]
    fn changes_need_a_reason_and_a_reason_needs_changes() {
        assert!(parsed("").is_some_and(|args| args.why.is_none()));
        for wrong in [
            "--min-views 4",
            "--defaults",
            "--why x",
            "--weights 3 --why x",
            "--weights 0:1 --why x",
            "--weights 1:0 --why x",
            "--weights inf:1 --why x",
            "--min-views -1 --why x",
            "--min-saliency-f nan --why x",
            "--min-visibility-confidence 1,2 --why x",
            "--use-despite-gates perhaps --why x",
        ] {
            assert!(parsed(wrong).is_none(), "{wrong}");
        }
    }
}
