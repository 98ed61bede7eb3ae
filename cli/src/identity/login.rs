//! `waymark login` and `waymark logout`: the token that commands send to a server.

use super::{
    TokenArg,
    credentials::{Credentials, Entry},
    prompt,
};
use crate::{
    failure::{Class, Failure},
    session::ServerArgs,
};
use anyhow::Context as _;
use client::api::Whoami;
use serde_json::json;

/// `waymark login` and `waymark logout`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    server: ServerArgs,
}

fn file() -> anyhow::Result<Credentials> {
    Credentials::of_user().ok_or_else(|| {
        let sentence = "There is no folder for the credentials: neither HOME nor XDG_CONFIG_HOME is set.";
        Failure::new(Class::Failed, "no_home", sentence).advise("Give the token with WAYMARK_TOKEN.").into()
    })
}

/// Checks a token with the server, and keeps it.
pub(crate) async fn login(args: &Args) -> anyhow::Result<()> {
    let (file, url) = (file()?, args.server.url());
    let token = match args.server.given_token() {
        Some(token) => token.clone(),
        None => TokenArg(prompt::secret(&format!("Token for {url}:")).context("standard input")?),
    };
    if token.0.is_empty() {
        return Err(Failure::usage("There is no token on standard input.")
            .advise("An administrator makes one: waymark token create NAME --role ROLE")
            .into());
    }
    let authority = args.server.given_authority()?;
    let session = args.server.session_with(Some(&token), authority.as_deref())?;
    let who = session.explained(session.maps().whoami().await.map_err(Into::into)).await?;
    let kept = if authority.is_some() { "token and the authority are" } else { "token is" };
    file.store(url, Entry { token, authority })?;
    session.show(&who, &sentence(url, &who))?;
    session.note(&format!("  The {kept} in {}.", file.path().display()));
    Ok(())
}

fn sentence(url: &str, who: &Whoami) -> String {
    let maps = match &who.maps {
        None => "all maps".to_owned(),
        Some(maps) if maps.is_empty() => "no map".to_owned(),
        Some(maps) => maps.join(", "),
    };
    format!("signed in at {url}: {}, role {}, {maps}", who.name, who.role)
}

/// Forgets the token of a server.
pub(crate) fn logout(args: &Args) -> anyhow::Result<()> {
    let url = args.server.url();
    let was_there = file()?.forget(url)?;
    let text =
        if was_there { format!("signed out of {url}") } else { format!("there was no token for {url}") };
    args.server.session_with(None, None)?.show(&json!({ "server": url, "signed_out": was_there }), &text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use client::api::Role;

    #[test]
    fn who_is_signed_in_is_said_in_one_line() {
        let who = |maps: Option<Vec<String>>| {
            let name = "kim".to_owned();
            sentence(
                "http://s",
                &Whoami { name, role: Role::Teacher, maps, token: Some(1), expires_ms: None },
            )
        };
        assert_eq!(who(None), "signed in at http://s: kim, role teacher, all maps");
        assert!(who(Some(vec!["a".into(), "b".into()])).ends_with("teacher, a, b"));
        assert!(who(Some(Vec::new())).ends_with("no map"));
    }
}
