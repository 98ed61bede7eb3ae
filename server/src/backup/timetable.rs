//! When backups are made, and what they are called.

use crate::config::BackupSettings;
use std::time::Duration;

/// After a failure the next attempt is made at the latest after this time.
const RETRY: Duration = Duration::from_hours(1);
const DAY_MS: i64 = 86_400_000;

/// Time between two scheduled backups, if they are scheduled.
pub(super) fn every(settings: BackupSettings) -> Option<Duration> {
    (settings.every_hours > 0).then(|| Duration::from_hours(u64::from(settings.every_hours)))
}

/// Time until the next backup. Times are ms since the Unix epoch: of the newest backup, of a failed
/// attempt after it, now.
pub(super) fn wait(every: Duration, newest: Option<i64>, failed: Option<i64>, now: i64) -> Duration {
    let after = |start: i64, pause: Duration| start.saturating_add(pause.as_millis() as i64);
    let due = newest.map_or(now, |start| after(start, every));
    let due = failed.map_or(due, |start| due.max(after(start, RETRY.min(every))));
    // A clock that was set back must not put the next backup off for longer than the interval.
    Duration::from_millis(due.saturating_sub(now).max(0) as u64).min(every)
}

/// A name that is not taken: the time in UTC, as in `20261123-140530`, or with a number after it.
pub(super) fn name(now_ms: i64, is_taken: impl Fn(&str) -> bool) -> String {
    let (year, month, day) = date(now_ms.div_euclid(DAY_MS));
    let second = now_ms.rem_euclid(DAY_MS) / 1000;
    let time =
        format!("{year:04}{month:02}{day:02}-{:02}{:02}{:02}", second / 3600, second / 60 % 60, second % 60);
    if !is_taken(&time) {
        return time;
    }
    let numbered = |n: u32| format!("{time}-{n:02}");
    (2..100).map(numbered).find(|name| !is_taken(name)).unwrap_or_else(|| numbered(100))
}

/// Whether this may be the name of a backup.
pub(super) fn is_name(name: &str) -> bool {
    (15..=19).contains(&name.len()) && name.bytes().all(|b| b.is_ascii_digit() || b == b'-')
}

/// Year, month and day of a day since 1970-01-01, Gregorian.
fn date(day: i64) -> (i64, i64, i64) {
    // Days since 0000-03-01; a year from March on has its leap day at its end.
    let day = day + 719_468;
    let (era, of_era) = (day.div_euclid(146_097), day.rem_euclid(146_097));
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let (month, years) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    (era * 400 + year + years, month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_times_in_utc_and_differ() {
        let free = |_: &str| false;
        assert_eq!(name(0, free), "19700101-000000");
        assert_eq!(name(951_782_399_999, free), "20000228-235959");
        assert_eq!(name(951_825_600_000, free), "20000229-120000");
        assert_eq!(name(1_795_442_730_000, free), "20261123-140530");
        assert_eq!(name(0, |name| name == "19700101-000000"), "19700101-000000-02");
        assert!(is_name(&name(0, |name| name.len() == 15)) && !is_name("../../etc/passwd"));
    }

    #[test]
    fn the_next_backup_is_due_an_interval_after_the_newest_or_after_a_failure() {
        let (every, hour) = (Duration::from_hours(24), 3_600_000);
        assert_eq!(wait(every, None, None, 5 * hour), Duration::ZERO, "there is none");
        assert_eq!(wait(every, Some(5 * hour), None, 6 * hour), Duration::from_hours(23));
        assert_eq!(wait(every, Some(0), None, 99 * hour), Duration::ZERO, "the server was off");
        assert_eq!(wait(every, None, Some(6 * hour), 6 * hour), RETRY);
        assert_eq!(wait(every, Some(0), Some(25 * hour), 25 * hour), RETRY);
        assert_eq!(wait(every, Some(99 * hour), None, 6 * hour), every, "the clock was set back");
    }
}
