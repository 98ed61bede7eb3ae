//! What a late subscriber of a transient local topic (`/tf_static`) asks for.
//!
//! Source: `eclipse-zenoh/zenoh zenoh-ext/src/advanced_publisher.rs` and `advanced_cache.rs`, tried
//! with 1.10.2 through two routers. A publisher with a cache answers queries at
//! `<data key>/@adv/pub/<zid>/<entity>/_` and declares a liveliness token there; the entity is
//! `uhlc` where it numbers nothing. The replies carry the data key, so the query has to accept
//! replies of any key: without [`ACCEPT_ANY_KEY`] the answer is silently empty.

/// Parameter of the query that lets replies have another key than the query; zenoh's
/// `ReplyKeyExpr::Any` writes it.
pub const ACCEPT_ANY_KEY: &str = "_anyke";

/// Between the data key and who publishes.
const PUBLISHERS: &str = "/@adv/pub/";
/// Longest part of a cache's key after the data key, in parts: session, entity, `_`.
const CACHE_PARTS: usize = 3;

/// Where publishers with a cache declare their tokens: each one that appears is asked for its
/// samples.
pub fn publishers_of(key: &str) -> String {
    format!("{key}/@adv/pub/**")
}

/// The parameter that limits what each publisher sends to its newest samples.
pub fn newest(samples: u32) -> String {
    format!("_max={samples}")
}

/// The cache of one publisher, as its token names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CacheKey<'a> {
    /// The topic's key.
    pub data_key: &'a str,
    /// The publisher's session.
    pub zid: &'a str,
    /// The publisher in its session; `uhlc` where it numbers nothing.
    pub entity: &'a str,
}

impl<'a> CacheKey<'a> {
    /// Reads the key of a token; `None` where it is not that of a publisher.
    pub fn parse(key: &'a str) -> Option<Self> {
        let (data_key, publisher) = key.rsplit_once(PUBLISHERS)?;
        let mut parts = publisher.splitn(CACHE_PARTS, '/');
        let (zid, entity, meta) = (parts.next()?, parts.next()?, parts.next()?);
        let is_whole = ![data_key, zid, entity, meta].contains(&"");
        is_whole.then_some(Self { data_key, zid, entity })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: &str = "0/tf_static/tf2_msgs::msg::dds_::TFMessage_/RIHS01_e369";

    #[test]
    fn queries_are_those_of_advanced_subscribers() {
        assert_eq!(publishers_of(KEY), format!("{KEY}/@adv/pub/**"));
        assert_eq!(newest(1), "_max=1");
    }

    #[test]
    fn the_token_of_a_cache_names_its_topic() {
        let token = format!("{KEY}/@adv/pub/8b20917502ee955ac4476e0266340d5c/12/_");
        let cache = CacheKey::parse(&token).unwrap();
        assert_eq!(cache.data_key, KEY);
        assert_eq!((cache.zid, cache.entity), ("8b20917502ee955ac4476e0266340d5c", "12"));
        let best_effort = format!("{KEY}/@adv/pub/8b20/uhlc/_");
        assert_eq!(CacheKey::parse(&best_effort).unwrap().entity, "uhlc");
        for other in [format!("{KEY}/@adv/sub/8b20/1/_"), format!("{KEY}/@adv/pub/8b20/1"), KEY.to_owned()] {
            assert_eq!(CacheKey::parse(&other), None, "{other}");
        }
        assert_eq!(CacheKey::parse("/@adv/pub/a/1/_"), None);
    }
}
