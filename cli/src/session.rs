//! What the commands against a server share: which server, which map, how results are shown.

use super::{
    explain,
    failure::{Class, Failure},
    identity::{TokenArg, credentials::Credentials},
    screen,
};
use client::{ClientError, MapClient, api::Job};
use serde::Serialize;
use std::{
    io::{BufRead as _, IsTerminal as _},
    path::PathBuf,
    sync::OnceLock,
    time::Duration,
};

/// Heading in `--help` of the options that every command has.
const HEADING: &str = "Server";
/// Longest wait for a job.
const JOB_TIMEOUT: Duration = Duration::from_hours(2);
/// Steps of the progress bar of a job.
const JOB_STEPS: usize = 1000;

/// Which server, and how results are shown.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct ServerArgs {
    /// Address of the server's HTTP interface.
    #[arg(
        long,
        global = true,
        env = "WAYMARK_SERVER",
        help_heading = HEADING,
        value_name = "URL",
        default_value = "http://127.0.0.1:8080"
    )]
    server: String,
    /// Token for the server [default: that of `waymark login`; on the server's own machine none is
    /// needed].
    #[arg(
        long,
        global = true,
        env = "WAYMARK_TOKEN",
        hide_env_values = true,
        help_heading = HEADING,
        value_name = "TOKEN"
    )]
    token: Option<TokenArg>,
    /// PEM file of who signs the server's certificate [default: that of `waymark login`, or those
    /// of the system]
    #[arg(long, global = true, env = "WAYMARK_AUTHORITY", help_heading = HEADING, value_name = "FILE")]
    authority: Option<PathBuf>,
    /// Print results and errors as JSON.
    #[arg(long, global = true, help_heading = HEADING)]
    json: bool,
}

/// Which map of which server.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct MapArgs {
    /// The map [default: the only one of the server].
    #[arg(long, global = true, env = "WAYMARK_MAP", help_heading = HEADING, value_name = "MAP")]
    map: Option<String>,
    #[command(flatten)]
    server: ServerArgs,
}

/// Consent to what cannot be undone.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(crate) struct Consent {
    /// Do not ask.
    #[arg(long, short)]
    yes: bool,
}

/// A conversation with one server.
#[derive(Debug)]
pub(crate) struct Session {
    maps: MapClient,
    json: bool,
    named_map: Option<String>,
    /// The map that the command works on, once known.
    map: OnceLock<String>,
}

impl ServerArgs {
    /// A session without a map.
    pub(crate) fn session(&self) -> anyhow::Result<Session> {
        let given = self.given_authority()?;
        if let (Some(token), Some(authority)) = (&self.token, &given) {
            return self.session_with(Some(token), Some(authority));
        }
        let kept = Credentials::of_user().map(|file| file.entry(&self.server)).transpose()?.flatten();
        let (token, authority) = kept.map(|kept| (kept.token, kept.authority)).unzip();
        let authority = given.or(authority.flatten());
        self.session_with(self.token.as_ref().or(token.as_ref()), authority.as_deref())
    }

    /// A session with this token or none, believing this authority alone or those of the system.
    pub(crate) fn session_with(
        &self,
        token: Option<&TokenArg>,
        authority: Option<&str>,
    ) -> anyhow::Result<Session> {
        let maps = match authority {
            Some(pem) => MapClient::with_authority(&self.server, pem.as_bytes())?,
            None => MapClient::new(&self.server)?,
        };
        let maps = match token {
            Some(token) => maps.with_token(&token.0),
            None => maps,
        };
        Ok(Session { maps, json: self.json, named_map: None, map: OnceLock::new() })
    }

    /// Address of the server, without a slash at the end.
    pub(crate) fn url(&self) -> &str {
        self.server.trim_end_matches('/')
    }

    /// The authority of the command line or the environment, PEM.
    pub(crate) fn given_authority(&self) -> anyhow::Result<Option<String>> {
        let read = |path: &PathBuf| {
            std::fs::read_to_string(path).map_err(|error| {
                let sentence = format!("The authority {} cannot be read: {error}.", path.display());
                Failure::new(Class::NotFound, "no_authority", sentence)
                    .advise("The server's administrator has it: tls/authority.pem in the data directory.")
            })
        };
        Ok(self.authority.as_ref().map(read).transpose()?)
    }

    /// The token of the command line or the environment.
    pub(crate) fn given_token(&self) -> Option<&TokenArg> {
        self.token.as_ref()
    }
}

