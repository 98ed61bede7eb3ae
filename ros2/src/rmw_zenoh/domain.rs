//! The number that separates graphs of ROS: `ROS_DOMAIN_ID`.

/// A domain written as in keys: decimal digits without sign or leading zeros.
pub(super) fn parse(text: &str) -> Option<u32> {
    let is_plain = text.bytes().all(|b| b.is_ascii_digit()) && (text == "0" || !text.starts_with('0'));
    if is_plain { text.parse().ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_plain_form_is_a_domain() {
        assert_eq!([parse("0"), parse("232")], [Some(0), Some(232)]);
        assert!(["", "+1", "-1", "00", "07", "1a", "4294967296"].iter().all(|text| parse(text).is_none()));
    }
}
