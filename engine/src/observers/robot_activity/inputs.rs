//! What is used and what is refused of one robot's inputs. In: each input with its time. Out:
//! counts by kind and by reason, and when the log is to be told of a reason again.

use crate::inputs::{Input, Refused};
use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

/// Reasons that are kept of one kind. Codes are the server's own, far fewer than this; further ones
/// are counted without.
pub const MAX_REASONS: usize = 64;
/// How often the log is told of a reason that goes on.
const TELL_EVERY: Duration = Duration::from_mins(1);

/// A reason for which inputs were refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reason {
    /// A stable word.
    pub code: String,
    /// The field at fault of the last one.
    pub field: String,
    /// A sentence for a person about the last one.
    pub detail: String,
    /// How many.
    pub count: u64,
    /// Time since the last one.
    pub ago: Duration,
}

/// What became of one kind of input.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputActivity {
    /// The kind.
    pub input: Input,
    /// How many were used.
    pub used: u64,
    /// How many were refused, or lack what others need.
    pub refused: u64,
    /// How many of them since the last that was used.
    pub refused_in_a_row: u64,
    /// Why, the last reason first.
    pub reasons: Vec<Reason>,
}

#[derive(Debug)]
struct Record {
    field: String,
    detail: String,
    count: u64,
    last: Instant,
    /// When the log was told, and how many came since.
    told: Instant,
    untold: u64,
}

#[derive(Debug, Default)]
struct Counts {
    used: u64,
    refused: u64,
    in_a_row: u64,
    reasons: BTreeMap<String, Record>,
}

/// All inputs of one robot.
#[derive(Debug, Default)]
pub(super) struct Inputs(BTreeMap<Input, Counts>);

impl Inputs {
    pub(super) fn used(&mut self, input: Input) {
        let counts = self.0.entry(input).or_default();
        counts.used += 1;
        counts.in_a_row = 0;
    }

    /// How many were refused for this reason since the log was told, where it is to be told again.
    pub(super) fn refused(&mut self, input: Input, refused: Refused<'_>, now: Instant) -> Option<u64> {
        let counts = self.0.entry(input).or_default();
        counts.refused += 1;
        counts.in_a_row += 1;
        let Some(record) = counts.reasons.get_mut(refused.code) else {
            if counts.reasons.len() < MAX_REASONS {
                let (field, detail) = (refused.field.to_owned(), refused.detail.to_owned());
                let record = Record { field, detail, count: 1, last: now, told: now, untold: 0 };
                counts.reasons.insert(refused.code.to_owned(), record);
                return Some(1);
            }
            return None;
        };
        record.count += 1;
        record.untold += 1;
        record.last = record.last.max(now);
        refused.field.clone_into(&mut record.field);
        refused.detail.clone_into(&mut record.detail);
        (now.saturating_duration_since(record.told) >= TELL_EVERY).then(|| {
            record.told = now;
            std::mem::take(&mut record.untold)
        })
    }

    pub(super) fn shown(&self, now: Instant) -> Vec<InputActivity> {
        let shown = |(input, counts): (&Input, &Counts)| {
            let mut reasons: Vec<Reason> =
                counts.reasons.iter().map(|(code, r)| r.shown(code, now)).collect();
            reasons.sort_by_key(|reason| reason.ago);
            let Counts { used, refused, in_a_row, .. } = *counts;
            InputActivity { input: *input, used, refused, refused_in_a_row: in_a_row, reasons }
        };
        self.0.iter().map(shown).collect()
    }
}

impl Record {
    fn shown(&self, code: &str, now: Instant) -> Reason {
        Reason {
            code: code.to_owned(),
            field: self.field.clone(),
            detail: self.detail.clone(),
            count: self.count,
            ago: now.saturating_duration_since(self.last),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused<'a>(code: &'a str, detail: &'a str) -> Refused<'a> {
        Refused { code, field: "bearing_step_rad", detail }
    }

    #[test]
    fn refusals_are_counted_by_reason_and_in_a_row_and_the_last_one_is_first() {
        let (mut inputs, start) = (Inputs::default(), Instant::now());
        let at = |ms| start + Duration::from_millis(ms);
        inputs.used(Input::Scan);
        inputs.refused(Input::Scan, refused("out_of_range", "a turn and more"), at(0));
        inputs.refused(Input::Scan, refused("not_newer", "again"), at(10));
        inputs.refused(Input::Scan, refused("out_of_range", "two turns"), at(20));
        inputs.refused(Input::Frame, refused("bad_image", "none"), at(20));
        let shown = inputs.shown(at(30));
        assert_eq!(
            (shown[1].input, shown[1].used, shown[1].refused, shown[1].refused_in_a_row),
            (Input::Scan, 1, 3, 3)
        );
        let reasons: Vec<_> =
            shown[1].reasons.iter().map(|r| (r.code.as_str(), r.detail.as_str(), r.count)).collect();
        assert_eq!(reasons, [("out_of_range", "two turns", 2), ("not_newer", "again", 1)]);
        assert_eq!(shown[1].reasons[0].ago, Duration::from_millis(10));
        inputs.used(Input::Scan);
        let after = inputs.shown(at(30));
        assert_eq!((after[1].used, after[1].refused, after[1].refused_in_a_row), (2, 3, 0));
        assert_eq!(after[0].refused_in_a_row, 1, "each kind has its own");
    }

    #[test]
    fn the_log_is_told_of_a_reason_at_once_and_then_its_rate() {
        let (mut inputs, start) = (Inputs::default(), Instant::now());
        let mut told = Vec::new();
        // One a second for 125 seconds.
        for s in 0..125 {
            let at = start + Duration::from_secs(s);
            told.extend(inputs.refused(Input::Scan, refused("out_of_range", ""), at).map(|n| (s, n)));
        }
        assert_eq!(told, [(0, 1), (60, 60), (120, 60)]);
        assert_eq!(inputs.refused(Input::Scan, refused("not_newer", ""), start), Some(1), "another reason");
    }

    #[test]
    fn reasons_are_bounded_and_all_are_counted() {
        let (mut inputs, start) = (Inputs::default(), Instant::now());
        let told = (0..2 * MAX_REASONS)
            .filter_map(|i| inputs.refused(Input::Frame, refused(&format!("code_{i}"), ""), start));
        assert_eq!(told.count(), MAX_REASONS);
        let shown = &inputs.shown(start)[0];
        assert_eq!((shown.refused, shown.reasons.len()), (2 * MAX_REASONS as u64, MAX_REASONS));
    }
}
