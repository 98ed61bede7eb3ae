//! Networks as the source file that the detector is built with.

use super::provenance::Provenance;
use std::fmt::Write as _;
use vision::detect::border_model::{feature_constants::FeatureDigest, network::Network};

/// Longest line.
const WIDTH: usize = 108;

/// Weights with four digits after the point: what is written is what is used.
pub(super) fn rounded(mut net: Network) -> Network {
    let round = |x: &mut f64| *x = (*x * 1e4).round() / 1e4 + 0.0;
    let lists =
        [&mut net.mean, &mut net.linear, &mut net.hidden_in, &mut net.hidden_bias, &mut net.hidden_out];
    lists.into_iter().flatten().for_each(round);
    // A deviation must stay above 0.
    net.deviation.iter_mut().for_each(|d| *d = (*d * 1e4).ceil() / 1e4);
    round(&mut net.bias);
    net
}

/// `vision/src/detect/border_model/network_weights.rs` with these networks.
pub(super) fn source(models: &[(&str, Network); 2], from: &Provenance) -> String {
    let mut text = String::from(
        "//! The weights of the networks of the default detector. Not for editing: this command writes the file, byte for byte\n\
         //! on one machine, and `cargo fmt` puts it in form:\n//!\n",
    );
    text.push_str(&from.lines());
    text.push_str(
        "#![allow(clippy::approx_constant, reason = \"weights that happen to be near one\")]\n\n\
         use super::{feature_constants::FeatureDigest, network::Network};\nuse std::sync::LazyLock;\n\n\
         /// The measurements that the weights were fitted to.\n",
    );
    // Writing to a String cannot fail.
    writeln!(
        text,
        "const FEATURES: FeatureDigest = FeatureDigest(0x{});\nconst _: () = assert!(\n    \
         FEATURES.is(FeatureDigest::OF_THIS_PROGRAM),\n    \
         \"a number of the measurements changed: train the networks again\",\n);",
        grouped(models[0].1.features)
    )
    .ok();
    for (name, net) in models {
        let lists = lists(net);
        let upper = name.to_uppercase();
        // Writing to a String cannot fail.
        write!(
            text,
            "\n/// Weighs the measurements of `{name}`.\npub(crate) fn {name}() -> &'static Network {{\n"
        )
        .ok();
        text.push_str(
            "    static MODEL: LazyLock<Network> = LazyLock::new(|| Network {\n        features: FEATURES,\n",
        );
        for (list, _) in lists {
            writeln!(text, "        {list}: {upper}_{}.to_vec(),", list.to_uppercase()).ok();
        }
        write!(text, "        bias: {:?},\n    }});\n    &MODEL\n}}\n", net.bias).ok();
    }
    for (name, net) in models {
        for (list, values) in lists(net) {
            let name = format!("{}_{}", name.to_uppercase(), list.to_uppercase());
            write!(text, "\nconst {name}: [f64; {}] = [\n   ", values.len()).ok();
            let mut used = 3;
            for value in values {
                let word = format!(" {value:?},");
                if used + word.len() > WIDTH {
                    text.push_str("\n   ");
                    used = 3;
                }
                used += word.len();
                text.push_str(&word);
            }
            text.push_str("\n];\n");
        }
    }
    text
}

/// Hexadecimal digits in groups of four.
fn grouped(digest: FeatureDigest) -> String {
    let digits = digest.to_string();
    [0, 4, 8, 12].map(|i| &digits[i..i + 4]).join("_")
}

/// Names and values in the order of the fields.
fn lists(net: &Network) -> [(&'static str, &[f64]); 6] {
    [
        ("mean", &net.mean),
        ("deviation", &net.deviation),
        ("linear", &net.linear),
        ("hidden_in", &net.hidden_in),
        ("hidden_bias", &net.hidden_bias),
        ("hidden_out", &net.hidden_out),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_weight_is_written_as_it_is_used() {
        let net = rounded(Network {
            features: FeatureDigest::OF_THIS_PROGRAM,
            mean: vec![0.123_449, -0.000_01],
            deviation: vec![1e-9, 2.0],
            linear: vec![3.5; 2],
            hidden_in: vec![-1.0; 60],
            hidden_bias: vec![0.0; 30],
            hidden_out: vec![7.0; 30],
            bias: 0.518_46,
        });
        assert_eq!(net.check(2), Ok(()));
        let from = Provenance::of_this_run(&[]).unwrap();
        let text = source(&[("border_model", net.clone()), ("quad_classifier", net)], &from);
        for part in [
            "const BORDER_MODEL_MEAN: [f64; 2] = [\n    0.1234, 0.0,\n];",
            "const QUAD_CLASSIFIER_DEVIATION: [f64; 2] = [\n    0.0001, 2.0,\n];",
            "bias: 0.5185,",
            "        features: FEATURES,\n",
            &format!("FeatureDigest(0x{});", grouped(FeatureDigest::OF_THIS_PROGRAM)),
            "pub(crate) fn quad_classifier() -> &'static Network {",
        ] {
            assert!(text.contains(part), "{part} not in\n{text}");
        }
        let code = text.lines().filter(|l| !l.starts_with("//!"));
        assert!(code.into_iter().all(|l| l.len() <= 120));
        assert_eq!(text.matches("-1.0,").count(), 120);
    }
}
