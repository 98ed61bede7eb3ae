//! The texts that say who asks over HTTP, and which request is a repeat. In: headers, as text. Out:
//! their parts, or nothing. Nothing is compared or stored here: the server does that. Total: any
//! text gives a value or `None`.

/// Begins every token, so that people and scanners of leaked secrets know one.
pub const TOKEN_PREFIX: &str = "wmk_";
/// Begins the number of a local token; the port follows.
pub const LOCAL_PREFIX: &str = "local-";
/// Longest text of a token that is looked at, in bytes.
pub const MAX_TOKEN_BYTES: usize = 128;
/// Longest idempotency key, in bytes.
pub const MAX_KEY_BYTES: usize = 128;

/// Whose token a text claims to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TokenOf {
    /// Of a user of the server's machine, by the port that the server listens on.
    Local(u16),
    /// Of the database, by its number.
    Stored(i64),
}

/// The number of a token and the text of its secret, which is not decoded: `wmk_{number}_{secret}`,
/// of a local token `wmk_local-{port}_{secret}`.
pub fn token(text: &str) -> Option<(TokenOf, &str)> {
    let rest = (text.len() <= MAX_TOKEN_BYTES).then(|| text.strip_prefix(TOKEN_PREFIX)).flatten()?;
    // The alphabet of secrets has the underscore, too.
    let (number, secret) = rest.split_once('_')?;
    let is_number = |digits: &str| digits.bytes().all(|b| b.is_ascii_digit());
    let of = match number.strip_prefix(LOCAL_PREFIX) {
        Some(port) => TokenOf::Local(port.parse().ok().filter(|_| is_number(port))?),
        None => TokenOf::Stored(number.parse().ok().filter(|_| is_number(number))?),
    };
    Some((of, secret))
}

/// The token of a header `Authorization: Bearer TOKEN`.
pub fn bearer(value: &str) -> Option<&str> {
    let (scheme, token) = value.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| token.trim())
}

/// The value of the cookie of this name in a header `Cookie`.
pub fn cookie<'a>(header: &'a str, name: &str) -> Option<&'a str> {
    header.split(';').find_map(|pair| {
        let (key, value) = pair.trim().split_once('=')?;
        (key == name).then_some(value)
    })
}

/// The key of a header `Idempotency-Key`: 1 to [`MAX_KEY_BYTES`] visible ASCII characters.
pub fn idempotency_key(value: &[u8]) -> Option<&str> {
    let fits = (1..=MAX_KEY_BYTES).contains(&value.len()) && value.iter().all(u8::is_ascii_graphic);
    std::str::from_utf8(value).ok().filter(|_| fits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_tokens_are_digits() {
        assert_eq!(token("wmk_17_a_b"), Some((TokenOf::Stored(17), "a_b")));
        assert_eq!(token("wmk_local-8080_s"), Some((TokenOf::Local(8080), "s")));
        for bad in ["", "wmk_", "wmk_17", "wmk_+1_s", "wmk_-1_s", "wmk__s", "wmk_local-+80_s", "wmk_local-_s"]
        {
            assert_eq!(token(bad), None, "{bad}");
        }
        assert!(token("wmk_9223372036854775808_s").is_none(), "more than there are rows");
        let long = format!("wmk_1_{}", "A".repeat(MAX_TOKEN_BYTES - 6));
        assert!(token(&long).is_some() && token(&format!("{long}A")).is_none());
    }

    #[test]
    fn a_key_is_visible_and_bounded() {
        assert_eq!(idempotency_key(b"k-1"), Some("k-1"));
        let longest = vec![b'k'; MAX_KEY_BYTES];
        assert!(idempotency_key(&longest).is_some());
        for bad in [&b""[..], b"a b", b"\xc3\xa4", &[b'k'; MAX_KEY_BYTES + 1]] {
            assert_eq!(idempotency_key(bad), None);
        }
    }
}
