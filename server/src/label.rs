//! Labels: text of one line that people type and others read, such as a floor, the name of an area,
//! the reason of a change. In: text. Out: whether it reads as it is written.
//!
//! Format characters that nobody sees make one label look like another, or turn the order of what
//! stands beside it (Unicode technical reports 36 and 39). They are refused. The joiners U+200C and
//! U+200D and variation selectors stay: words of Persian and Hindi, and pictograms, are spelt with
//! them.

use std::ops::RangeInclusive;

/// Characters without a shape of their own that are refused, besides control characters.
const INVISIBLE: [RangeInclusive<char>; 16] = [
    '\u{ad}'..='\u{ad}',
    '\u{34f}'..='\u{34f}',
    '\u{61c}'..='\u{61c}',
    '\u{115f}'..='\u{1160}',
    '\u{17b4}'..='\u{17b5}',
    '\u{180e}'..='\u{180e}',
    '\u{200b}'..='\u{200b}',
    // Marks of direction.
    '\u{200e}'..='\u{200f}',
    // Ends of lines and paragraphs, embeddings and overrides of direction.
    '\u{2028}'..='\u{202e}',
    // Invisible operators, isolates, and characters that Unicode advises against.
    '\u{2060}'..='\u{206f}',
    '\u{3164}'..='\u{3164}',
    '\u{feff}'..='\u{feff}',
    '\u{ffa0}'..='\u{ffa0}',
    '\u{fff9}'..='\u{fffb}',
    '\u{1d173}'..='\u{1d17a}',
    // Tags: a text within the text.
    '\u{e0000}'..='\u{e007f}',
];

/// Why a text is no label.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(crate) enum LabelError {
    /// Empty, only spaces, or too long.
    #[error("1 to {0} characters on one line")]
    Length(usize),
    /// A control character or one that nobody sees.
    #[error(
        "character {position} is U+{code:04X}, which nobody sees and which can change how the text reads: leave it out"
    )]
    Invisible {
        /// From 1.
        position: usize,
        /// Its number in Unicode.
        code: u32,
    },
}

/// Checks a label of at most `max` characters.
pub(crate) fn check_label(text: &str, max: usize) -> Result<(), LabelError> {
    let is_invisible = |c: &char| c.is_control() || INVISIBLE.iter().any(|range| range.contains(c));
    if let Some((before, c)) = text.chars().enumerate().find(|(_, c)| is_invisible(c)) {
        return Err(LabelError::Invisible { position: before + 1, code: u32::from(c) });
    }
    let fits = (1..=max).contains(&text.chars().count()) && !text.trim().is_empty();
    if fits { Ok(()) } else { Err(LabelError::Length(max)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_of_one_line_and_have_no_characters_that_nobody_sees() {
        for fine in [
            "hall",
            "Ebene 2 (Süd)",
            "二階",
            "טיפול",
            "می\u{200c}خواهم",
            "👩\u{200d}🔧",
            "x".repeat(64).as_str(),
        ] {
            assert_eq!(check_label(fine, 64), Ok(()), "{fine}");
        }
        for wrong in ["", " ", "\u{3000}", "x".repeat(65).as_str()] {
            assert_eq!(check_label(wrong, 64), Err(LabelError::Length(64)), "{wrong:?}");
        }
        let bidirectional = ['\u{61c}', '\u{200e}', '\u{200f}'].into_iter();
        let bidirectional = bidirectional.chain('\u{202a}'..='\u{202e}').chain('\u{2066}'..='\u{2069}');
        let others =
            ['\n', '\0', '\u{85}', '\u{ad}', '\u{200b}', '\u{2028}', '\u{2060}', '\u{feff}', '\u{e0041}'];
        for c in bidirectional.chain(others) {
            let refused = Err(LabelError::Invisible { position: 3, code: u32::from(c) });
            assert_eq!(check_label(&format!("ab{c}cd"), 64), refused, "{c:?}");
        }
        let text = check_label("ab\u{202e}", 64).unwrap_err().to_string();
        assert!(text.starts_with("character 3 is U+202E") && text.ends_with("leave it out"), "{text}");
    }
}
