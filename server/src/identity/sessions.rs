//! Sessions of the page, in memory: opened by a code that is valid once or by a token, ended by
//! logging out, by age, or with the token that opened them. Codes and cookies are found by their
//! digests. The store keeps the sessions for the next start (`store/page_sessions.rs`); a code ends
//! with the server.

use super::{
    TokenId,
    secret::{NoRandomness, Secret},
};
use std::{
    collections::BTreeMap,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};
use tokio::sync::watch;

/// Time for which the code of a link is valid.
pub(crate) const CODE_VALID: Duration = Duration::from_mins(10);
/// Longest session.
pub(crate) const SESSION_VALID: Duration = Duration::from_hours(12);
/// Most codes that wait; the oldest makes room.
const MAX_CODES: usize = 64;
/// Most sessions; the oldest makes room.
pub(crate) const MAX_SESSIONS: usize = 256;

/// Whose it is, and until when.
#[derive(Debug, Clone, Copy)]
struct Grant {
    token: TokenId,
    ends: Instant,
}

type Grants = BTreeMap<[u8; 32], Grant>;

/// The sessions and the codes that wait to become one.
#[derive(Debug, Default)]
pub(crate) struct Sessions {
    codes: Mutex<Grants>,
    open: Mutex<Grants>,
    changes: watch::Sender<()>,
}

/// Adds a grant; what has ended goes, and the oldest beyond the bound.
fn insert(grants: &Mutex<Grants>, digest: [u8; 32], grant: Grant, max: usize, now: Instant) {
    let mut grants = grants.lock().unwrap_or_else(PoisonError::into_inner);
    grants.retain(|_, grant| grant.ends > now);
    while grants.len() >= max {
        let Some(oldest) = grants.iter().min_by_key(|(_, grant)| grant.ends).map(|(digest, _)| *digest)
        else {
            break;
        };
        grants.remove(&oldest);
    }
    grants.insert(digest, grant);
}

impl Sessions {
    /// A code for this token: whoever shows it first gets a session.
    pub(crate) fn code(&self, token: TokenId, now: Instant) -> Result<String, NoRandomness> {
        let code = Secret::<16>::random()?;
        insert(&self.codes, code.digest(), Grant { token, ends: now + CODE_VALID }, MAX_CODES, now);
        Ok(code.expose())
    }

    /// Takes a code: it is not valid again.
    pub(crate) fn redeem(&self, code: &str, now: Instant) -> Option<TokenId> {
        let digest = Secret::<16>::of(code)?.digest();
        let mut codes = self.codes.lock().unwrap_or_else(PoisonError::into_inner);
        codes.remove(&digest).filter(|grant| grant.ends > now).map(|grant| grant.token)
    }

    /// A session for this token: the value of its cookie, and the digest of that.
    pub(crate) fn open(&self, token: TokenId, now: Instant) -> Result<(String, [u8; 32]), NoRandomness> {
        let cookie = Secret::<32>::random()?;
        self.resume(cookie.digest(), token, now + SESSION_VALID, now);
        Ok((cookie.expose(), cookie.digest()))
    }

    /// A session of an earlier start.
    pub(crate) fn resume(&self, digest: [u8; 32], token: TokenId, ends: Instant, now: Instant) {
        insert(&self.open, digest, Grant { token, ends }, MAX_SESSIONS, now);
        self.changes.send_replace(());
    }

    /// The token that a session stands for.
    pub(crate) fn token(&self, cookie: &str, now: Instant) -> Option<TokenId> {
        let digest = Secret::<32>::of(cookie)?.digest();
        let sessions = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        sessions.get(&digest).filter(|grant| grant.ends > now).map(|grant| grant.token)
    }

    /// Ends a session. Returns the digest of its cookie; `None` if there is no such session.
    pub(crate) fn close(&self, cookie: &str) -> Option<[u8; 32]> {
        let digest = Secret::<32>::of(cookie)?.digest();
        let mut sessions = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        sessions.remove(&digest)?;
        drop(sessions);
        self.changes.send_replace(());
        Some(digest)
    }

    /// Each beginning and end of a session by its user from now on.
    pub(crate) fn changes(&self) -> watch::Receiver<()> {
        self.changes.subscribe()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_opens_one_session_within_ten_minutes() {
        let (sessions, now) = (Sessions::default(), Instant::now());
        let code = sessions.code(TokenId::Stored(3), now).unwrap();
        assert_eq!(code.len(), 22);
        assert_eq!(sessions.redeem("", now), None);
        assert_eq!(sessions.redeem(&code, now), Some(TokenId::Stored(3)));
        assert_eq!(sessions.redeem(&code, now), None, "once");
        let late = sessions.code(TokenId::Local, now).unwrap();
        assert_eq!(sessions.redeem(&late, now + CODE_VALID), None);
    }

    #[test]
    fn a_session_ends_by_age_and_by_logging_out() {
        let (sessions, now) = (Sessions::default(), Instant::now());
        let [a, b] = [1, 2].map(|i| sessions.open(TokenId::Stored(i), now).unwrap().0);
        assert_eq!(sessions.token(&a, now + SESSION_VALID / 2), Some(TokenId::Stored(1)));
        assert_eq!(sessions.token(&a, now + SESSION_VALID), None);
        assert!(sessions.close(&a).is_some() && sessions.close(&a).is_none());
        assert_eq!((sessions.token(&a, now), sessions.token(&b, now)), (None, Some(TokenId::Stored(2))));
    }

    #[test]
    fn a_session_goes_on_after_a_restart_until_its_end() {
        let (sessions, now) = (Sessions::default(), Instant::now());
        let (cookie, digest) = sessions.open(TokenId::Stored(1), now).unwrap();
        let later = Sessions::default();
        assert_eq!(later.token(&cookie, now), None);
        later.resume(digest, TokenId::Stored(1), now + Duration::from_secs(9), now);
        assert_eq!(later.token(&cookie, now + Duration::from_secs(8)), Some(TokenId::Stored(1)));
        assert_eq!(later.token(&cookie, now + Duration::from_secs(9)), None);
    }

    #[test]
    fn the_oldest_makes_room_at_the_bound() {
        let (sessions, now) = (Sessions::default(), Instant::now());
        let at = |i: usize| now + Duration::from_millis(i as u64);
        let cookies: Vec<_> =
            (0..=MAX_SESSIONS).map(|i| sessions.open(TokenId::Local, at(i)).unwrap().0).collect();
        let valid = cookies.iter().filter(|cookie| sessions.token(cookie, at(MAX_SESSIONS)).is_some());
        assert_eq!((valid.count(), sessions.token(&cookies[0], now)), (MAX_SESSIONS, None));
        let codes: Vec<_> = (0..=MAX_CODES).map(|i| sessions.code(TokenId::Local, at(i)).unwrap()).collect();
        assert_eq!(sessions.redeem(&codes[0], now), None);
        assert!(codes[1..].iter().all(|code| sessions.redeem(code, now).is_some()));
    }
}
