//! The accept loop of every listener of the server: connections are bounded, and each address has
//! its part of them.

use std::{
    collections::BTreeMap,
    net::{IpAddr, SocketAddr},
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};
use tokio::{
    net::{TcpListener, TcpStream},
    sync::{OwnedSemaphorePermit, Semaphore, watch},
};

/// Pause after a failed accept: usually too many open files.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// How many are held by each key. A key that holds none is forgotten, so there are no more of them
/// than holders.
#[derive(Debug)]
pub(crate) struct Shares<K>(Mutex<BTreeMap<K, usize>>);

impl<K> Default for Shares<K> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

/// One of a key's share; dropping it gives it back.
pub(crate) struct Share<K: Ord> {
    all: Arc<Shares<K>>,
    key: K,
}

impl<K: Ord + Clone> Shares<K> {
    /// One more for a key; `None` if it has as many as it may have.
    pub(crate) fn take(self: &Arc<Self>, key: K, most: usize) -> Option<Share<K>> {
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let count = held.entry(key.clone()).or_default();
        if *count >= most {
            return None;
        }
        *count += 1;
        Some(Share { all: self.clone(), key })
    }
}

impl<K: Ord> Drop for Share<K> {
    fn drop(&mut self) {
        let mut held = self.all.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(count) = held.get_mut(&self.key) {
            *count -= 1;
            if *count == 0 {
                held.remove(&self.key);
            }
        }
    }
}

/// Most connections that are held at once.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    /// Of all addresses. Further ones wait in the system's queue.
    pub(crate) all: usize,
    /// Of one address. Further ones are closed.
    pub(crate) of_address: usize,
}

/// The place of a connection; dropping it makes room for the next.
pub(crate) struct Place {
    _of_all: OwnedSemaphorePermit,
    _of_address: Share<IpAddr>,
}

/// Gives each connection to `serve`, until `stopping` is true.
pub(crate) async fn accept_each(
    listener: &TcpListener,
    bounds: Bounds,
    mut stopping: watch::Receiver<bool>,
    mut serve: impl FnMut(TcpStream, SocketAddr, Place),
) {
    let places = Arc::new(Semaphore::new(bounds.all));
    let addresses = Arc::<Shares<IpAddr>>::default();
    loop {
        let accepted = tokio::select! {
            _ = stopping.wait_for(|stop| *stop) => return,
            accepted = accept(listener, &places) => accepted,
        };
        let Some((stream, peer, of_all)) = accepted else { continue };
        let ip = peer.ip().to_canonical();
        let Some(of_address) = addresses.take(ip, bounds.of_address) else {
            tracing::debug!(%ip, most = bounds.of_address, "connection_closed_too_many_of_address");
            continue;
        };
        serve(stream, peer, Place { _of_all: of_all, _of_address: of_address });
    }
}

async fn accept(
    listener: &TcpListener,
    places: &Arc<Semaphore>,
) -> Option<(TcpStream, SocketAddr, OwnedSemaphorePermit)> {
    // Place first: beyond the bound, connections wait in the system's queue and cost no memory
    // here.
    let place = places.clone().acquire_owned().await.ok()?;
    match listener.accept().await {
        Ok((stream, peer)) => {
            // Answers are small and whole; waiting to fill a packet only delays them.
            drop(stream.set_nodelay(true));
            Some((stream, peer, place))
        }
        Err(error) => {
            tracing::warn!(%error, "accept");
            tokio::time::sleep(ACCEPT_PAUSE).await;
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_of_an_address_at_the_bound() {
        let all = Arc::<Shares<IpAddr>>::default();
        let ip = |last| IpAddr::from([192, 0, 2, last]);
        let held: Vec<_> = (0..3).map(|_| all.take(ip(1), 3)).collect();
        assert!(held.iter().all(Option::is_some));
        assert!(all.take(ip(1), 3).is_none());
        assert!(all.take(ip(2), 3).is_some(), "another address has its own");
        drop(held);
        assert!(all.0.lock().unwrap().is_empty());
        assert!(all.take(ip(1), 3).is_some());
    }
}
