//! Tokens, and who asks.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{CreatedToken, NewToken, PageLink, Token, Whoami};

operations! {
    CREATE: POST "/tokens" => create_token,
    LIST: GET "/tokens" => tokens,
    REVOKE: DELETE "/tokens/{token}" => revoke_token,
    WHOAMI: GET "/whoami" => whoami,
    LINK: POST "/session/links" => page_link,
}

impl MapClient {
    /// Makes a token. Its text is in this answer alone.
    pub async fn create_token(&self, new: &NewToken) -> Result<CreatedToken, ClientError> {
        self.send(self.ask(&CREATE, &[])?.json(new)).await
    }

    /// All tokens by number, with those that were revoked or have expired.
    pub async fn tokens(&self) -> Result<Vec<Token>, ClientError> {
        self.all(&LIST, &[]).await
    }

    /// Revokes a token, with the sessions that it opened.
    pub async fn revoke_token(&self, token: i64) -> Result<(), ClientError> {
        self.done(self.ask(&REVOKE, &[&token])?).await
    }

    /// Who asks, as the server sees it.
    pub async fn whoami(&self) -> Result<Whoami, ClientError> {
        self.send(self.ask(&WHOAMI, &[])?).await
    }

    /// A link that opens the page once, with the rights of this client.
    pub async fn page_link(&self) -> Result<PageLink, ClientError> {
        self.send(self.ask(&LINK, &[])?).await
    }

    /// The text of the token that requests carry, after one request by which a server on this
    /// machine tells where its local token is. `None` where none is needed. It is a secret.
    pub async fn token_in_use(&self) -> Result<Option<String>, ClientError> {
        self.whoami().await?;
        Ok(self.token())
    }
}
