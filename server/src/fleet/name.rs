//! The server's name among those of a router. In: the setting, the data directory. Out: a name that
//! stays the same.
//!
//! It is a file beside the database, and not in it: a backup that is restored on another machine
//! makes no second server of the same name.

use crate::private_file;
use getrandom::fill;
use protos::Name;
use std::{fs, io, path::Path};

/// In the data directory.
const FILE: &str = "server-name";
/// Longest file that is read, in bytes.
const MAX_BYTES: u64 = 256;

/// The name of the settings, or that of the data directory, where it is made if there is none.
pub(crate) fn server_name(asked: Option<&Name>, data: &Path) -> Result<Name, String> {
    if let Some(name) = asked {
        return Ok(name.clone());
    }
    let path = data.join(FILE);
    let at = |detail: String| format!("{}: {detail}; give a name by the setting server_name", path.display());
    match read(&path) {
        Ok(text) => Name::new(text.trim()).map_err(|e| at(e.to_string())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let mut random = [0; 4];
            fill(&mut random).map_err(|e| at(e.to_string()))?;
            let name = format!("server-{:08x}", u32::from_be_bytes(random));
            write(&path, &name).map_err(|e| at(e.to_string()))?;
            Name::new(name).map_err(|e| at(e.to_string()))
        }
        Err(error) => Err(at(error.to_string())),
    }
}

fn read(path: &Path) -> io::Result<String> {
    if fs::metadata(path)?.len() > MAX_BYTES {
        return Err(io::Error::new(io::ErrorKind::InvalidData, format!("more than {MAX_BYTES} bytes")));
    }
    fs::read_to_string(path)
}

/// It appears whole or not at all.
fn write(path: &Path, name: &str) -> io::Result<()> {
    private_file::write(path, &format!("{name}\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_made_once_and_stays() {
        let data = tempfile::tempdir().unwrap();
        let first = server_name(None, data.path()).unwrap();
        let digits = first.as_str().strip_prefix("server-").unwrap();
        assert!(digits.len() == 8 && digits.bytes().all(|b| b.is_ascii_hexdigit()), "{first}");
        assert_eq!(server_name(None, data.path()).unwrap(), first);
        let asked = Name::new("hall").unwrap();
        assert_eq!(server_name(Some(&asked), data.path()).unwrap(), asked);
        fs::write(data.path().join(FILE), "No Name").unwrap();
        assert!(server_name(None, data.path()).unwrap_err().contains("server_name"));
        fs::write(data.path().join(FILE), "x".repeat(MAX_BYTES as usize + 1)).unwrap();
        assert!(server_name(None, data.path()).unwrap_err().contains("more than"));
    }
}
