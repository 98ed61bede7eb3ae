//! The YAML file of a `map_server` map: which picture, where it lies, and what its grey levels
//! mean.

use super::grid::GridError;
use map::pose2::Pose2;
use serde_json::{Map, Value};

/// Longest YAML file.
pub(super) const MAX_YAML_BYTES: usize = 1 << 16;
/// Side of a cell, metres.
const RESOLUTION_M: (f64, f64) = (1e-3, 10.0);

/// How grey levels become cells, as `nav2_map_server` has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum GridMode {
    /// Occupied, free or unknown; transparency counts as one more channel.
    Trinary,
    /// As `Trinary` with probabilities between the thresholds; what is not opaque is unknown.
    Scale,
    /// The grey level itself (0 to 255) is the probability in percent; above 100 unknown.
    Raw,
}

/// What the YAML file says.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct GridMeta {
    /// Name of the picture, relative to the YAML file.
    pub(super) image: String,
    pub(super) resolution_m: f64,
    /// `map_from_grid`: pose of the picture's lower left corner.
    pub(super) origin: Pose2,
    pub(super) mode: GridMode,
    /// White is occupied.
    pub(super) is_negated: bool,
    /// Occupied above this, 0 to 1.
    pub(super) occupied_thresh: f64,
    /// Free below this, 0 to 1.
    pub(super) free_thresh: f64,
}

/// Parses the text of a YAML file.
pub(super) fn parse(text: &str) -> Result<GridMeta, GridError> {
    let yaml = |problem: String| GridError::Yaml { problem };
    if text.len() > MAX_YAML_BYTES {
        return Err(yaml(format!("more than {MAX_YAML_BYTES} bytes; this is no map's .yaml")));
    }
    // Snippets would repeat the file in the message; the place of the error is enough.
    let options = serde_saphyr::options! { with_snippet: false };
    let value: Value =
        serde_saphyr::from_str_with_options(text, options).map_err(|e| yaml(format!("not YAML: {e}")))?;
    let Value::Object(fields) = value else {
        return Err(yaml("no fields; a map's .yaml has image, resolution, origin, negate, ...".to_owned()));
    };
    if let Some(kind) = other_kind(&fields) {
        return Err(yaml(kind.to_owned()));
    }
    let fields = Fields(fields);
    let meta = GridMeta {
        image: fields.image()?,
        resolution_m: fields.number("resolution", RESOLUTION_M, "metres per cell")?,
        origin: fields.origin()?,
        mode: fields.mode()?,
        is_negated: fields.negate()?,
        occupied_thresh: fields.number("occupied_thresh", (0.0, 1.0), "a share")?,
        free_thresh: fields.number("free_thresh", (0.0, 1.0), "a share")?,
    };
    if meta.free_thresh > meta.occupied_thresh {
        return Err(field("free_thresh", "must not be above occupied_thresh"));
    }
    Ok(meta)
}

/// What a YAML file is that has fields of another program.
fn other_kind(fields: &Map<String, Value>) -> Option<&'static str> {
    let has = |name: &str| fields.contains_key(name);
    if has("image") {
        None
    } else if has("levels") {
        Some(
            "this is a building of Open-RMF's traffic editor, whose walls are in pixels of its drawing: give the .yaml of a \
             grid map, or the drawing as SVG with a size",
        )
    } else if has("camera_matrix") {
        Some("this is the calibration of a camera; give a map's .yaml")
    } else if has("rosbag2_bagfile_information") {
        Some("this is the metadata of a bag; give a map's .yaml")
    } else if has("robot") || fields.values().any(|value| value.get("ros__parameters").is_some()) {
        Some("these are settings of a program; give a map's .yaml")
    } else {
        None
    }
}

fn field(field: &'static str, problem: impl Into<String>) -> GridError {
    GridError::Field { field, problem: problem.into() }
}

/// A number, or a string that is one.
fn number(value: &Value) -> Option<f64> {
    let number = match value {
        Value::Number(n) => n.as_f64(),
        Value::String(s) => s.trim().parse().ok(),
        _ => None,
    };
    number.filter(|n: &f64| n.is_finite())
}

struct Fields(Map<String, Value>);

impl Fields {
    fn get(&self, name: &'static str) -> Result<&Value, GridError> {
        let value = self.0.get(name).filter(|v| !v.is_null());
        value.ok_or_else(|| field(name, "missing; write `NAME: value` in the .yaml".replace("NAME", name)))
    }

