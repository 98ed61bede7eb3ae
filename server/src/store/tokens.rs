//! Tokens: whom each is for, what it may do, and the digest of its secret.

use super::{
    CommittedChange, StoreError, Tx,
    db::{self, Executor, Row},
    kind::Kind,
    maps, now_ms,
    statements::statements,
    within,
};
use protos::api::{Role, Token};

/// The columns of [`token_row`]. A map's drafts belong to it; no name has a slash.
macro_rules! select {
    ($tail:literal) => {
        concat!(
            "SELECT id, name, role, everywhere, sha256, created_ms, expires_ms, revoked_ms, \
             (SELECT string_agg(m.name, '/') FROM token_maps t \
             JOIN maps m ON m.id = t.map_id OR m.draft_of = t.map_id WHERE t.token_id = tokens.id) AS names FROM tokens ",
            $tail
        )
    };
}

statements! {
    COUNT = "SELECT count(*) FROM tokens";
    INSERT = "INSERT INTO tokens (name, role, everywhere, sha256, created_ms, expires_ms) \
              VALUES ($1, $2, $3, $4, $5, $6) RETURNING id";
    INSERT_MAP = "INSERT INTO token_maps (token_id, map_id) VALUES ($1, $2) ON CONFLICT DO NOTHING";
    GET = select!("WHERE id = $1");
    PAGE = select!("WHERE id > $1 ORDER BY id LIMIT $2");
    REVOKE = "UPDATE tokens SET revoked_ms = $2 WHERE id = $1 AND revoked_ms IS NULL";
    FORGET_ENDED = "DELETE FROM tokens WHERE id = (SELECT id FROM tokens \
                    WHERE revoked_ms IS NOT NULL OR expires_ms <= $1 ORDER BY id LIMIT 1)";
}

/// Most tokens stored, with those that were revoked or have expired; of these the oldest make room.
pub(crate) const MAX_TOKENS: usize = 1000;

/// A token with the digest of its secret.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct TokenRow {
    pub(crate) token: Token,
    pub(crate) sha256: [u8; 32],
}

/// A token to be stored.
#[derive(Debug, Clone)]
pub(crate) struct TokenInsert {
    pub(crate) name: String,
    pub(crate) role: Role,
    /// Names of maps; `None` for all.
    pub(crate) maps: Option<Vec<String>>,
    pub(crate) sha256: [u8; 32],
    pub(crate) expires_ms: Option<i64>,
}

fn damaged(id: i64, reason: &impl ToString) -> StoreError {
    StoreError::Damaged { what: format!("token {id}"), reason: reason.to_string() }
}

fn token_row(row: &Row) -> Result<TokenRow, StoreError> {
    let read = StoreError::during;
    let id: i64 = row.try_get("id").map_err(read("read token"))?;
    let role: String = row.try_get("role").map_err(read("read token"))?;
    let names: Option<String> = row.try_get("names").map_err(read("read token"))?;
    let everywhere: bool = row.try_get("everywhere").map_err(read("read token"))?;
    let mut names: Vec<String> = names.iter().flat_map(|names| names.split('/')).map(str::to_owned).collect();
    names.sort_unstable();
    let sha256: Vec<u8> = row.try_get("sha256").map_err(read("read token"))?;
    let token = Token {
        id,
        name: row.try_get("name").map_err(read("read token"))?,
        role: Role::of(&role).ok_or_else(|| damaged(id, &format!("role {role}")))?,
        maps: (!everywhere).then_some(names),
        created_ms: row.try_get("created_ms").map_err(read("read token"))?,
        expires_ms: row.try_get("expires_ms").map_err(read("read token"))?,
        revoked_ms: row.try_get("revoked_ms").map_err(read("read token"))?,
    };
    let sha256 = sha256.try_into().map_err(|_length| damaged(id, &"its digest has another length"))?;
    Ok(TokenRow { token, sha256 })
}

/// Stores a token. Errors: a map that does not exist; more than [`MAX_TOKENS`] in use.
pub(crate) async fn create(tx: &mut Tx, new: TokenInsert) -> Result<Token, StoreError> {
    let now = now_ms();
    if count(&mut tx.conn).await? as usize >= MAX_TOKENS {
        let forgotten = db::query(FORGET_ENDED).bind(now).execute(&mut tx.conn).await;
        forgotten.map_err(StoreError::during("forget an ended token"))?;
    }
    let id: i64 = db::query_scalar(INSERT)
        .bind(&new.name)
        .bind(new.role.as_str())
        .bind(new.maps.is_none())
        .bind(new.sha256.as_slice())
        .bind(now)
        .bind(new.expires_ms)
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::during("create token"))?;
    for name in new.maps.iter().flatten() {
        let map = maps::get(&mut tx.conn, name).await?.id;
        let inserted = db::query(INSERT_MAP).bind(id).bind(map).execute(&mut tx.conn).await;
        inserted.map_err(StoreError::during("store the map of a token"))?;
    }
    within(count(&mut tx.conn).await? as i64, MAX_TOKENS, "tokens")?;
    tx.changed(CommittedChange::Tokens);
    get(&mut tx.conn, id).await
}

