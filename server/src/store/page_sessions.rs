//! Sessions of the pages, by the digests of their cookies: what is in memory ([`Sessions`]) after a
//! restart.
//!
//! [`Sessions`]: crate::identity::Sessions

use super::{
    StoreError, Tx,
    db::{self, Executor},
    statements::statements,
};
use crate::identity::{MAX_SESSIONS, TokenId};

statements! {
    INSERT = "INSERT INTO page_sessions (sha256, token_id, ends_ms) VALUES ($1, $2, $3) \
              ON CONFLICT (sha256) DO UPDATE SET token_id = excluded.token_id, ends_ms = excluded.ends_ms";
    FORGET = "DELETE FROM page_sessions WHERE ends_ms <= $1 OR sha256 IN \
              (SELECT sha256 FROM (SELECT sha256, row_number() OVER (ORDER BY ends_ms DESC, sha256) AS n \
              FROM page_sessions) AS s WHERE n > $2)";
    DELETE = "DELETE FROM page_sessions WHERE sha256 = $1";
    OPEN = "SELECT sha256, token_id, ends_ms FROM page_sessions WHERE ends_ms > $1 ORDER BY ends_ms, sha256";
}

/// A session as it is stored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct PageSessionRow {
    /// Of its cookie.
    pub(crate) sha256: [u8; 32],
    pub(crate) token: TokenId,
    /// ms since the Unix epoch.
    pub(crate) ends_ms: i64,
}

/// Stores a session. Those that have ended go, and the oldest beyond the bound.
pub(crate) async fn add(tx: &mut Tx, session: PageSessionRow, now_ms: i64) -> Result<(), StoreError> {
    let token = match session.token {
        TokenId::Local => None,
        TokenId::Stored(id) => Some(id),
    };
    let insert = db::query(INSERT).bind(session.sha256.as_slice()).bind(token).bind(session.ends_ms);
    insert.execute(&mut tx.conn).await.map_err(StoreError::during("store a session"))?;
    let forget = db::query(FORGET).bind(now_ms).bind(MAX_SESSIONS as i64);
    forget.execute(&mut tx.conn).await.map_err(StoreError::during("forget ended sessions"))?;
    Ok(())
}

/// Forgets a session. One that is not there is none.
pub(crate) async fn remove(tx: &mut Tx, sha256: [u8; 32]) -> Result<(), StoreError> {
    let delete = db::query(DELETE).bind(sha256.as_slice()).execute(&mut tx.conn).await;
    delete.map_err(StoreError::during("end a session"))?;
    Ok(())
}

/// The sessions that have not ended, the first to end first.
pub(crate) async fn open(db: impl Executor<'_>, now_ms: i64) -> Result<Vec<PageSessionRow>, StoreError> {
    let rows = db::query(OPEN).bind(now_ms).fetch_all(db).await;
    let rows = rows.map_err(StoreError::during("read sessions"))?;
    rows.iter()
        .map(|row| {
            let read = StoreError::during;
            let sha256: Vec<u8> = row.try_get("sha256").map_err(read("read session"))?;
            let token: Option<i64> = row.try_get("token_id").map_err(read("read session"))?;
            let ends_ms = row.try_get("ends_ms").map_err(read("read session"))?;
            let damaged = |_length| StoreError::Damaged {
                what: "a session".to_owned(),
                reason: "its digest has another length".to_owned(),
            };
            let sha256 = sha256.try_into().map_err(damaged)?;
            Ok(PageSessionRow { sha256, token: token.map_or(TokenId::Local, TokenId::Stored), ends_ms })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{config::Config, publication::Catalogue};

    crate::store::tests::cluster::on_each_store! {
        ended_sessions_go_and_the_oldest_make_room,
    }

    fn row(number: u32, ends_ms: i64) -> PageSessionRow {
        let mut sha256 = [0; 32];
        sha256[..4].copy_from_slice(&number.to_be_bytes());
        PageSessionRow { sha256, token: TokenId::Local, ends_ms }
    }

    async fn ended_sessions_go_and_the_oldest_make_room() {
        let data = tempfile::tempdir().unwrap();
        let config = Config { data: data.path().to_owned(), ..Config::default() };
        let (store, _tasks) = Catalogue::open(&config).await.unwrap();
        let add = |session, now| store.write(move |tx| Box::pin(add(tx, session, now)));
        let kept = async |now| open(store.reads(), now).await.unwrap();
        add(row(0, 10), 1).await.unwrap();
        assert_eq!((kept(9).await, kept(10).await), (vec![row(0, 10)], Vec::new()));
        for i in 1..=MAX_SESSIONS as u32 + 1 {
            add(row(i, 100 + i64::from(i)), 10).await.unwrap();
        }
        let all = kept(0).await;
        assert_eq!((all.len(), all.first()), (MAX_SESSIONS, Some(&row(2, 102))));
        store.write(|tx| Box::pin(remove(tx, row(2, 0).sha256))).await.unwrap();
        assert_eq!(kept(0).await.first(), Some(&row(3, 103)));
        let token = TokenId::Stored(9);
        let stranger = add(PageSessionRow { token, ..row(1, 900) }, 10).await;
        assert!(stranger.is_err(), "of a token that is not there");
    }
}
