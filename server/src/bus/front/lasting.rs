//! What a router keeps for ever of what connects to it: the keys of interests. In: each such key.
//! Out: whether it may pass.
//!
//! A router of zenoh 1.10.2 makes an entry for each chunk of the key of an interest, and drops none
//! of them when the interest or its session ends. Access control does not look at interests in
//! subscribers and queryables. So whoever connects may name a bounded number of different keys as
//! long as the router lives; the same keys pass again.

use protos::Name;
use std::{
    collections::{BTreeMap, HashSet},
    hash::{BuildHasher as _, RandomState},
    net::IpAddr,
    sync::{Arc, Mutex, PoisonError},
};

/// Most bytes that the router keeps for one robot, or for one address that connects without a
/// certificate: about 500 keys of eight chunks.
pub(crate) const MAX_INTEREST_BYTES: usize = 2 << 20;
/// Bytes of a router's entry for one chunk of a key, beside its text.
const CHUNK_BYTES: usize = 512;
/// Most robots and addresses that are told apart. Further ones share one allowance.
const MAX_PEERS: usize = 4096;

/// Who connects.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Peer {
    Robot(Name),
    Address(IpAddr),
    /// One of those beyond [`MAX_PEERS`].
    Further,
}

/// What one router keeps, by who connects.
#[derive(Debug, Default)]
pub(in crate::bus) struct Lasting {
    of: Mutex<BTreeMap<Peer, Arc<InterestKeys>>>,
}

/// The keys in which one robot or address was interested.
#[derive(Debug, Default)]
pub(super) struct InterestKeys {
    kept: Mutex<DeclaredKeys>,
}

#[derive(Debug, Default)]
struct DeclaredKeys {
    hasher: RandomState,
    /// The texts would take as much again. Two keys of one hash count once.
    hashes: HashSet<u64>,
    bytes: usize,
}

impl Lasting {
    pub(super) fn of(&self, peer: Peer) -> Arc<InterestKeys> {
        let mut of = self.of.lock().unwrap_or_else(PoisonError::into_inner);
        let peer = if of.len() < MAX_PEERS || of.contains_key(&peer) { peer } else { Peer::Further };
        of.entry(peer).or_default().clone()
    }
}

impl InterestKeys {
    /// False: this key would be one too many.
    pub(super) fn may_name(&self, key: &str) -> bool {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let hash = kept.hasher.hash_one(key);
        if kept.hashes.contains(&hash) {
            return true;
        }
        let bytes = kept.bytes + key.len() + CHUNK_BYTES * key.split('/').count();
        if bytes > MAX_INTEREST_BYTES {
            return false;
        }
        kept.bytes = bytes;
        kept.hashes.insert(hash)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv6Addr;

    #[test]
    fn the_keys_of_one_are_bounded_and_those_of_others_pass() {
        let router = Lasting::default();
        let robot = |name| router.of(Peer::Robot(Name::new(name).expect("a name")));
        let keys = robot("r1");
        // 7 bytes and two chunks each.
        let most = MAX_INTEREST_BYTES / (7 + 2 * CHUNK_BYTES);
        let key = |i: usize| format!("r1/{i:04}");
        for i in 0..most {
            assert!(keys.may_name(&key(i)), "{i}");
        }
        assert!(!keys.may_name(&key(most)));
        // A connection later: the same keys pass, and no other one.
        assert!(robot("r1").may_name(&key(0)));
        assert!(!robot("r1").may_name(&key(most)));
        assert!(robot("r2").may_name(&key(most)));
    }

    #[test]
    fn further_addresses_share_one_allowance() {
        let router = Lasting::default();
        let address = |i: usize| router.of(Peer::Address(Ipv6Addr::from(i as u128).into()));
        let first = address(0);
        assert!(!Arc::ptr_eq(&first, &address(1)));
        for i in 2..MAX_PEERS {
            address(i);
        }
        let further = address(MAX_PEERS);
        assert!(Arc::ptr_eq(&further, &address(MAX_PEERS + 1)));
        assert!(Arc::ptr_eq(&first, &address(0)));
    }
}