impl MapArgs {
    /// A session that knows its map, or asks the server for the only one.
    pub(crate) fn session(&self) -> anyhow::Result<Session> {
        Ok(Session { named_map: self.map.clone(), ..self.server.session()? })
    }
}

impl Session {
    /// The server.
    pub(crate) fn maps(&self) -> &MapClient {
        &self.maps
    }

    /// Whether results are JSON.
    pub(crate) fn is_json(&self) -> bool {
        self.json
    }

    /// The map: the one named, or the only one there is.
    pub(crate) async fn map(&self) -> anyhow::Result<&str> {
        if let Some(map) = self.map.get() {
            return Ok(map);
        }
        let name = match &self.named_map {
            Some(name) => name.clone(),
            None => self.only_map().await?,
        };
        Ok(self.map.get_or_init(|| name))
    }

    async fn only_map(&self) -> anyhow::Result<String> {
        let mut names: Vec<String> = self.maps.maps().await?.into_iter().map(|m| m.name).collect();
        match names.len() {
            0 => Err(Failure::new(Class::NotFound, "no_map", "There is no map yet.")
                .advise("Make one: waymark map create NAME")
                .into()),
            1 => Ok(names.remove(0)),
            _ => Err(Failure::usage(format!("Which map? There are {}.", names.join(", ")))
                .advise("Name it with --map, or set WAYMARK_MAP.")
                .into()),
        }
    }

    /// Shows a result: as JSON, or as text.
    pub(crate) fn show(&self, value: &(impl Serialize + ?Sized), text: &str) -> anyhow::Result<()> {
        if self.json {
            screen::say(&serde_json::to_string(value)?);
        } else if !text.is_empty() {
            screen::say(text);
        }
        Ok(())
    }

    /// Shows a list: as JSON, as a table, or `if_empty` where there is nothing.
    pub(crate) fn list<T: Serialize>(
        &self,
        values: &[T],
        table: impl FnOnce(&[T]) -> screen::Table,
        if_empty: &str,
    ) -> anyhow::Result<()> {
        if self.json {
            screen::say(&serde_json::to_string(values)?);
        } else if values.is_empty() {
            screen::complain(if_empty);
        } else {
            screen::say(&table(values).text());
        }
        Ok(())
    }

    /// A sentence for people on standard error beside the result; nothing with --json.
    pub(crate) fn note(&self, sentence: &str) {
        if !self.json {
            screen::complain(sentence);
        }
    }

    /// Waits until a job has ended, with a progress bar. Errors: it failed, was cancelled or takes
    /// too long.
    pub(crate) async fn finished(&self, job: Job, what: &'static str) -> Result<Job, ClientError> {
        let bar = screen::progress(JOB_STEPS, what);
        let report = |job: &Job| bar.set_position((job.progress * JOB_STEPS as f64) as u64);
        let done = self.maps.wait_for_job(job, JOB_TIMEOUT, report).await;
        bar.finish_and_clear();
        done
    }

    /// The result with errors explained: which names there are, what to do next.
    pub(crate) async fn explained<T>(&self, result: anyhow::Result<T>) -> anyhow::Result<T> {
        match result {
            Ok(value) => Ok(value),
            Err(error) => {
                let map = self.map.get().map(String::as_str);
                Err(explain::explained(Failure::of(&error), Some(&self.maps), map).await.into())
            }
        }
    }
}

impl Consent {
    #[cfg(test)]
    pub(crate) fn given(yes: bool) -> Self {
        Self { yes }
    }

    /// Asks on a terminal; elsewhere only `--yes` counts.
    pub(crate) fn ask(self, question: &str) -> anyhow::Result<()> {
        if self.yes {
            return Ok(());
        }
        let refused = |sentence: &str| Failure::new(Class::Usage, "not_confirmed", sentence);
        if !std::io::stdin().is_terminal() {
            return Err(refused(question).advise("Add --yes if you are sure.").into());
        }
        screen::complain(&format!("{question} [y/N]"));
        let mut answer = String::new();
        std::io::stdin().lock().read_line(&mut answer)?;
        if is_yes(&answer) { Ok(()) } else { Err(refused("Nothing was changed.").into()) }
    }
}

fn is_yes(answer: &str) -> bool {
    matches!(answer.trim(), "y" | "Y" | "yes" | "Yes")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_clear_yes_is_consent() {
        assert!(["y\n", "Y", " yes\r\n"].into_iter().all(is_yes));
        assert!(!["", "\n", "n", "yeah", "ja"].into_iter().any(is_yes));
        assert!(Consent::given(true).ask("Delete it?").is_ok());
    }
}
