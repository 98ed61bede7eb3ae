//! Where data lies unless it is said, by the convention of the platform, and which variables are
//! settings.

use super::{NOT_SETTINGS, RawConfig};
use figment::{Provider as _, providers::Serialized};
use std::{
    collections::BTreeSet,
    ffi::OsString,
    path::{Path, PathBuf},
};

/// What the variables of the settings begin with.
pub(super) const PREFIX: &str = "WAYMARK_";
/// The folder of the program among those of others.
const FOLDER: &str = "waymark";

/// The folder for data of the user's programs: `$XDG_DATA_HOME/waymark` or
/// `~/.local/share/waymark`, on macOS `~/Library/Application Support/waymark`, on Windows
/// `%LOCALAPPDATA%\waymark`; `waymark-data` here where there is none.
pub fn default_data() -> PathBuf {
    data_of(|name| std::env::var_os(name), std::env::consts::OS)
}

fn data_of(variable: impl Fn(&str) -> Option<OsString>, system: &str) -> PathBuf {
    let folder = |name: &str| variable(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let home = |below: &str| folder("HOME").map(|home| home.join(Path::new(below)));
    let base = match system {
        "macos" => home("Library/Application Support"),
        // A Windows path is not absolute for the tests of another system.
        "windows" => variable("LOCALAPPDATA").map(PathBuf::from),
        _ => folder("XDG_DATA_HOME").or_else(|| home(".local/share")),
    };
    base.map_or_else(|| PathBuf::from("waymark-data"), |base| base.join(FOLDER))
}

impl RawConfig {
    /// Variables that begin like those of the settings and are none: a misspelt one, or one of
    /// another program.
    pub fn unknown_variables() -> Vec<String> {
        let settings = names();
        let names = std::env::vars_os().filter_map(|(name, _)| name.into_string().ok());
        names
            .filter(|name| name.strip_prefix(PREFIX).is_some_and(|rest| !is_known(rest, &settings)))
            .collect()
    }
}

/// Whether the rest of a variable's name is a setting or an option of the command line. What lies
/// inside a group is left to the reading of the settings.
pub(super) fn is_known(rest: &str, settings: &BTreeSet<String>) -> bool {
    let name = rest.to_lowercase();
    let group = name.split("__").next().unwrap_or_default();
    settings.contains(group) || NOT_SETTINGS.contains(&name.as_str())
}

/// The settings and their groups.
pub(super) fn names() -> BTreeSet<String> {
    let defaults = Serialized::defaults(RawConfig::default()).data().unwrap_or_default();
    defaults.into_values().flat_map(std::collections::BTreeMap::into_keys).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_lies_where_the_platform_has_it() {
        let of = |system: &str, variables: &[(&str, &str)]| {
            let found = data_of(
                |name| variables.iter().find(|(n, _)| *n == name).map(|(_, value)| OsString::from(value)),
                system,
            );
            found.display().to_string()
        };
        let home = ("HOME", "/home/kim");
        assert_eq!(of("linux", &[home]), "/home/kim/.local/share/waymark");
        assert_eq!(of("linux", &[home, ("XDG_DATA_HOME", "/data")]), "/data/waymark");
        assert_eq!(of("linux", &[home, ("XDG_DATA_HOME", "data")]), "/home/kim/.local/share/waymark");
        assert_eq!(of("macos", &[home]), "/home/kim/Library/Application Support/waymark");
        assert!(of("windows", &[("LOCALAPPDATA", "C:\\kim")]).starts_with("C:\\kim"));
        assert_eq!(of("linux", &[]), "waymark-data");
    }

    #[test]
    fn variables_of_no_setting_are_known_as_such() {
        let settings = names();
        for known in ["DATA", "HTTP", "LIMITS__FRAME_BYTES", "TLS__ENABLED", "TOKEN", "LOG_FORMAT"] {
            assert!(is_known(known, &settings), "{known}");
        }
        for unknown in ["COLOUR", "LIMIT__FRAME_BYTES", "", "HTTPS"] {
            assert!(!is_known(unknown, &settings), "{unknown}");
        }
    }
}