/// How many there are.
pub(crate) async fn count(db: impl Executor<'_>) -> Result<u64, StoreError> {
    let count: i64 =
        db::query_scalar(COUNT).fetch_one(db).await.map_err(StoreError::during("count tokens"))?;
    Ok(count as u64)
}

/// One token.
pub(crate) async fn get(db: impl Executor<'_>, id: i64) -> Result<Token, StoreError> {
    let row = db::query(GET).bind(id).fetch_optional(db).await.map_err(StoreError::during("read token"))?;
    let row = row.ok_or_else(|| StoreError::NotFound { what: Kind::Token, name: id.to_string() })?;
    Ok(token_row(&row)?.token)
}

/// Tokens with numbers after `after`, in order.
pub(crate) async fn page(
    db: impl Executor<'_>,
    after: i64,
    limit: usize,
) -> Result<Vec<TokenRow>, StoreError> {
    let rows = db::query(PAGE).bind(after).bind(limit as i64).fetch_all(db).await;
    rows.map_err(StoreError::during("list tokens"))?.iter().map(token_row).collect()
}

/// Revokes a token; one that was revoked before keeps its time.
pub(crate) async fn revoke(tx: &mut Tx, id: i64) -> Result<(), StoreError> {
    get(&mut tx.conn, id).await?;
    let revoked = db::query(REVOKE).bind(id).bind(now_ms()).execute(&mut tx.conn).await;
    revoked.map_err(StoreError::during("revoke token"))?;
    tx.changed(CommittedChange::Tokens);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        config::Config,
        publication::{Catalogue, CatalogueTasks},
    };
    use vision::recognise::DistanceKind;

    crate::store::tests::cluster::on_each_store! {
        a_token_is_not_for_a_later_map_of_the_same_name,
        ended_tokens_make_room_and_those_in_use_do_not,
    }

    fn new(name: &str, maps: Option<Vec<String>>, expires_ms: Option<i64>) -> TokenInsert {
        TokenInsert { name: name.to_owned(), role: Role::Viewer, maps, sha256: [7; 32], expires_ms }
    }

    async fn catalogue(data: &std::path::Path) -> (Catalogue, CatalogueTasks) {
        let config = Config { data: data.to_owned(), ..Config::default() };
        Catalogue::open(&config).await.unwrap()
    }

    async fn a_token_is_not_for_a_later_map_of_the_same_name() {
        let data = tempfile::tempdir().unwrap();
        let (store, _tasks) = catalogue(data.path()).await;
        let make = |name| store.write(move |tx| Box::pin(maps::create(tx, name, DistanceKind::Both, 9)));
        make("hall").await.unwrap();
        make("yard").await.unwrap();
        let both = Some(vec!["yard".to_owned(), "hall".to_owned(), "hall".to_owned()]);
        let made = store.write(move |tx| Box::pin(create(tx, new("x", both, None)))).await.unwrap();
        assert_eq!(made.maps, Some(vec!["hall".to_owned(), "yard".to_owned()]));
        store.write(|tx| Box::pin(maps::delete(tx, "hall"))).await.unwrap();
        make("hall").await.unwrap();
        let maps_of = async || get(store.reads(), made.id).await.unwrap().maps;
        assert_eq!(maps_of().await, Some(vec!["yard".to_owned()]));
        store.write(|tx| Box::pin(maps::delete(tx, "yard"))).await.unwrap();
        assert_eq!(maps_of().await, Some(Vec::new()), "none, not all");
        let nowhere = Some(vec!["nowhere".to_owned()]);
        let refused = store.write(move |tx| Box::pin(create(tx, new("x", nowhere, None)))).await;
        assert!(matches!(refused, Err(StoreError::NotFound { what: Kind::Map, .. })), "{refused:?}");
    }

    async fn ended_tokens_make_room_and_those_in_use_do_not() {
        let data = tempfile::tempdir().unwrap();
        let (store, _tasks) = catalogue(data.path()).await;
        let fill = store.write(|tx| {
            Box::pin(async move {
                for i in 0..MAX_TOKENS {
                    create(tx, new("x", None, (i == 3).then_some(1))).await?;
                }
                Ok(())
            })
        });
        fill.await.unwrap();
        let more = || store.write(|tx| Box::pin(create(tx, new("more", None, None))));
        let made = more().await.unwrap();
        assert_eq!(made.id, MAX_TOKENS as i64 + 1);
        assert!(get(store.reads(), 4).await.is_err(), "the expired one is forgotten");
        assert!(matches!(more().await, Err(StoreError::Limit { max: MAX_TOKENS, .. })));
        store.write(|tx| Box::pin(revoke(tx, 9))).await.unwrap();
        assert!(more().await.is_ok() && get(store.reads(), 9).await.is_err());
    }
}
