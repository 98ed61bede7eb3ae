//! `waymark token`: who may do what on a server.

use crate::validity::{now_ms, seconds, validity};
use crate::{
    names::name,
    screen::Table,
    session::{Consent, ServerArgs, Session},
};
use client::api::{NewToken, Role, Token};
use serde_json::json;

/// `waymark token`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    server: ServerArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// Make a token, and print it: it is shown this once
    ///
    /// Each role may do all that those before it may: viewer, robot, teacher, operator, admin. For
    /// example:
    ///   waymark token create kim --role teacher --for-map office --valid 90d
    #[command(verbatim_doc_comment)]
    Create {
        /// Whom it is for: lower-case letters, digits, `_` and `-`, up to 64.
        #[arg(value_parser = name)]
        name: String,
        /// What it may do.
        #[arg(long, value_parser = role)]
        role: Role,
        /// A map that it is for; may be given several times [default: all maps].
        #[arg(long = "for-map", value_name = "MAP")]
        for_map: Vec<String>,
        /// How long it is valid: a number with s, m, h, d or w [default: until it is revoked].
        #[arg(long, value_name = "TIME", value_parser = seconds)]
        valid: Option<u64>,
    },
    /// List the tokens, with those that were revoked or have expired.
    List,
    /// Revoke a token: the next request with it is refused, and pages that it opened are closed.
    Revoke {
        /// The number of the token.
        number: i64,
        #[command(flatten)]
        consent: Consent,
    },
}

fn role(text: &str) -> Result<Role, String> {
    Role::of(text).ok_or_else(|| format!("one of: {}", Role::ALL.map(Role::as_str).join(", ")))
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let done = on_server(&session, &args.verb).await;
    session.explained(done).await
}

async fn on_server(session: &Session, verb: &Verb) -> anyhow::Result<()> {
    let maps = session.maps();
    match verb {
        Verb::Create { name, role, for_map, valid } => {
            let for_maps = (!for_map.is_empty()).then(|| for_map.clone());
            let new = NewToken { name: name.clone(), role: *role, maps: for_maps, valid_s: *valid };
            let made = maps.create_token(&new).await?;
            session.show(&made, &made.text)?;
            session.note(&format!(
                "  Token {} of {name}, role {role}. It is not shown again. Its owner signs in: waymark login",
                made.token.id
            ));
            Ok(())
        }
        Verb::List => {
            let (all, now_ms) = (maps.tokens().await?, now_ms());
            let table = |all: &[Token]| {
                Table::of(["number", "name", "role", "maps", "valid"], all, |token| {
                    let maps = token.maps.as_ref().map_or("all".to_owned(), |maps| maps.join(","));
                    [
                        token.id.to_string(),
                        token.name.clone(),
                        token.role.to_string(),
                        maps,
                        validity(token.revoked_ms, token.expires_ms, now_ms),
                    ]
                })
            };
            session.list(
                &all,
                table,
                "There is no token yet. Make one: waymark token create NAME --role ROLE",
            )
        }
        Verb::Revoke { number, consent } => {
            let all = maps.tokens().await?;
            let owner = all.iter().find(|token| token.id == *number).map_or("", |token| &token.name);
            if !owner.is_empty() {
                consent.ask(&format!("Revoke token {number} of {owner}? This cannot be undone."))?;
            }
            maps.revoke_token(*number).await?;
            session.show(&json!({ "revoked": number }), &format!("token {number} revoked"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roles_are_checked() {
        assert_eq!(role("teacher"), Ok(Role::Teacher));
        assert!(role("king").unwrap_err().contains("viewer, robot, teacher, operator, admin"));
    }
}
