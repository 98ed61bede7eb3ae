//! Settings of backups.

use super::{ConfigError, invalid};
use serde::{Deserialize, Serialize};

/// Most backups that are kept and listed.
pub(crate) const MAX_KEPT: usize = 1000;
/// Longest time between two scheduled backups: a year.
const MAX_EVERY_HOURS: u32 = 8760;

/// When backups are made by themselves, and how many are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BackupSettings {
    /// Hours between two scheduled backups; 0: none is made by itself.
    pub every_hours: u32,
    /// Backups that stay in the data directory; older ones are removed when one is complete.
    pub keep: usize,
}

impl Default for BackupSettings {
    fn default() -> Self {
        Self { every_hours: 0, keep: 7 }
    }
}

/// Checks the ranges.
pub(super) fn checked(settings: BackupSettings) -> Result<BackupSettings, ConfigError> {
    if settings.every_hours > MAX_EVERY_HOURS {
        let reason = format!("{} is more than {MAX_EVERY_HOURS}", settings.every_hours);
        return Err(invalid("backup.every_hours", reason));
    }
    if !(1..=MAX_KEPT).contains(&settings.keep) {
        return Err(invalid("backup.keep", format!("{} is not in 1 to {MAX_KEPT}", settings.keep)));
    }
    Ok(settings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_named() {
        let check = |every_hours, keep| checked(BackupSettings { every_hours, keep });
        assert!(check(0, 1).is_ok() && check(MAX_EVERY_HOURS, MAX_KEPT).is_ok());
        for (settings, field) in [
            (check(MAX_EVERY_HOURS + 1, 1), "backup.every_hours"),
            (check(0, 0), "backup.keep"),
            (check(0, MAX_KEPT + 1), "backup.keep"),
        ] {
            assert!(settings.unwrap_err().to_string().contains(field));
        }
    }
}
