//! The namespace of a zenoh session: a prefix of every key of a robot, data and tokens alike, that
//! keeps robots of the same domain apart. The session adds and removes it, so a server sees it and
//! the robot does not.
//!
//! Source: `eclipse-zenoh/zenoh DEFAULT_CONFIG.json5` (`namespace`), tried with zenoh 1.10.2:
//! `robots/r1` gives `robots/r1/0/chatter/...` and `robots/r1/@ros2_lv/0/...`.

/// The key as the robot sees it; `None` for a key outside of the namespace. An empty namespace
/// holds every key.
pub fn strip_namespace<'a>(key: &'a str, namespace: &str) -> Option<&'a str> {
    if namespace.is_empty() {
        return Some(key);
    }
    key.strip_prefix(namespace)?.strip_prefix('/')
}

/// The key as the server sees it.
pub fn inside_namespace(key: &str, namespace: &str) -> String {
    if namespace.is_empty() { key.to_owned() } else { format!("{namespace}/{key}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prefix_is_added_and_removed_by_whole_parts() {
        assert_eq!(inside_namespace("0/scan", "robots/r1"), "robots/r1/0/scan");
        assert_eq!(strip_namespace("robots/r1/0/scan", "robots/r1"), Some("0/scan"));
        assert_eq!(strip_namespace("robots/r12/0/scan", "robots/r1"), None);
        assert_eq!(strip_namespace("robots/r1", "robots/r1"), None);
        assert_eq!(strip_namespace("0/scan", ""), Some("0/scan"));
        assert_eq!(inside_namespace("0/scan", ""), "0/scan");
    }
}