    fn number(&self, name: &'static str, (low, high): (f64, f64), what: &str) -> Result<f64, GridError> {
        let value = self.get(name)?;
        let bad = || field(name, format!("must be {what}, a number from {low} to {high}, not {value}"));
        number(value).filter(|v| (low..=high).contains(v)).ok_or_else(bad)
    }

    fn image(&self) -> Result<String, GridError> {
        match self.get("image")? {
            Value::String(name) if !name.trim().is_empty() => Ok(name.clone()),
            // `image: 7` names a file, too.
            Value::Number(name) => Ok(name.to_string()),
            other => Err(field("image", format!("must be the name of the picture, not {other}"))),
        }
    }

    fn origin(&self) -> Result<Pose2, GridError> {
        let bad = |what: String| field("origin", format!("must be [x, y, yaw] in metres and radians{what}"));
        let value = self.get("origin")?;
        let Value::Array(items) = value else { return Err(bad(format!(", not {value}"))) };
        let numbers: Vec<f64> = items.iter().filter_map(number).collect();
        let [x, y, yaw] = numbers[..] else { return Err(bad(format!(", not {value}"))) };
        if items.len() != numbers.len() {
            return Err(bad(format!(", not {value}")));
        }
        let pose = Pose2::new(x, y, yaw);
        pose.check().map_err(|e| bad(format!(": {e}")))?;
        Ok(pose)
    }

    fn mode(&self) -> Result<GridMode, GridError> {
        match self.0.get("mode") {
            None | Some(Value::Null) => Ok(GridMode::Trinary),
            Some(Value::String(mode)) if mode.eq_ignore_ascii_case("trinary") => Ok(GridMode::Trinary),
            Some(Value::String(mode)) if mode.eq_ignore_ascii_case("scale") => Ok(GridMode::Scale),
            Some(Value::String(mode)) if mode.eq_ignore_ascii_case("raw") => Ok(GridMode::Raw),
            Some(other) => Err(field("mode", format!("must be trinary, scale or raw, not {other}"))),
        }
    }

