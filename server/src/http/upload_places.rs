//! Places for requests with large bodies. In: who sends one. Out: a place among all, and one among
//! their own, or 503.
//!
//! One token holds at most half of the places, and so does one address without a valid token:
//! whoever sends slowly, until the deadline of the request, leaves the other half to others.

use super::{error::ApiError, peer::Peer, request_rates::site};
use crate::identity::TokenId;
use axum::http::StatusCode;
use std::{
    collections::BTreeMap,
    net::IpAddr,
    sync::{Arc, Mutex, PoisonError, Weak},
    time::Duration,
};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, SemaphorePermit};

/// Who sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Uploader {
    /// With a valid token, or a session that it opened.
    Token(TokenId),
    /// Without, by address.
    Address(IpAddr),
    /// Without, from no address that is known.
    Unknown,
}

impl Uploader {
    /// Of a request.
    pub(super) fn of(token: Option<TokenId>, peer: Option<&Peer>) -> Self {
        match (token, peer) {
            (Some(token), _) => Self::Token(token),
            (None, Some(peer)) => Self::Address(site(peer.addr.ip())),
            (None, None) => Self::Unknown,
        }
    }
}

#[derive(Debug)]
pub(super) struct UploadPlaces {
    all: Semaphore,
    most: usize,
    wait: Duration,
    /// Those of each that holds one or waits for one: at most as many as there are connections.
    own: Mutex<BTreeMap<Uploader, Weak<Semaphore>>>,
}

/// A place, until it is dropped.
#[derive(Debug)]
pub(super) struct UploadPlace<'a> {
    _own: OwnedSemaphorePermit,
    _of_all: SemaphorePermit<'a>,
}

impl UploadPlaces {
    /// So many places, for which a request waits so long.
    pub(super) fn new(most: usize, wait: Duration) -> Self {
        Self { all: Semaphore::new(most), most, wait, own: Mutex::default() }
    }

    /// Places of one token or address.
    fn share(&self) -> usize {
        (self.most / 2).max(1)
    }

    /// A place, or 503 after the wait.
    pub(super) async fn take(&self, who: Uploader) -> Result<UploadPlace<'_>, ApiError> {
        let until = tokio::time::Instant::now() + self.wait;
        let refused = |detail| ApiError::new(StatusCode::SERVICE_UNAVAILABLE, "too_many_uploads", detail);
        let own = tokio::time::timeout_at(until, self.of(who).acquire_owned()).await;
        let own = own.map_err(|_elapsed| {
            let (share, most) = (self.share(), self.most);
            refused(format!(
                "{share} large requests of one token are in work, of {most} places for all: send fewer at a time"
            ))
        })?;
        let of_all = tokio::time::timeout_at(until, self.all.acquire()).await;
        let of_all = of_all
            .map_err(|_elapsed| refused(format!("all {} places for large requests are in use", self.most)))?;
        let closed = |closed| ApiError::internal(&closed);
        Ok(UploadPlace { _own: own.map_err(closed)?, _of_all: of_all.map_err(closed)? })
    }

    /// The places of one. Those of others that hold none are forgotten.
    fn of(&self, who: Uploader) -> Arc<Semaphore> {
        let mut own = self.own.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(places) = own.get(&who).and_then(Weak::upgrade) {
            return places;
        }
        own.retain(|_, places| places.strong_count() > 0);
        let places = Arc::new(Semaphore::new(self.share()));
        own.insert(who, Arc::downgrade(&places));
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    const WAIT: Duration = Duration::from_secs(1);

    #[tokio::test]
    async fn one_token_holds_half_of_the_places_and_another_has_one_at_once() {
        let places = UploadPlaces::new(4, WAIT);
        let [greedy, other, local] =
            [TokenId::Stored(1), TokenId::Stored(2), TokenId::Local].map(Uploader::Token);
        let held = [places.take(greedy).await.unwrap(), places.take(greedy).await.unwrap()];
        let began = Instant::now();
        let refused = places.take(greedy).await.unwrap_err();
        assert_eq!((refused.status.as_u16(), refused.code), (503, "too_many_uploads"));
        assert!(began.elapsed() >= WAIT, "it waits for its own");
        let began = Instant::now();
        let others = [places.take(other).await.unwrap(), places.take(local).await.unwrap()];
        assert!(began.elapsed() < WAIT, "no wait for those of another");
        assert!(places.take(Uploader::Unknown).await.is_err(), "all are in use");
        drop(held);
        places.take(greedy).await.unwrap();
        drop(others);
        places.take(Uploader::Unknown).await.unwrap();
        assert_eq!(places.own.lock().unwrap().len(), 1, "who holds none is forgotten");
        // A single place cannot be shared.
        assert!(UploadPlaces::new(1, Duration::ZERO).take(other).await.is_ok());
    }
}
