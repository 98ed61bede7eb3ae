//! The token of a server on this machine. A server on loopback says with 401 in which file its
//! local token is; that file is read only if it is a local token, of this user, for the very port
//! that was asked. In: the header. Out: the token.

use reqwest::{Url, header::HeaderValue};
use std::{
    fs::File,
    io::{self, Read as _},
    net::IpAddr,
    path::{Path, PathBuf},
};

/// Name of the file; no other is read.
const FILE: &str = "local-token";
/// Largest file that is read, in bytes.
const MAX_BYTES: u64 = 256;
/// Length of the secret of a token: 32 bytes, base64url.
const SECRET_CHARS: usize = 43;

/// Why the file that a server names is not used.
#[derive(Debug, thiserror::Error)]
pub(super) enum LocalTokenError {
    #[error("{0} is no absolute path of a file `local-token`")]
    Name(PathBuf),
    #[error("{0}: {1}")]
    File(PathBuf, io::Error),
    #[error("{0} is no regular file")]
    NotRegular(PathBuf),
    #[error("{0} belongs to another user")]
    Owner(PathBuf),
    #[error("others may read {0}")]
    Mode(PathBuf),
    #[error("{0} holds no local token of the server on port {1}")]
    Form(PathBuf, u16),
}

/// The port of the server at this address, if it is on this machine.
pub(super) fn local_port(base: &str) -> Option<u16> {
    let url = Url::parse(base).ok()?;
    let host = url.host_str()?;
    let address = host.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
    let is_loopback = host == "localhost" || address.is_ok_and(|ip| ip.to_canonical().is_loopback());
    url.port_or_known_default().filter(|_| is_loopback)
}

/// The file that a 401 names.
pub(super) fn named_file(challenge: &HeaderValue) -> Option<PathBuf> {
    let text = std::str::from_utf8(challenge.as_bytes()).ok()?;
    let (_, rest) = text.strip_prefix("Bearer ")?.split_once("local_token_file=\"")?;
    let mut path = String::new();
    let mut characters = rest.chars();
    loop {
        match characters.next()? {
            '"' => return Some(path.into()),
            '\\' => path.push(characters.next()?),
            other => path.push(other),
        }
    }
}

/// Reads the token of the server on `port`.
pub(super) fn read(path: &Path, port: u16) -> Result<String, LocalTokenError> {
    if !path.is_absolute() || path.file_name().is_none_or(|name| name != FILE) {
        return Err(LocalTokenError::Name(path.to_owned()));
    }
    let failed = |error| LocalTokenError::File(path.to_owned(), error);
    // Not through a link, and nothing that blocks: looked at before it is opened, and again when it
    // is open.
    check(path, &path.symlink_metadata().map_err(failed)?)?;
    let file = File::open(path).map_err(failed)?;
    check(path, &file.metadata().map_err(failed)?)?;
    let mut text = String::new();
    file.take(MAX_BYTES).read_to_string(&mut text).map_err(failed)?;
    let text = text.trim();
    let is_token = text.strip_prefix(&format!("wmk_local-{port}_")).is_some_and(|secret| {
        secret.len() == SECRET_CHARS
            && secret.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_".contains(&b))
    });
    if is_token { Ok(text.to_owned()) } else { Err(LocalTokenError::Form(path.to_owned(), port)) }
}

fn check(path: &Path, found: &std::fs::Metadata) -> Result<(), LocalTokenError> {
    if !found.is_file() {
        return Err(LocalTokenError::NotRegular(path.to_owned()));
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        if found.uid() != rustix::process::geteuid().as_raw() {
            return Err(LocalTokenError::Owner(path.to_owned()));
        }
        if found.mode() & 0o077 != 0 {
            return Err(LocalTokenError::Mode(path.to_owned()));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn only_loopback_has_a_local_port() {
        for (base, port) in [
            ("http://127.0.0.1:8080", Some(8080)),
            ("http://localhost", Some(80)),
            ("https://[::1]", Some(443)),
            ("http://[::ffff:127.0.0.1]:1", Some(1)),
            ("http://localhost.evil.example:8080", None),
            ("http://10.0.0.1:8080", None),
            ("http://127.0.0.1@evil.example/", None),
            ("nonsense", None),
        ] {
            assert_eq!(local_port(base), port, "{base}");
        }
    }

    #[test]
    fn the_quoted_path_is_read_back() {
        let of = |text: &str| named_file(&HeaderValue::from_bytes(text.as_bytes()).unwrap());
        let quoted = r#"Bearer realm="waymark", local_token_file="/a \"b\\c/ä""#;
        assert_eq!(of(quoted), Some("/a \"b\\c/ä".into()));
        for none in
            ["Bearer realm=\"waymark\"", "Bearer local_token_file=\"/a", "Basic local_token_file=\"/a\""]
        {
            assert_eq!(of(none), None, "{none}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_is_no_private_local_token_is_not_read() {
        use std::os::unix::fs::{PermissionsExt as _, symlink};
        let folder = std::env::temp_dir().join(format!("waymark-local-token-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let (path, token) = (folder.join(FILE), format!("wmk_local-80_{}", "a-_B".repeat(11)));
        let token = &token[..token.len() - 1];
        let write = |path: &Path, text: &str, mode| {
            drop(fs::remove_file(path));
            fs::write(path, text).unwrap();
            fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
        };
        write(&path, &format!("{token}\n"), 0o600);
        assert_eq!(read(&path, 80).unwrap(), token);
        // That of a server on another port would be given to whoever named its file.
        assert!(matches!(read(&path, 81), Err(LocalTokenError::Form(..))));
        assert!(matches!(read(Path::new(FILE), 80), Err(LocalTokenError::Name(_))));
        write(&path, token, 0o640);
        assert!(matches!(read(&path, 80), Err(LocalTokenError::Mode(_))));
        for text in ["root:x:0:0", "wmk_1_a", "", &format!("{token}a"), &token.replace("a-", "a/")] {
            write(&path, text, 0o600);
            assert!(matches!(read(&path, 80), Err(LocalTokenError::Form(..))), "{text}");
        }
        let other = folder.join("other");
        write(&other, token, 0o600);
        assert!(matches!(read(&other, 80), Err(LocalTokenError::Name(_))));
        fs::remove_file(&path).unwrap();
        symlink(&other, &path).unwrap();
        assert!(matches!(read(&path, 80), Err(LocalTokenError::NotRegular(_))));
        fs::remove_file(&path).unwrap();
        fs::create_dir(&path).unwrap();
        assert!(matches!(read(&path, 80), Err(LocalTokenError::NotRegular(_))));
        fs::remove_dir_all(&folder).unwrap();
        assert!(matches!(read(&path, 80), Err(LocalTokenError::File(..))));
    }
}
