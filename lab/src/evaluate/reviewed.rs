//! Reviewed lists: quads in a set's pictures that the set does not label, each looked at and written down: real
//! four-sided things (signs, switches, windows), and false ones. An evaluation counts quads on real ones apart from the
//! other false ones; the networks of the search learn from both. The lists are in `lab/reviewed`, one file a set,
//! named after it.

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

/// A quad that was looked at.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Thing {
    /// Clockwise on screen, pixels of the picture.
    pub(crate) corners: Corners,
    /// What it is.
    pub(crate) what: String,
    /// Whether it is a thing, or lines that meet by chance.
    #[serde(default = "yes")]
    pub(crate) real: bool,
}

fn yes() -> bool {
    true
}

/// Things by file of the set.
#[derive(Debug, Clone, Default)]
pub(crate) struct Reviewed(BTreeMap<String, Vec<Thing>>);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    set: String,
    images: BTreeMap<String, Vec<Thing>>,
}

impl Reviewed {
    /// The list in `file`; without one the list that comes with the program, if there is any for the set.
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

    /// Every picture with what was looked at, by name.
    pub(crate) fn pictures(&self) -> impl Iterator<Item = (&str, &[Thing])> {
        self.0.iter().map(|(file, things)| (file.as_str(), things.as_slice()))
    }

    /// Quads that were looked at in one picture.
    pub(crate) fn things(&self, file: &str) -> &[Thing] {
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
            for (file, things) in &list.0 {
                assert!(!things.is_empty(), "{file}");
                assert!(things.iter().all(|t| t.what.len() > 3), "{file}: says what each is");
            }
            assert!(list.0.values().flatten().any(|t| t.real), "{name}");
        }
        let walk = Reviewed::of("museum-walk-estense", None).unwrap();
        assert!(walk.pictures().flat_map(|p| p.1).any(|t| !t.real), "false ones are read as such");
        assert!(Reviewed::of("no-such-set", None).unwrap().things("a.jpg").is_empty());
    }

    #[test]
    fn a_list_is_of_one_set() {
        let text =
            r#"{"set": "a", "images": {"x.jpg": [{"corners": [[0,0],[9,0],[9,9],[0,9]], "what": "label"}]}}"#;
        assert_eq!(Reviewed::parse("a", text).unwrap().things("x.jpg").len(), 1);
        assert!(Reviewed::parse("b", text).is_err());
        assert!(Reviewed::parse("a", &text.replace("[9,9]", "[-9,-9]")).is_err(), "no quad");
    }
}