    /// A number or a word, as `map_server` takes both.
    fn negate(&self) -> Result<bool, GridError> {
        let value = self.get("negate")?;
        let word = match value {
            Value::Bool(is_true) => return Ok(*is_true),
            Value::String(word) => word.trim().to_ascii_lowercase(),
            other => other.to_string(),
        };
        match word.as_str() {
            "0" | "false" | "no" | "off" | "n" => Ok(false),
            "1" | "true" | "yes" | "on" | "y" => Ok(true),
            _ => Err(field("negate", format!("must be 0, 1, true or false, not {value}"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: &str = "image: m.pgm\nresolution: 0.05\norigin: [-10.0, 2, 0.5]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";

    #[test]
    fn every_form_of_yaml_says_the_same() {
        let plain = parse(PLAIN).unwrap();
        assert_eq!(plain.image, "m.pgm");
        assert_eq!(plain.origin, Pose2::new(-10.0, 2.0, 0.5));
        assert_eq!((plain.mode, plain.is_negated), (GridMode::Trinary, false));
        for (from, to) in [
            ("[-10.0, 2, 0.5]", "\n  - -10.0\n  - 2\n  - 0.5"),
            ("[-10.0, 2, 0.5]", "\n- -10.0\n- 2\n- 0.5"),
            ("[-10.0, 2, 0.5]", "[-10.0,\n         2, 0.5]"),
            ("[-10.0, 2, 0.5]", "[ -1e1, +2.0, '0.5' ]"),
            ("negate: 0", "negate: false"),
            ("negate: 0", "negate: no"),
            ("negate: 0", "negate: 'False'"),
            ("image: m.pgm", "image: \"m.pgm\""),
            ("image: m.pgm", "# of the ground floor\nimage: 'm.pgm' # the picture"),
            ("image: m.pgm", "---\nimage:   m.pgm\nmode: trinary\nextra: {a: [1, 2]}"),
            ("resolution: 0.05", "resolution: 5.0e-2"),
            ("\n", "\r\n"),
        ] {
            let text = PLAIN.replace(from, to);
            assert_eq!(parse(&text).unwrap_or_else(|e| panic!("{e}: {text}")), plain, "{text}");
        }
        let flow = "{image: m.pgm, resolution: 0.05, origin: [-10.0, 2, 0.5],\n negate: 0, occupied_thresh: 0.65, free_thresh: 0.196}";
        assert_eq!(parse(flow).unwrap(), plain);
        for (word, is_negated) in [("1", true), ("true", true), ("yes", true), ("0", false), ("off", false)] {
            let meta = parse(&PLAIN.replace("negate: 0", &format!("negate: {word}"))).unwrap();
            assert_eq!(meta.is_negated, is_negated, "{word}");
        }
        for (word, mode) in [
            ("trinary", GridMode::Trinary),
            ("Trinary", GridMode::Trinary),
            ("scale", GridMode::Scale),
            ("SCALE", GridMode::Scale),
            ("raw", GridMode::Raw),
            ("Raw", GridMode::Raw),
        ] {
            assert_eq!(parse(&format!("{PLAIN}mode: {word}\n")).unwrap().mode, mode);
        }
    }

    #[test]
    fn what_is_wrong_is_named_with_what_to_do() {
        for (from, to, sentence) in [
            ("[-10.0, 2, 0.5]", "[1, 2]", "origin: must be [x, y, yaw]"),
            ("[-10.0, 2, 0.5]", "[1, 2, 3, 4]", "origin: must be [x, y, yaw]"),
            ("[-10.0, 2, 0.5]", "[1, 2, 3, north]", "origin: must be [x, y, yaw]"),
            ("[-10.0, 2, 0.5]", "[1, 2, .nan]", "line 3"),
            ("[-10.0, 2, 0.5]", "[1e300, 2, 0]", "origin: must be [x, y, yaw]"),
            ("[-10.0, 2, 0.5]", "here", "origin: must be [x, y, yaw]"),
            ("origin: [-10.0, 2, 0.5]\n", "", "origin: missing"),
            ("resolution: 0.05", "resolution: 0", "resolution: must be metres per cell"),
            ("resolution: 0.05", "resolution: 5 cm", "resolution: must be metres per cell"),
            ("negate: 0\n", "", "negate: missing"),
            ("negate: 0", "negate: 2", "negate: must be 0, 1, true or false"),
            ("free_thresh: 0.196", "free_thresh: low", "free_thresh: must be a share"),
            ("free_thresh: 0.196", "free_thresh: 0.7", "free_thresh: must not be above"),
            ("m.pgm", "m.pgm\nmode: rows", "mode: must be trinary, scale or raw"),
            ("m.pgm", "[m.pgm]", "image: must be the name of the picture"),
            ("m.pgm", "", "image: missing"),
            ("m.pgm", "m.pgm\nimage: n.pgm", "not YAML"),
            ("m.pgm", "[m.pgm", "not YAML"),
        ] {
            let error = parse(&PLAIN.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(sentence), "{to}: {error}");
        }
        for (text, words) in [
            ("name: office\nlevels: {L1: {walls: []}}\ncrowd_sim: {}\n", "Open-RMF"),
            ("image_width: 640\ncamera_matrix: {rows: 3}\n", "calibration of a camera"),
            ("rosbag2_bagfile_information: {version: 5}\n", "metadata of a bag"),
            ("slam_toolbox: {ros__parameters: {resolution: 0.05}}\n", "settings of a program"),
            ("resolution: 0.05\n", "image: missing"),
        ] {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains(words), "{words}: {error}");
        }
        assert!(parse("- a\n- b\n").unwrap_err().to_string().contains("no fields"));
        let comment = format!("{PLAIN}#{}", "x".repeat(MAX_YAML_BYTES - PLAIN.len() - 1));
        assert!(parse(&comment).is_ok());
        assert!(parse(&(comment + "x")).unwrap_err().to_string().contains("more than 65536 bytes"));
    }

    proptest::proptest! {
        #[test]
        fn no_text_is_a_panic(at in 0..PLAIN.len(), byte in 0_u8..128, cut in 0..PLAIN.len()) {
            let mut bytes = PLAIN.as_bytes().to_vec();
            bytes[at] = byte;
            bytes.truncate(PLAIN.len() - cut);
            // An answer, whichever.
            parse(std::str::from_utf8(&bytes).expect("ASCII")).ok();
        }
    }
}
