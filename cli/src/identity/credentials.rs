//! The file with the token of each server, `waymark/credentials.toml` in the user's folder of
//! settings, readable by the user alone.

use super::TokenArg;
use crate::failure::{Class, Failure};
use anyhow::Context as _;
use figment::{
    Figment,
    providers::{Format as _, Toml},
};
use serde::Deserialize;
use std::{
    collections::BTreeMap,
    ffi::OsString,
    fmt::Write as _,
    fs::{self, OpenOptions},
    io::{ErrorKind, Write as _},
    path::{Path, PathBuf},
};

/// What is kept for a server.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    /// Who asks.
    pub(crate) token: TokenArg,
    /// Who signs the server's certificate, PEM; `None`: an authority of the system.
    #[serde(default)]
    pub(crate) authority: Option<String>,
}

type Entries = BTreeMap<String, Entry>;

/// The file of this user.
#[derive(Debug, Clone)]
pub(crate) struct Credentials(PathBuf);

impl Credentials {
    /// In `$XDG_CONFIG_HOME`, or else in `$HOME/.config`. `None` where neither is set.
    pub(crate) fn of_user() -> Option<Self> {
        Self::within(std::env::var_os("XDG_CONFIG_HOME"), std::env::var_os("HOME"))
    }

    fn within(config: Option<OsString>, home: Option<OsString>) -> Option<Self> {
        let absolute = |path: OsString| Some(PathBuf::from(path)).filter(|path| path.is_absolute());
        let folder = config.and_then(absolute).or_else(|| Some(home.and_then(absolute)?.join(".config")))?;
        Some(Self(folder.join("waymark/credentials.toml")))
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        &self.0
    }

    /// What is kept for a server.
    pub(crate) fn entry(&self, server: &str) -> anyhow::Result<Option<Entry>> {
        Ok(self.read()?.remove(key(server)))
    }

    /// Keeps token and authority for a server.
    pub(crate) fn store(&self, server: &str, entry: Entry) -> anyhow::Result<()> {
        let mut entries = self.read()?;
        entries.insert(key(server).to_owned(), entry);
        self.write(&entries)
    }

    /// Forgets token and authority of a server. Whether there was one.
    pub(crate) fn forget(&self, server: &str) -> anyhow::Result<bool> {
        let mut entries = self.read()?;
        let was_there = entries.remove(key(server)).is_some();
        if was_there {
            self.write(&entries)?;
        }
        Ok(was_there)
    }

    fn read(&self) -> anyhow::Result<Entries> {
        let found = match fs::metadata(&self.0) {
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                return Ok(Entries::new());
            }
            found => found.with_context(|| self.0.display().to_string())?,
        };
        if is_shared(&found) {
            let sentence = format!("Others may read the credentials in {}.", self.0.display());
            let advice = format!("chmod 600 {}", self.0.display());
            return Err(Failure::new(Class::Denied, "credentials_shared", sentence).advise(advice).into());
        }
        let read = Figment::from(Toml::file_exact(&self.0)).extract();
        read.with_context(|| format!("{} cannot be read", self.0.display()))
    }

    fn write(&self, entries: &Entries) -> anyhow::Result<()> {
        let mut text = String::from("# Tokens of `waymark login`, by server. Secret.\n");
        // Strings of JSON are strings of TOML.
        for (server, Entry { token, authority }) in entries {
            let (server, token) = (serde_json::to_string(server)?, serde_json::to_string(&token.0)?);
            write!(text, "\n[{server}]\ntoken = {token}\n")?;
            if let Some(authority) = authority {
                writeln!(text, "authority = {}", serde_json::to_string(authority)?)?;
            }
        }
        let cannot = || format!("cannot write {}", self.0.display());
        fs::create_dir_all(self.0.parent().unwrap_or(Path::new(""))).with_context(cannot)?;
        let draft = self.0.with_extension(format!("new-{}", std::process::id()));
        let mut options = OpenOptions::new();
        options.write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let mut file = options.open(&draft).with_context(cannot)?;
        file.write_all(text.as_bytes()).with_context(cannot)?;
        fs::rename(&draft, &self.0).with_context(cannot)
    }
}

/// The address of a server as it stands in the file.
fn key(server: &str) -> &str {
    server.trim_end_matches('/')
}

fn is_shared(found: &fs::Metadata) -> bool {
    #[cfg(unix)]
    return std::os::unix::fs::MetadataExt::mode(found) & 0o077 != 0;
    #[cfg(not(unix))]
    return found.len() == u64::MAX;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_are_kept_by_server_in_a_private_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = Credentials::within(Some(folder.path().into()), None).unwrap();
        let (near, far) = ("http://127.0.0.1:8080", "http://server.example:80/");
        let entry = |n: u32| Entry {
            token: TokenArg(format!("wmk_{n}_secret")),
            authority: (n == 2).then(|| "-----BEGIN\nMII\"\n-----END\n".to_owned()),
        };
        assert_eq!((file.entry(near).unwrap(), file.forget(near).unwrap()), (None, false));
        for (server, n) in [(near, 1), (far, 2), (near, 3)] {
            file.store(server, entry(n)).unwrap();
        }
        assert_eq!(file.entry("http://127.0.0.1:8080/").unwrap(), Some(entry(3)));
        assert!(file.forget(near).unwrap());
        assert_eq!((file.entry(near).unwrap(), file.entry(far).unwrap()), (None, Some(entry(2))));
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            let mode = |mode| fs::set_permissions(file.path(), fs::Permissions::from_mode(mode)).unwrap();
            assert_eq!(fs::metadata(file.path()).unwrap().permissions().mode() & 0o777, 0o600);
            mode(0o644);
            assert!(file.entry(far).unwrap_err().to_string().contains("Others may read"));
        }
        assert_eq!(fs::read_dir(folder.path().join("waymark")).unwrap().count(), 1, "no draft is left");
    }

    #[test]
    fn the_folder_follows_the_variables() {
        let of = |config: Option<&str>, home: Option<&str>| {
            Credentials::within(config.map(Into::into), home.map(Into::into)).map(|file| file.0)
        };
        assert_eq!(of(Some("/c"), Some("/h")), Some("/c/waymark/credentials.toml".into()));
        assert_eq!(of(Some(""), Some("/h")), Some("/h/.config/waymark/credentials.toml".into()));
        assert_eq!(of(None, None), None);
    }
}
