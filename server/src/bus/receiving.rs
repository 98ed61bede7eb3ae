//! Everything that is declared on an open session to hear robots and to answer them.

use super::{BusError, Outbox, Receivers, gaze, hello, inbox, localise::Localiser, versions};
use engine::decode::ImageLimits;
use protos::Keys;
use zenoh::{Session, pubsub::Subscriber, query::Queryable};

/// A session that hears robots.
pub(super) struct Receiving {
    pub(super) session: Session,
    subscribers: Vec<Subscriber<()>>,
    queryables: [Queryable<()>; 3],
    localiser: Localiser,
}

impl Receiving {
    /// Hears robots from now on. Images of localisations are decoded within `pixels`.
    pub(super) async fn start(
        session: Session,
        keys: &Keys,
        (to, outbox): (&Receivers, &Outbox),
        pixels: ImageLimits,
    ) -> Result<Self, BusError> {
        let subscribers = inbox::subscribe(&session, keys, to, outbox).await?;
        let queryables = [
            gaze::answer_gaze(&session, keys, to).await?,
            versions::answer_versions(&session, keys, to).await?,
            hello::answer_hellos(&session, keys, to).await?,
        ];
        let localiser = Localiser::start(&session, keys, to, pixels).await?;
        Ok(Self { session, subscribers, queryables, localiser })
    }

    /// Stops hearing; gives the session.
    pub(super) async fn end(self) -> Session {
        for subscriber in self.subscribers {
            if let Err(error) = subscriber.undeclare().await {
                tracing::warn!(%error, "zenoh_undeclare_failed");
            }
        }
        for queryable in self.queryables {
            if let Err(error) = queryable.undeclare().await {
                tracing::warn!(%error, "zenoh_undeclare_failed");
            }
        }
        self.localiser.close().await;
        self.session
    }
}
