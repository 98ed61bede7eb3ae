//! Any text as what says who asks: header `Authorization`, cookie, token, idempotency key. Each
//! part lies in the text, and what is read keeps its bounds.

#![no_main]

use libfuzzer_sys::fuzz_target;
use protos::credentials::{MAX_KEY_BYTES, MAX_TOKEN_BYTES, TokenOf, bearer, cookie, idempotency_key, token};

fuzz_target!(|data: &[u8]| {
    if let Some(key) = idempotency_key(data) {
        assert!((1..=MAX_KEY_BYTES).contains(&key.len()) && key.bytes().all(|b| b.is_ascii_graphic()));
    }
    let Ok(text) = std::str::from_utf8(data) else { return };
    for text in [Some(text), bearer(text)].into_iter().flatten() {
        let Some((of, secret)) = token(text) else { continue };
        assert!(text.len() <= MAX_TOKEN_BYTES);
        let again = match of {
            TokenOf::Local(port) => format!("wmk_local-{port}_{secret}"),
            TokenOf::Stored(number) => format!("wmk_{number}_{secret}"),
        };
        // Leading zeros are the only other way to write a number.
        assert_eq!(token(&again), Some((of, secret)));
    }
    let (name, header) = text.split_once('\n').unwrap_or(("waymark_session_8080", text));
    if let Some(value) = cookie(header, name) {
        assert!(header.contains(&format!("{name}={value}")) && !value.contains(';'));
    }
});
