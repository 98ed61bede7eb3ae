//! Publication: makes committed rows the snapshots that the workers read. In: changes from the
//! store's writer. Out: the next version of a map in [`Snapshots`], and after it the data derived
//! from that version.
//!
//! The order is commit -> [`build`] -> publish -> acknowledge; only what has changed is read again.
//! Visibility areas and look-alike classes take longer: [`derive`] computes them outside the writer
//! and publishes the same version once more. Until then they are absent ([`MapSnapshot::pending`]),
//! never out of date.

mod build;
mod derive;
mod publisher;
mod visibility_areas;

use crate::{
    config::Config,
    events::EventLog,
    identity::{TokenRegistry, certificates::CertificateRegistry},
    store::{OpenError, Store, WriterTask},
};
use engine::{snapshot::Snapshots, vitals::Vitals};
use publisher::Publisher;
use std::{ops::Deref, sync::Arc};
use tokio::{sync::watch, task::JoinHandle};

/// The open store and its published snapshots. Cheap to clone.
#[derive(Debug, Clone)]
pub(crate) struct Catalogue {
    store: Store,
    snapshots: Arc<Snapshots>,
    tokens: Arc<TokenRegistry>,
    events: Arc<EventLog>,
    certificates: Arc<CertificateRegistry>,
}

impl Deref for Catalogue {
    type Target = Store;

    fn deref(&self) -> &Store {
        &self.store
    }
}

/// Awaited so that the store is closed in good order.
#[derive(Debug)]
pub(crate) struct CatalogueTasks {
    writer: WriterTask,
    deriver: JoinHandle<()>,
    stop: watch::Sender<bool>,
}

impl CatalogueTasks {
    /// Ends the writer as a fault would.
    #[cfg(test)]
    fn abort_writer(&self) {
        self.writer.abort();
    }

    /// Finishes the writes that wait, and closes the store.
    pub(crate) async fn close(self) {
        self.writer.close().await;
        self.stop.send_replace(true);
        if let Err(error) = self.deriver.await {
            tracing::error!(%error, "deriver_panicked");
        }
    }
}

impl Catalogue {
    /// Opens the store and publishes every map.
    pub(crate) async fn open(config: &Config) -> Result<(Self, CatalogueTasks), OpenError> {
        let (snapshots, vitals) = (Arc::new(Snapshots::default()), Arc::new(Vitals::default()));
        let tokens = Arc::<TokenRegistry>::default();
        let certificates = Arc::<CertificateRegistry>::default();
        let identities = (tokens.clone(), certificates.clone());
        let publisher = Publisher::new(snapshots.clone(), identities, config.params.clone(), vitals.clone());
        let wake = publisher.derive.clone();
        let (store, writer) = Store::open(config, Arc::new(publisher), vitals.clone()).await?;
        let (stop, stopping) = watch::channel(false);
        let deriver = tokio::spawn(derive::run((snapshots.clone(), store.clone()), vitals, wake, stopping));
        Ok((
            Self { store, snapshots, tokens, certificates, events: Arc::default() },
            CatalogueTasks { writer, deriver, stop },
        ))
    }

    /// What the workers read.
    pub(crate) fn snapshots(&self) -> &Arc<Snapshots> {
        &self.snapshots
    }

    /// The certificates that robots show.
    pub(crate) fn certificates(&self) -> &Arc<CertificateRegistry> {
        &self.certificates
    }

    /// The tokens that requests are checked with.
    pub(crate) fn tokens(&self) -> &Arc<TokenRegistry> {
        &self.tokens
    }

    /// What readers of events are told.
    pub(crate) fn events(&self) -> &Arc<EventLog> {
        &self.events
    }
}

#[cfg(test)]
pub(crate) mod tests;
