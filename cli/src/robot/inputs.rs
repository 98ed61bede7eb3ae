//! What became of a robot's messages, in lines for a person.

use client::api::{RefusalReason, RobotActivity, RobotInput};

/// A line for each kind of message, and two for each reason for which some were refused.
pub(crate) fn lines(inputs: &[RobotInput]) -> Vec<String> {
    inputs.iter().flat_map(input_lines).collect()
}

fn input_lines(of: &RobotInput) -> Vec<String> {
    let in_a_row = match of.refused_in_a_row {
        0 | 1 => String::new(),
        many => format!(", the last {many} in a row"),
    };
    let counts = format!("{:<12} {} used, {} refused{in_a_row}", of.input, of.used, of.refused);
    let reason = |why: &RefusalReason| {
        let RefusalReason { code, field, detail, advice, count, .. } = why;
        let what = format!("  {count} times {code}: {field}: {detail}");
        if advice.is_empty() { vec![what] } else { vec![what, format!("    {advice}")] }
    };
    std::iter::once(counts).chain(of.reasons.iter().flat_map(reason)).collect()
}

/// What came between two looks.
pub(crate) fn since(before: Option<&RobotActivity>, after: &RobotActivity) -> Vec<RobotInput> {
    let old = |input: &str| before.and_then(|b| b.inputs.iter().find(|i| i.input == input));
    let newer = |now: &RobotInput| {
        let Some(old) = old(&now.input) else { return now.clone() };
        let count = |code: &str| old.reasons.iter().find(|r| r.code == code).map_or(0, |r| r.count);
        let reasons = now
            .reasons
            .iter()
            .map(|why| RefusalReason { count: why.count.saturating_sub(count(&why.code)), ..why.clone() });
        let refused = now.refused.saturating_sub(old.refused);
        RobotInput {
            input: now.input.clone(),
            used: now.used.saturating_sub(old.used),
            refused,
            refused_in_a_row: now.refused_in_a_row.min(refused),
            reasons: reasons.filter(|why| why.count > 0).collect(),
        }
    };
    after.inputs.iter().map(newer).filter(|input| input.used + input.refused > 0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scans(used: u64, refused: u64) -> RobotInput {
        let reason = RefusalReason {
            code: "out_of_range".into(),
            field: "bearing_step_rad".into(),
            detail: "more than a turn".into(),
            advice: "Correct it.".into(),
            count: refused,
            ago_ms: 7,
        };
        let reasons = if refused > 0 { vec![reason] } else { Vec::new() };
        RobotInput { input: "scan".into(), used, refused, refused_in_a_row: refused, reasons }
    }

    #[test]
    fn each_kind_has_a_line_and_each_reason_its_advice() {
        let shown = lines(&[scans(3, 40)]);
        let expected = [
            "scan         3 used, 40 refused, the last 40 in a row",
            "  40 times out_of_range: bearing_step_rad: more than a turn",
            "    Correct it.",
        ];
        assert_eq!(shown, expected);
        assert_eq!(lines(&[scans(3, 0)]), ["scan         3 used, 0 refused"]);
    }

    #[test]
    fn what_came_between_two_looks_is_the_difference() {
        let activity = |scan| RobotActivity { inputs: vec![scan], ..RobotActivity::default() };
        let (before, after) = (activity(scans(5, 2)), activity(scans(5, 42)));
        assert_eq!(since(Some(&before), &after), [scans(0, 40)]);
        assert_eq!(since(Some(&after), &after), []);
        assert_eq!(since(None, &before), [scans(5, 2)]);
        let none_refused = since(Some(&before), &activity(scans(9, 2)));
        assert_eq!((none_refused[0].used, none_refused[0].refused, none_refused[0].reasons.len()), (4, 0, 0));
    }
}
