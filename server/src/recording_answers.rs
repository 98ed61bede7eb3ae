//! From the queue of answers that are worth storing to the database. In: records of the workers.
//! Out: rows, a batch at a time, so that robots cost the writer at most one short transaction in
//! [`PERIOD`].

use crate::{publication::Catalogue, store::stored_answers};
use engine::{answer_records::AnswerRecord, vitals::Pulse};
use std::time::Duration;
use tokio::sync::{mpsc::Receiver, watch};

/// Most answers of one transaction.
const BATCH: usize = 32;
/// Least time between two transactions.
const PERIOD: Duration = Duration::from_secs(1);

/// Stores answers until the last worker has stopped; the newest `max` stay.
pub(crate) async fn store_answers(
    store: Catalogue,
    mut records: Receiver<AnswerRecord>,
    max: usize,
    (pulse, mut stopping): (Pulse, watch::Receiver<bool>),
) {
    let mut batch = Vec::with_capacity(BATCH);
    while records.recv_many(&mut batch, BATCH).await > 0 {
        let rows = std::mem::take(&mut batch);
        if store.disk().check().is_err() {
            tracing::debug!(count = rows.len(), "answers_not_stored: the disk is nearly full");
            continue;
        }
        let stored =
            store.write(move |tx| Box::pin(async move { stored_answers::add(tx, &rows, max).await }));
        if let Err(error) = stored.await {
            tracing::error!(%error, "answers_not_stored");
        }
        // Ends at once when the server stops: what is queued is stored without a pause.
        drop(tokio::time::timeout(PERIOD, stopping.wait_for(|stop| *stop)).await);
    }
    drop(pulse);
}
