//! Random secrets and the texts of tokens. Neither is ever shown by `Debug`; only digests are
//! stored and compared.

use base64::{Engine as _, prelude::BASE64_URL_SAFE_NO_PAD};
use protos::credentials::{self, LOCAL_PREFIX, TOKEN_PREFIX, TokenOf};
use sha2::{Digest, Sha256};
use std::fmt;
use subtle::ConstantTimeEq;

use super::TokenId;

/// The system gives no random bytes.
#[derive(Debug, thiserror::Error)]
#[error("the system gives no random bytes: {0}")]
pub(crate) struct NoRandomness(getrandom::Error);

/// `N` random bytes, shown to nobody but their owner.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct Secret<const N: usize>([u8; N]);

impl<const N: usize> Secret<N> {
    /// A fresh one, of the system's randomness.
    pub(crate) fn random() -> Result<Self, NoRandomness> {
        let mut bytes = [0; N];
        getrandom::fill(&mut bytes).map_err(NoRandomness)?;
        Ok(Self(bytes))
    }

    pub(crate) fn of(text: &str) -> Option<Self> {
        // Longer texts are no secrets, and are not decoded.
        let bytes = (text.len() <= 2 * N).then(|| BASE64_URL_SAFE_NO_PAD.decode(text).ok()).flatten()?;
        bytes.try_into().ok().map(Self)
    }

    /// As text, base64url: for the owner alone.
    pub(crate) fn expose(&self) -> String {
        BASE64_URL_SAFE_NO_PAD.encode(self.0)
    }

    /// SHA-256.
    pub(crate) fn digest(&self) -> [u8; 32] {
        Sha256::digest(self.0).into()
    }
}

impl<const N: usize> fmt::Debug for Secret<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("…")
    }
}

/// Whether two digests are the same, in a time that does not depend on where they differ.
pub(super) fn same(a: &[u8; 32], b: &[u8; 32]) -> bool {
    a.ct_eq(b).into()
}

/// A token as it is sent: its number and its secret.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct TokenText {
    pub(crate) id: TokenId,
    pub(crate) secret: Secret<32>,
}

impl TokenText {
    /// `wmk_{number}_{secret}`; of a local token `wmk_local-{port}_{secret}`. `None` for everything
    /// else.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let (of, secret) = credentials::token(text)?;
        let id = match of {
            TokenOf::Local(_port) => TokenId::Local,
            TokenOf::Stored(number) => TokenId::Stored(number),
        };
        Some(Self { id, secret: Secret::of(secret)? })
    }

    /// The text of a stored token.
    pub(crate) fn stored(id: i64, secret: &Secret<32>) -> String {
        format!("{TOKEN_PREFIX}{id}_{}", secret.expose())
    }

    /// The text of the local token of a server that listens on this port. A client compares the
    /// port with the one that it asks: a program on another port cannot make it send a token that
    /// is meant for this server.
    pub(crate) fn local(port: u16, secret: &Secret<32>) -> String {
        format!("{TOKEN_PREFIX}{LOCAL_PREFIX}{port}_{}", secret.expose())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_tokens_are_read_back_and_nothing_else_is() {
        let secret = Secret::random().unwrap();
        let stored = TokenText::stored(17, &secret);
        assert_eq!(stored.len(), "wmk_17_".len() + 43);
        let read = TokenText::parse(&stored).unwrap();
        assert_eq!((read.id, &read.secret), (TokenId::Stored(17), &secret));
        assert_eq!(TokenText::parse(&TokenText::local(8080, &secret)).unwrap().id, TokenId::Local);
        let good = secret.expose();
        for bad in [
            String::new(),
            good.clone(),
            format!("wmk_{good}"),
            format!("wmk_-1_{good}"),
            format!("wmk_+1_{good}"),
            format!("wmk_local-x_{good}"),
            format!("wmk_1_{}", &good[1..]),
            format!("wmk_1_{good}A"),
            format!("wmk_1_{}", "!".repeat(43)),
            format!("wmk_1_{}", "A".repeat(4000)),
            format!("WMK_1_{good}"),
        ] {
            assert_eq!(TokenText::parse(&bad), None, "{bad}");
        }
    }

    #[test]
    fn secrets_differ_and_are_not_shown() {
        let [a, b] = [Secret::<32>::random().unwrap(), Secret::random().unwrap()];
        assert!(a != b && !same(&a.digest(), &b.digest()) && same(&a.digest(), &a.clone().digest()));
        let text = TokenText { id: TokenId::Stored(1), secret: a.clone() };
        assert!(!format!("{a:?} {text:?}").contains(&a.expose()));
        assert_eq!(format!("{a:?}"), "…");
    }
}
