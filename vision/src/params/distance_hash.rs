//! The hash of the settings that define the distances, stored with every threshold. An explicit
//! list of numbers is hashed: renaming a field changes nothing, changing a number does.

use crate::params::Params;

/// Raised when the same numbers give other distances: an algorithm of icon, points, descriptors,
/// ranks or alignment changed.
const VERSION: u64 = 1;

impl Params {
    /// Names the settings that define the distances: icon, points, descriptor, ranks, alignment. A
    /// threshold is valid only under the hash of its training. FNV-1a, 64 bits, of a version and of
    /// the numbers, each group preceded by its length.
    pub fn distance_hash(&self) -> u64 {
        let groups = self.distance_numbers();
        let words = groups.iter().flat_map(|group| {
            let length = std::iter::once(group.len() as u64);
            length.chain(group.iter().map(|number| number.to_bits()))
        });
        fnv1a(std::iter::once(VERSION).chain(words).flat_map(u64::to_le_bytes))
    }

    /// Every number that defines the distances, by stage. Only ever appended to; a change of order
    /// or meaning raises [`VERSION`].
    fn distance_numbers(&self) -> [Vec<f64>; 6] {
        let (icon, r) = (&self.icon, &self.recognise);
        let (harris, descriptor) = (&r.harris, &r.descriptor);
        let (correlation, hausdorff, align) = (&r.correlation, &r.hausdorff, &r.verdict.align);
        let descriptor_head = [descriptor.sigma, descriptor.regularisation, descriptor.clip];
        let align_numbers = [align.max_shift].into_iter().chain(align.sigmas).chain([align.steps as f64]);
        [
            vec![icon.size as f64, icon.min_side_ratio, icon.max_outside, f64::from(icon.min_cell_pixels)],
            vec![
                harris.sigma_derivative,
                harris.sigma_integration,
                harris.k,
                harris.relative_threshold,
                harris.margin_px as f64,
                harris.max_points as f64,
                harris.max_points_per_part as f64,
            ],
            descriptor_head.into_iter().chain(descriptor.whitening.into_iter().flatten()).collect(),
            vec![correlation.buckets_per_side as f64, correlation.rank as f64, correlation.min_deviation],
            vec![hausdorff.inlier_fraction, hausdorff.min_points as f64],
            align_numbers.chain(align.min_alike).collect(),
        ]
    }
}

/// FNV-1a, 64 bits: stable across builds and machines.
fn fnv1a(bytes: impl Iterator<Item = u8>) -> u64 {
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hash of the default settings. A change here invalidates every stored model of every
    /// installation.
    const DEFAULT: u64 = 0xc207_d0a0_41ff_bfb9;

    #[test]
    fn the_hash_of_the_defaults_is_pinned() {
        assert_eq!(Params::default().distance_hash(), DEFAULT);
    }

    /// Every number of the six stages changes the hash, and nothing else does.
    #[test]
    fn the_hash_covers_exactly_the_numbers_of_the_distances() {
        let default = Params::default();
        let json = serde_json::to_value(&default).unwrap();
        let mut paths = Vec::new();
        numbers(&json, String::new(), &mut paths);
        let of_distances = |path: &str| {
            let stages = ["harris", "descriptor", "correlation", "hausdorff", "verdict/align"];
            path.starts_with("/icon/") || stages.iter().any(|s| path.starts_with(&format!("/recognise/{s}/")))
        };
        let counted: usize = default.distance_numbers().iter().map(Vec::len).sum();
        assert_eq!(
            paths.iter().filter(|path| of_distances(path)).count(),
            counted,
            "a number is missing from the hash"
        );
        for path in &paths {
            let mut changed = json.clone();
            let number = changed.pointer_mut(path).unwrap();
            *number = match number.as_u64() {
                Some(whole) => (whole + 1).into(),
                None => (number.as_f64().unwrap() + 0.125).into(),
            };
            let changed: Params = serde_json::from_value(changed).unwrap();
            assert_eq!(changed.distance_hash() != DEFAULT, of_distances(path), "{path}");
        }
    }

    fn numbers(value: &serde_json::Value, path: String, out: &mut Vec<String>) {
        match value {
            serde_json::Value::Number(_) => out.push(path),
            serde_json::Value::Array(items) => {
                for (i, item) in items.iter().enumerate() {
                    numbers(item, format!("{path}/{i}"), out);
                }
            }
            serde_json::Value::Object(fields) => {
                for (name, field) in fields {
                    numbers(field, format!("{path}/{name}"), out);
                }
            }
            _ => {}
        }
    }
}
