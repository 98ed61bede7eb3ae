//! How long tokens and certificates are valid: read, and shown.

use std::time::{SystemTime, UNIX_EPOCH};

/// A duration: `90d`, `12h`.
pub(crate) fn seconds(text: &str) -> Result<u64, String> {
    let units = [('s', 1), ('m', 60), ('h', 3600), ('d', 86_400), ('w', 604_800)];
    let found = units.into_iter().find_map(|(unit, s)| {
        let number: u64 = text.strip_suffix(unit)?.parse().ok()?;
        number.checked_mul(s).filter(|s| *s > 0)
    });
    found.ok_or_else(|| "a number with s, m, h, d or w, such as 90d".to_owned())
}

/// The present, ms since the Unix epoch.
pub(crate) fn now_ms() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_millis() as i64)
}

/// Whether and how long something is valid that was revoked or expires then.
pub(crate) fn validity(revoked_ms: Option<i64>, expires_ms: Option<i64>, now_ms: i64) -> String {
    match (revoked_ms, expires_ms) {
        (Some(_), _) => "revoked".to_owned(),
        (None, None) => "until revoked".to_owned(),
        (None, Some(end)) if end <= now_ms => "expired".to_owned(),
        (None, Some(end)) => {
            let minutes = (end - now_ms) / 60_000;
            match minutes {
                0..120 => format!("{minutes} min"),
                120..2880 => format!("{} h", minutes / 60),
                _ => format!("{} d", minutes / 1440),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_checked() {
        assert_eq!((seconds("90d"), seconds("2w"), seconds("5s")), (Ok(7_776_000), Ok(1_209_600), Ok(5)));
        for bad in ["", "d", "90", "0d", "-1d", "1y", "99999999999999999999d", "1844674407370955161600s"] {
            assert!(seconds(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn what_is_left_is_shown() {
        let of = |expires_ms, revoked_ms| validity(revoked_ms, expires_ms, 1_000_000);
        assert_eq!(of(None, None), "until revoked");
        assert_eq!(of(None, Some(1)), "revoked");
        assert_eq!(of(Some(1_000_000), None), "expired");
        assert_eq!(of(Some(1_000_000 + 3_600_000), None), "60 min");
        assert_eq!(of(Some(1_000_000 + 36 * 3_600_000), None), "36 h");
        assert_eq!(of(Some(1_000_000 + 90 * 86_400_000), None), "90 d");
    }
}
