//! Any bytes as messages, keys, tokens and attachments of ROS 2: reading must not panic or grow, a
//! fault lies inside of the payload, and what is read is written to bytes that mean the same.
//!
//! The first byte chooses the type of the message, the rest is its payload.

#![no_main]

use libfuzzer_sys::fuzz_target;
use ros2::{
    bridge_dds::BridgeToken,
    cdr::ByteOrder,
    messages::MessageKind,
    rmw_zenoh::{Attachment, CacheKey, DataKey, Token},
};

fuzz_target!(|data: &[u8]| {
    let Some((choice, payload)) = data.split_first() else {
        return;
    };
    let kind = MessageKind::ALL[usize::from(*choice) % MessageKind::ALL.len()];
    match kind.decode(payload) {
        Ok(message) => {
            for order in [ByteOrder::Little, ByteOrder::Big] {
                let written = message.encode_in(order);
                let again = kind.decode(&written).expect("what was written is read");
                assert_eq!(again.encode_in(order), written);
            }
        }
        Err(error) => assert!(error.offset <= payload.len(), "{error}"),
    }
    if let Ok(attachment) = Attachment::read(payload) {
        assert_eq!(Attachment::read(&attachment.write()), Ok(attachment));
    }
    if let Ok(text) = std::str::from_utf8(payload) {
        texts(text);
    }
});

fn texts(text: &str) {
    if let Ok(key) = DataKey::parse(text) {
        assert_eq!(key.to_string(), text);
    }
    if let Some(cache) = CacheKey::parse(text) {
        assert!(text.starts_with(cache.data_key));
    }
    // A part may hold what only a token of another program has, so not every token can be written.
    if let Ok(token) = Token::parse(text)
        && let Ok(key) = token.to_key()
    {
        assert_eq!(Token::parse(&key), Ok(token));
    }
    if let Ok(token) = BridgeToken::parse(text) {
        assert_eq!(BridgeToken::parse(&token.to_key()), Ok(token));
    }
}
