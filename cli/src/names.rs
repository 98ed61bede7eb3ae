//! Names of maps, landmarks and robots on the command line: checked, and another suggested for one
//! that breaks the rules.

/// Most characters of a name.
const MAX_NAME: usize = 64;
/// The rules, for people.
const RULES: &str = "lower-case letters, digits, - and _, up to 64";

/// Checks a name, and suggests another.
pub(crate) fn name(text: &str) -> Result<String, String> {
    if protos::Name::new(text).is_ok() {
        return Ok(text.to_owned());
    }
    Err(suggested_name(text).map_or_else(|| RULES.to_owned(), |other| format!("{RULES}; use `{other}`?")))
}

/// A name by the rules, made of one that breaks them; `None` if nothing is left.
fn suggested_name(text: &str) -> Option<String> {
    let mut name = String::new();
    for c in text.to_lowercase().chars() {
        match c {
            'a'..='z' | '0'..='9' | '_' => name.push(c),
            'ä' => name.push_str("ae"),
            'ö' => name.push_str("oe"),
            'ü' => name.push_str("ue"),
            'ß' => name.push_str("ss"),
            _ if !name.is_empty() && !name.ends_with('-') => name.push('-'),
            _ => {}
        }
    }
    name.truncate(MAX_NAME);
    let name = name.trim_end_matches('-');
    (!name.is_empty()).then(|| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_breaks_the_rules_gets_another() {
        assert_eq!(name("window-1"), Ok("window-1".to_owned()));
        assert!(name("Window 1").unwrap_err().ends_with("use `window-1`?"));
        assert!(name("Tür/Süd!").unwrap_err().ends_with("use `tuer-sued`?"));
        assert_eq!(name("!").unwrap_err(), RULES);
        assert!(name(&"a".repeat(65)).is_err() && name("").is_err());
    }
}
