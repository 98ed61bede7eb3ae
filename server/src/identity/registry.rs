//! The tokens in memory. In: the rows after each commit. Out: the principal of a token.

use super::{
    Principal, TokenId,
    secret::{Secret, TokenText, same},
};
use arc_swap::{ArcSwap, ArcSwapOption};
use protos::api::Token;
use std::{collections::BTreeMap, sync::Arc};
use tokio::sync::watch;

/// A stored token and the digest of its secret.
#[derive(Debug, Clone)]
pub(crate) struct PublishedToken {
    pub(crate) token: Token,
    pub(crate) sha256: [u8; 32],
}

/// Why a token is not valid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Denial {
    /// No token of this server.
    Unknown,
    /// It was revoked.
    Revoked,
    /// Its time is over.
    Expired,
}

/// A token with its principal at hand.
#[derive(Debug)]
struct HeldToken {
    principal: Principal,
    is_revoked: bool,
    sha256: [u8; 32],
}

impl HeldToken {
    fn new(PublishedToken { token, sha256 }: PublishedToken) -> Self {
        let principal = Principal {
            token: TokenId::Stored(token.id),
            name: token.name.into(),
            role: token.role,
            maps: token.maps.map(|maps| Arc::new(maps.into_iter().collect())),
            expires_ms: token.expires_ms,
        };
        Self { principal, is_revoked: token.revoked_ms.is_some(), sha256 }
    }

    fn check(&self, now_ms: i64) -> Result<(), Denial> {
        if self.is_revoked {
            return Err(Denial::Revoked);
        }
        if self.principal.expires_ms.is_some_and(|end| end <= now_ms) {
            return Err(Denial::Expired);
        }
        Ok(())
    }
}

/// All tokens of the server.
#[derive(Debug, Default)]
pub(crate) struct TokenRegistry {
    stored: ArcSwap<BTreeMap<i64, HeldToken>>,
    /// Digest of the local token's secret.
    local: ArcSwapOption<[u8; 32]>,
    changes: watch::Sender<()>,
}

impl TokenRegistry {
    /// Replaces all stored tokens.
    pub(crate) fn publish(&self, tokens: impl IntoIterator<Item = PublishedToken>) {
        self.stored.store(Arc::new(tokens.into_iter().map(|t| (t.token.id, HeldToken::new(t))).collect()));
        self.changes.send_replace(());
    }

    /// Each [`TokenRegistry::publish`] from now on.
    pub(crate) fn changes(&self) -> watch::Receiver<()> {
        self.changes.subscribe()
    }

    /// Makes this the secret of the local token.
    pub(crate) fn set_local(&self, secret: &Secret<32>) {
        self.local.store(Some(Arc::new(secret.digest())));
    }

    /// Whose token this is at this time (ms since the Unix epoch).
    pub(crate) fn principal_of(&self, text: &str, now_ms: i64) -> Result<Principal, Denial> {
        self.principal(self.shown(text)?, now_ms)
    }

    /// The number of a token that is valid at this time.
    pub(crate) fn valid(&self, text: &str, now_ms: i64) -> Result<TokenId, Denial> {
        let id = self.shown(text)?;
        self.check(id, now_ms).map(|()| id)
    }

    /// The token of this text, which may be revoked or expired.
    fn shown(&self, text: &str) -> Result<TokenId, Denial> {
        let TokenText { id, secret } = TokenText::parse(text).ok_or(Denial::Unknown)?;
        let wanted = match id {
            TokenId::Local => self.local.load().as_deref().copied(),
            TokenId::Stored(id) => self.stored.load().get(&id).map(|t| t.sha256),
        };
        // A number that does not exist takes as long as a wrong secret.
        let is_known = wanted.is_some();
        if same(&wanted.unwrap_or_default(), &secret.digest()) & is_known {
            Ok(id)
        } else {
            Err(Denial::Unknown)
        }
    }

    /// Whether a token that was shown before is still valid.
    pub(crate) fn check(&self, id: TokenId, now_ms: i64) -> Result<(), Denial> {
        match id {
            TokenId::Local => Ok(()),
            TokenId::Stored(id) => self.stored.load().get(&id).ok_or(Denial::Unknown)?.check(now_ms),
        }
    }

    /// The principal of a token that was shown before, if it is still valid.
    pub(crate) fn principal(&self, id: TokenId, now_ms: i64) -> Result<Principal, Denial> {
        let id = match id {
            TokenId::Local => return Ok(Principal::local()),
            TokenId::Stored(id) => id,
        };
        let stored = self.stored.load();
        let held = stored.get(&id).ok_or(Denial::Unknown)?;
        held.check(now_ms)?;
        Ok(held.principal.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protos::api::Role;

    #[test]
    fn a_token_is_valid_until_it_expires_or_is_revoked_and_its_secret_counts() {
        let (registry, secret) = (TokenRegistry::default(), Secret::random().unwrap());
        let token = |id, revoked_ms| Token {
            id,
            name: "x".into(),
            role: Role::Teacher,
            maps: Some(vec!["hall".into()]),
            created_ms: 0,
            expires_ms: Some(100),
            revoked_ms,
        };
        let tokens = [token(1, None), token(2, Some(5))];
        registry.publish(tokens.map(|token| PublishedToken { token, sha256: secret.digest() }));
        let ask = |id, now_ms| registry.principal_of(&TokenText::stored(id, &secret), now_ms);
        let principal = ask(1, 99).unwrap();
        assert!(principal.may_see("hall") && !principal.may_see("yard"));
        assert_eq!(ask(1, 100), Err(Denial::Expired));
        assert_eq!(ask(2, 1), Err(Denial::Revoked));
        assert_eq!(ask(3, 1), Err(Denial::Unknown));
        let other = TokenText::stored(1, &Secret::random().unwrap());
        assert_eq!(registry.principal_of(&other, 1), Err(Denial::Unknown));
        // There is no local token before one is set, not even one of zeros.
        let local = TokenText::local(80, &secret);
        assert_eq!(registry.principal_of(&local, 1), Err(Denial::Unknown));
        registry.set_local(&secret);
        assert_eq!(registry.principal_of(&local, 1).unwrap().role, Role::Admin);
    }
}
