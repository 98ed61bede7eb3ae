//! Reviewed lists: quads in a set's pictures that the set does not label, each judged by a person:
//! real ones (signs, switches, windows), and false ones. An evaluation counts detections on real
//! ones apart from other false ones; the detector's networks learn from both. The lists are in
//! `lab/reviewed`, one file a set, named after it.

use anyhow::Context as _;
use serde::Deserialize;
use std::{collections::BTreeMap, path::Path};
use vision::geometry::Corners;

/// Lists that come with the program, by name of the set.
const BUILT_IN: [(&str, &str); 6] = [
    ("museum-paintings", include_str!("../../reviewed/museum-paintings.json")),
    ("museum-walk-estense", include_str!("../../reviewed/museum-walk-estense.json")),
    ("corridor-loop-rtabmap", include_str!("../../reviewed/corridor-loop-rtabmap.json")),
    ("corridor-multifloor", include_str!("../../reviewed/corridor-multifloor.json")),
    ("doors-bbox", include_str!("../../reviewed/doors-bbox.json")),
    ("signs-misc", include_str!("../../reviewed/signs-misc.json")),
];

/// A quad that a person judged.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReviewedQuad {
    /// Clockwise on screen, pixels of the picture.
    pub(crate) corners: Corners,
    pub(crate) what: String,
    /// Whether it is an object, or lines that meet by chance.
    #[serde(default = "yes")]
    pub(crate) real: bool,
}

fn yes() -> bool {
    true
}

/// Quads by file of the set.
#[derive(Debug, Clone, Default)]
pub(crate) struct Reviewed(BTreeMap<String, Vec<ReviewedQuad>>);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    set: String,
    images: BTreeMap<String, Vec<ReviewedQuad>>,
}

impl Reviewed {
    /// The list in `file`; by default the list that comes with the program, empty if there is none
    /// for the set.
    pub(crate) fn of(set: &str, file: Option<&Path>) -> anyhow::Result<Self> {
        if let Some(path) = file {
            let text =
                std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
            return Self::parse(set, &text)
                .with_context(|| format!("{} is no list of {set}", path.display()));
        }
        match BUILT_IN.iter().find(|(name, _)| *name == set) {
            Some((name, text)) => Self::parse(set, text).with_context(|| format!("the list of {name}")),
            None => Ok(Self::default()),
        }
    }

    fn parse(set: &str, text: &str) -> anyhow::Result<Self> {
        let list: List = serde_json::from_str(text)?;
        anyhow::ensure!(list.set == set, "it is of {}", list.set);
        Ok(Self(list.images))
    }

    /// Every picture with its reviewed quads, by name.
    pub(crate) fn pictures(&self) -> impl Iterator<Item = (&str, &[ReviewedQuad])> {
        self.0.iter().map(|(file, quads)| (file.as_str(), quads.as_slice()))
    }

    /// Reviewed quads of one picture.
    pub(crate) fn quads(&self, file: &str) -> &[ReviewedQuad] {
        self.0.get(file).map_or(&[], Vec::as_slice)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_that_come_with_the_program_are_sound() {
        for (name, _) in BUILT_IN {
            let list = Reviewed::of(name, None).unwrap();
            for (file, quads) in &list.0 {
                assert!(!quads.is_empty(), "{file}");
                assert!(quads.iter().all(|t| t.what.len() > 3), "{file}: names each quad");
            }
            assert!(list.0.values().flatten().any(|t| t.real), "{name}");
        }
        let walk = Reviewed::of("museum-walk-estense", None).unwrap();
        assert!(walk.pictures().flat_map(|p| p.1).any(|t| !t.real), "has false ones");
        assert!(Reviewed::of("no-such-set", None).unwrap().quads("a.jpg").is_empty());
    }

    #[test]
    fn a_list_is_of_one_set() {
        let text =
            r#"{"set": "a", "images": {"x.jpg": [{"corners": [[0,0],[9,0],[9,9],[0,9]], "what": "label"}]}}"#;
        assert_eq!(Reviewed::parse("a", text).unwrap().quads("x.jpg").len(), 1);
        assert!(Reviewed::parse("b", text).is_err());
        assert!(Reviewed::parse("a", &text.replace("[9,9]", "[-9,-9]")).is_err(), "no quad");
    }
}
