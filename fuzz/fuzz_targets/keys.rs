//! Any text as a key expression: it is parsed to the key that gives the same text, or refused. The
//! fleet is the text's first line where that is a name. Each key comes back from its form on the
//! wire.

#![no_main]

use libfuzzer_sys::fuzz_target;
use protos::{Keys, Name};

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let (fleet, text) = text.split_once('\n').unwrap_or(("default", text));
    let fleet = Name::new(fleet).unwrap_or_else(|_| Name::new("default").expect("a name"));
    let keys = Keys::new(&fleet);
    keys.received(text, Some(data)).ok();
    for text in [text.to_owned(), format!("waymark/1/{fleet}/{text}")] {
        match keys.parse(&text) {
            Ok(key) => {
                assert_eq!(keys.build(&key), text);
                let (wire, camera) = keys.on_wire(&key);
                assert_eq!(keys.received(&wire, camera.map(str::as_bytes)), Ok(key.clone()));
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
});
