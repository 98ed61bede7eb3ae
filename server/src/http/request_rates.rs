//! How often may be asked over HTTP: by each token, and by each address for requests without a
//! valid token. In: a request, before its route is looked for. Out: nothing, or 429 with
//! `Retry-After`. The local token is not bound.

use super::{error::ApiError, peer::Peer};
use crate::{config::Limits, identity::TokenId};
use axum::http::StatusCode;
use engine::quotas::{BURST, Bucket};
use std::{
    collections::BTreeMap,
    net::{IpAddr, Ipv6Addr},
    sync::{Mutex, PoisonError},
    time::Instant,
};

/// Tokens and addresses whose requests are counted; all further addresses share one count.
pub(super) const MAX_ASKERS: usize = 10_000;

/// Who asks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum RateKey {
    /// With a token that is valid, by its number.
    Token(i64),
    /// Without.
    Address(IpAddr),
    /// Addresses beyond [`MAX_ASKERS`].
    Others,
}

/// The buckets.
#[derive(Debug)]
pub(super) struct RequestRates {
    token: f64,
    address: f64,
    askers: Mutex<BTreeMap<RateKey, (Bucket, Instant)>>,
}

impl RequestRates {
    pub(super) fn new(limits: &Limits) -> Self {
        let [token, address] = [limits.token_requests_per_s, limits.address_requests_per_s].map(f64::from);
        Self { token, address, askers: Mutex::default() }
    }

    /// Counts a request, or refuses it.
    pub(super) fn take(&self, asking: RateKey, now: Instant) -> Result<(), ApiError> {
        let mut askers = self.askers.lock().unwrap_or_else(PoisonError::into_inner);
        let mut asking = asking;
        if askers.len() >= MAX_ASKERS && !askers.contains_key(&asking) {
            // A full bucket is as good as none.
            askers.retain(|_, (_, last)| now.saturating_duration_since(*last) < BURST);
            if askers.len() >= MAX_ASKERS {
                asking = RateKey::Others;
            }
        }
        let (rate, setting) = match asking {
            RateKey::Token(_) => (self.token, "limits.token_requests_per_s"),
            RateKey::Address(_) | RateKey::Others => (self.address, "limits.address_requests_per_s"),
        };
        let (bucket, last) = askers.entry(asking).or_insert_with(|| (Bucket::new(rate, now), now));
        *last = now;
        match bucket.wait(1.0, rate, now) {
            Ok(()) => {
                bucket.take(1.0);
                Ok(())
            }
            Err(wait) => {
                let detail = format!(
                    "more than {rate} requests a second ({setting}): wait {} ms before the next one",
                    wait.as_millis() + 1
                );
                Err(ApiError::new(StatusCode::TOO_MANY_REQUESTS, "rate_limited", detail))
            }
        }
    }
}

/// Who asks; `None`: nobody who is bound.
pub(super) fn asking(token: Option<TokenId>, peer: Option<&Peer>) -> Option<RateKey> {
    match token {
        Some(TokenId::Local) => None,
        Some(TokenId::Stored(number)) => Some(RateKey::Token(number)),
        None => peer.map(|peer| RateKey::Address(site(peer.addr.ip()))),
    }
}

/// An address; of IPv6 the network of 64 bits, of which one customer has at least one.
pub(super) fn site(ip: IpAddr) -> IpAddr {
    match ip.to_canonical() {
        IpAddr::V6(v6) => {
            let [a, b, c, d, ..] = v6.segments();
            IpAddr::V6(Ipv6Addr::new(a, b, c, d, 0, 0, 0, 0))
        }
        v4 @ IpAddr::V4(_) => v4,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{net::Ipv4Addr, time::Duration};

    fn address(i: usize) -> RateKey {
        RateKey::Address(IpAddr::V4(Ipv4Addr::from(i as u32)))
    }

    #[test]
    fn requests_at_the_bounds() {
        let limits = Limits { token_requests_per_s: 10, address_requests_per_s: 5, ..Limits::default() };
        let (rates, now) = (RequestRates::new(&limits), Instant::now());
        for (asking, burst) in [(RateKey::Token(1), 20), (address(1), 10), (RateKey::Token(2), 20)] {
            assert!((0..burst).all(|_| rates.take(asking, now).is_ok()), "{asking:?}");
            let refused = rates.take(asking, now).unwrap_err();
            assert_eq!((refused.status, refused.code), (StatusCode::TOO_MANY_REQUESTS, "rate_limited"));
        }
        assert!(rates.take(address(1), now + Duration::from_millis(201)).is_ok());
        assert!(rates.take(address(1), now + Duration::from_millis(202)).is_err());
    }

    #[test]
    fn addresses_beyond_the_bound_share_one_count() {
        let limits = Limits { address_requests_per_s: 5, ..Limits::default() };
        let (rates, now) = (RequestRates::new(&limits), Instant::now());
        for i in 0..MAX_ASKERS {
            rates.take(address(i), now).unwrap();
        }
        let passed = (0..20).filter(|i| rates.take(address(MAX_ASKERS + i), now).is_ok()).count();
        assert_eq!(passed, 10, "new addresses give no new requests");
        assert!(rates.take(address(3), now).is_ok(), "known ones keep their own");
        assert!(rates.askers.lock().unwrap().len() <= MAX_ASKERS + 1);
        rates.take(address(MAX_ASKERS + 99), now + BURST).unwrap();
        assert_eq!(rates.askers.lock().unwrap().len(), 1, "the silent ones are forgotten");
    }

    #[test]
    fn neighbours_in_a_network_of_ipv6_are_one() {
        let of = |text: &str| site(text.parse().unwrap());
        assert_eq!(of("2001:db8:1:2:3::9"), of("2001:db8:1:2:4::1"));
        assert_ne!(of("2001:db8:1:2:3::9"), of("2001:db8:1:3:3::9"));
        assert_eq!(of("::ffff:192.0.2.1"), of("192.0.2.1"));
    }
}
