//! `waymark audit`: who changed what on a server, and whether that is as it was written.

use super::{
    failure::{Class, Failure},
    screen::Table,
    session::{ServerArgs, Session},
};
use client::api::{AuditCheck, AuditEntry, AuditHead, AuditQuery};
use std::{
    path::PathBuf,
    time::{Duration, UNIX_EPOCH},
};

/// `waymark audit`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    server: ServerArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// List changes, newest first: when, who, what.
    List {
        /// Only those of tokens with this name, or of the `server`.
        #[arg(long, value_name = "NAME")]
        actor: Option<String>,
        /// Only those of this map and of what is in it.
        #[arg(long, value_name = "MAP")]
        map: Option<String>,
        /// Most changes that are listed.
        #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u16).range(1..=500))]
        limit: u16,
    },
    /// Compute the digest of every entry anew, and compare
    ///
    /// The last line is the head of the chain. Keep it outside of the server: whoever can write the
    /// database could write another log, but none with that digest. For example:
    ///   waymark audit verify
    ///   waymark audit verify --head 1042:6f1c...
    ///   waymark audit verify --file office.waymark
    #[command(verbatim_doc_comment)]
    Verify {
        /// A head that was noted before; it has to be there still.
        #[arg(long, value_name = "SEQ:DIGEST", value_parser = head)]
        head: Option<AuditHead>,
        /// Read a data directory or a backup, in place of asking the server.
        #[arg(long, value_name = "PATH")]
        file: Option<PathBuf>,
    },
}

fn head(text: &str) -> Result<AuditHead, String> {
    let parts = text.split_once(':').and_then(|(seq, sha256)| Some((seq.parse().ok()?, sha256)));
    let parts =
        parts.filter(|(_, digest)| digest.len() == 64 && digest.bytes().all(|b| b.is_ascii_hexdigit()));
    let (seq, sha256) = parts.ok_or("a number, a colon and 64 hexadecimal digits, as verify prints them")?;
    Ok(AuditHead { seq, sha256: sha256.to_ascii_lowercase() })
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let done = match &args.verb {
        Verb::List { actor, map, limit } => {
            let target = map.as_ref().map(|map| format!("/maps/{map}"));
            list(&session, actor.clone(), target, *limit).await
        }
        Verb::Verify { head, file: None } => match session.maps().check_audit(head.as_ref()).await {
            Ok(check) => show(&session, &check),
            Err(error) => Err(error.into()),
        },
        Verb::Verify { head, file: Some(path) } => {
            let check = server::audit_files::check(path, head.as_ref()).await;
            let check = check.map_err(|e| Failure::new(Class::NotFound, "not_read", format!("{e}.")))?;
            return show(&session, &check);
        }
    };
    session.explained(done).await
}

async fn list(
    session: &Session,
    actor: Option<String>,
    target: Option<String>,
    limit: u16,
) -> anyhow::Result<()> {
    let query = AuditQuery { limit: Some(usize::from(limit)), actor, target, ..AuditQuery::default() };
    let page = session.maps().audit(&query).await?;
    let table = |all: &[AuditEntry]| {
        Table::of(["entry", "when", "who", "what", "to"], all, |entry| {
            let since_1970 = Duration::from_millis(entry.time_ms.max(0) as u64);
            let when = humantime::format_rfc3339_seconds(UNIX_EPOCH + since_1970).to_string();
            let who = match entry.token {
                Some(number) => format!("{} ({number})", entry.actor),
                None => entry.actor.clone(),
            };
            [entry.seq.to_string(), when, who, entry.action.clone(), entry.target.clone()]
        })
    };
    session.list(&page.items, table, "Nothing was changed so.")?;
    let more = page.total.saturating_sub(page.items.len() as u64);
    if page.next.is_some() {
        session.note(&format!("  {more} more: --limit, --actor or --map"));
    }
    Ok(())
}

fn show(session: &Session, check: &AuditCheck) -> anyhow::Result<()> {
    let AuditCheck { entries, forgotten, head, fault } = check;
    if let Some(fault) = fault {
        let sentence = format!("The audit log is not as it was written: {fault}.");
        return Err(Failure::new(Class::Failed, "audit_broken", sentence)
            .advise("Keep the data directory as it is, and compare with a backup: waymark audit verify --file FILE")
            .into());
    }
    let before = if *forgotten > 0 { format!(", {forgotten} older ones forgotten") } else { String::new() };
    let text = format!("{entries} entries{before}, as they were written\nhead {}:{}", head.seq, head.sha256);
    session.show(check, &text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_is_a_number_and_a_digest() {
        let digest = "6F".repeat(32);
        let read = head(&format!("12:{digest}"));
        assert_eq!(read, Ok(AuditHead { seq: 12, sha256: digest.to_lowercase() }));
        for bad in ["", "12", ":", "12:6f", &format!("x:{digest}"), &format!("12:{digest}0")] {
            assert!(head(bad).is_err(), "{bad}");
        }
    }
}
