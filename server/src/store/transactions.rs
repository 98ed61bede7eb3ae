//! How the writer begins and ends a transaction, by engine. SQLite has one writer and one file.
//! With PostgreSQL a transaction takes the turn first, and a commit whose answer is lost is looked
//! up before anything else is written.

use super::{
    StoreError,
    db::{self, Conn, ErrorClass, class},
    postgres::{
        open::{self, OpenError},
        turn::{self, Commit, Turn},
    },
};
use std::time::Duration;

/// Waits between attempts to reach the database again: the first, and the longest.
const WAIT_MIN: Duration = Duration::from_millis(100);
const WAIT_MAX: Duration = Duration::from_secs(2);

/// The transactions of one writer.
#[derive(Debug)]
pub(super) enum Transactions {
    /// Of SQLite.
    Sqlite,
    /// Of PostgreSQL.
    Postgres(Postgres),
}

/// Where a database is, who writes there, and the transaction at work.
pub(super) struct Postgres {
    pub(super) address: String,
    pub(super) holder: [u8; 16],
    pub(super) turn: Option<Turn>,
}

impl std::fmt::Debug for Postgres {
    /// Without the address, which has a password.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Postgres").field("turn", &self.turn).finish_non_exhaustive()
    }
}

/// Bytes that nobody else has.
pub(super) fn random() -> Result<[u8; 16], db::Error> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|error| db::Error::Protocol(error.to_string()))?;
    Ok(bytes)
}

impl Transactions {
    /// Begins one. A connection that was lost is made anew. Errors: [`StoreError::Away`],
    /// [`StoreError::Busy`]; [`StoreError::Closed`] if another server writes.
    pub(super) async fn begin(&mut self, conn: &mut Conn) -> Result<(), StoreError> {
        let at = || StoreError::during("begin");
        let Self::Postgres(Postgres { address, holder, turn }) = self else {
            return db::raw_sql("BEGIN IMMEDIATE").execute(conn).await.map(drop).map_err(at());
        };
        let write_id = random().map_err(at())?;
        let mut begun = turn::begin(conn, holder, write_id).await;
        if begun.as_ref().is_err_and(|error| class(error) == ErrorClass::Away) {
            *conn = open::connect(address).await.map_err(|error| {
                tell_away(&error);
                StoreError::Away
            })?;
            begun = turn::begin(conn, holder, write_id).await;
        }
        *turn = begun.map_err(at())?;
        turn.is_some().then_some(()).ok_or_else(|| {
            tracing::error!(follows = "this one stops", "store_taken_by_another_server");
            StoreError::Closed
        })
    }

    /// Commits it. Errors: it was not done. Where the answer is lost, this returns once it is
    /// known: until then nothing else is written.
    pub(super) async fn commit(&mut self, conn: &mut Conn) -> Result<(), StoreError> {
        let at = || StoreError::during("commit");
        let Self::Postgres(Postgres { address, holder, turn }) = self else {
            return db::raw_sql("COMMIT").execute(conn).await.map(drop).map_err(at());
        };
        let Some(turn) = turn.take() else { return Err(StoreError::Closed) };
        let error = match turn::commit(conn, turn).await {
            Commit::Done => return Ok(()),
            Commit::Refused(error) => return Err(at()(error)),
            Commit::Unknown(error) => error,
        };
        tracing::warn!(%error, follows = "it is looked up before anything else is written", "commit_answer_lost");
        loop {
            reach(conn, address).await;
            match turn::is_committed(conn, holder, turn).await {
                Ok(true) => return Ok(()),
                Ok(false) => return Err(StoreError::Away),
                Err(error) => tracing::warn!(%error, "store_away"),
            }
        }
    }

    /// Takes it back. One that the database has ended by itself is not there any more.
    pub(super) async fn roll_back(&mut self, conn: &mut Conn) -> Result<(), StoreError> {
        let done = db::raw_sql("ROLLBACK").execute(conn).await;
        done.map(drop).map_err(StoreError::during("roll back"))
    }

    /// Makes a connection anew that was lost after a commit, however long it takes. `false`: that
    /// does not help.
    pub(super) async fn reached_again(&self, conn: &mut Conn, lost: &StoreError) -> bool {
        let (Self::Postgres(postgres), StoreError::Away | StoreError::Busy) = (self, lost) else {
            return false;
        };
        reach(conn, &postgres.address).await;
        true
    }
}

async fn reach(conn: &mut Conn, address: &str) {
    let mut wait = WAIT_MIN;
    loop {
        tokio::time::sleep(wait).await;
        wait = (2 * wait).min(WAIT_MAX);
        match open::connect(address).await {
            Ok(made) => return *conn = made,
            Err(error) => tell_away(&error),
        }
    }
}

fn tell_away(error: &OpenError) {
    tracing::warn!(
        error = error as &dyn std::error::Error,
        follows = "robots are served; nothing is stored until then",
        "store_away"
    );
}
