//! What a guide says that commands print, against what they printed: every line of every `text`
//! block of the document must be a line of some command's output, with numbers that are about the
//! same. A block after `<!-- elsewhere -->` is of another machine, or of a file of the reader, and
//! is not compared.

/// Difference of a number that is about the same, as a share; or [`LAST_DIGITS`].
const ABOUT: f64 = 0.1;
/// The same in units of the last digit that is shown.
const LAST_DIGITS: f64 = 2.0;

/// The lines of the blocks of output of a document, with their line numbers, from 1.
pub fn shown(text: &str) -> Vec<(usize, String)> {
    let (mut found, mut is_block, mut is_elsewhere) = (Vec::new(), None, false);
    for (i, line) in text.lines().enumerate() {
        let trimmed = line.trim();
        match (is_block, trimmed.strip_prefix("```")) {
            (None, Some(info)) => {
                is_block = Some(info == "text" && !is_elsewhere);
                is_elsewhere = false;
            }
            (Some(_), Some(_)) => is_block = None,
            (Some(true), None) if !trimmed.is_empty() => found.push((i + 1, trimmed.to_owned())),
            (None, None) if trimmed == "<!-- elsewhere -->" => is_elsewhere = true,
            _ => {}
        }
    }
    found
}

/// The lines of a document that no command said, with their line numbers.
pub fn unsaid(document: &str, said: &[String]) -> Vec<(usize, String)> {
    let is_said = |line: &str| said.iter().any(|s| s.trim() == line || is_about(s.trim(), line));
    shown(document).into_iter().filter(|(_, line)| !is_said(line)).collect()
}

/// Whether two lines are the same but for small differences of numbers, and for times in ms and s.
fn is_about(a: &str, b: &str) -> bool {
    let ((words_a, numbers_a), (words_b, numbers_b)) = (split(a), split(b));
    let is_time = |i: usize| {
        let after = words_b.get(i + 1).map_or("", String::as_str);
        [" ms", " s"]
            .iter()
            .any(|unit| after.strip_prefix(unit).is_some_and(|rest| !rest.starts_with(char::is_alphabetic)))
    };
    let pairs = numbers_a.iter().zip(&numbers_b).enumerate();
    words_a == words_b && pairs.into_iter().all(|(i, (a, b))| is_time(i) || same_number(a, b))
}

/// The text between the numbers of a line, and the numbers.
fn split(line: &str) -> (Vec<String>, Vec<String>) {
    let (mut words, mut numbers) = (vec![String::new()], Vec::new());
    let letters: Vec<char> = line.chars().collect();
    let mut i = 0;
    while i < letters.len() {
        let is_word = i > 0 && letters[i - 1].is_alphanumeric();
        if letters[i].is_ascii_digit() && !is_word {
            let mut end = i;
            let goes_on = |k: usize| {
                let here = letters[k];
                let next_is_digit = letters.get(k + 1).is_some_and(char::is_ascii_digit);
                here.is_ascii_digit()
                    || (here == '.' && next_is_digit)
                    || (here == 'e' && (letters.get(k + 1) == Some(&'-') || next_is_digit))
                    || (here == '-' && letters[k - 1] == 'e')
            };
            while end < letters.len() && goes_on(end) {
                end += 1;
            }
            numbers.push(letters[i..end].iter().collect());
            words.push(String::new());
            i = end;
        } else {
            if let Some(last) = words.last_mut() {
                last.push(letters[i]);
            }
            i += 1;
        }
    }
    (words, numbers)
}

fn same_number(a: &str, b: &str) -> bool {
    if let (Some((_, a)), Some((_, b))) = (a.split_once('e'), b.split_once('e')) {
        return same_number(a.trim_start_matches('-'), b.trim_start_matches('-'));
    }
    let (Ok(x), Ok(y)) = (a.parse::<f64>(), b.parse::<f64>()) else { return a == b };
    let digits = b.split_once('.').map_or(0, |(_, fraction)| fraction.len() as i32);
    (x - y).abs() <= (ABOUT * y.abs()).max(LAST_DIGITS * 10_f64.powi(-digits)) * 1.000_001
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_may_differ_by_a_little_and_words_not_at_all() {
        let line =
            "poster with confidence 1.00, 68 of 71 matches agree, 1e-129 false alarms expected, 2.20 m away";
        assert!(is_about(&line.replace("2.20", "2.21").replace("129", "131"), line));
        assert!(!is_about(&line.replace("2.20", "2.60"), line));
        assert!(!is_about(&line.replace("1e-129", "1e-60"), line));
        assert!(!is_about(&line.replace("agree", "differ"), line));
        assert!(is_about("r1: 3 quads in 900 ms", "r1: 3 quads in 24 ms"), "times are those of a machine");
        assert!(!is_about("r1: 3 quads", "r2: 3 quads"), "numbers within names are words");
    }

    #[test]
    fn blocks_of_text_are_read_and_those_of_other_machines_are_not() {
        let text =
            "```text\na 1\n\n  b\n```\n```sh\nc\n```\n<!-- elsewhere -->\n```text\nd\n```\n```text\ne\n```\n";
        let lines: Vec<String> = shown(text).into_iter().map(|(_, line)| line).collect();
        assert_eq!(lines, ["a 1", "b", "e"]);
        assert_eq!(unsaid(text, &["a 1".into(), "e".into()]), [(4, "b".to_owned())]);
    }
}
