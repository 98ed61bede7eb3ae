//! A secret from standard input: typed without being shown, or piped.

use crate::screen;
use std::io::{self, BufRead as _, IsTerminal as _, Read as _};

/// Longest line that is read, in bytes.
const MAX_BYTES: u64 = 4096;

/// Asks on a terminal; reads the first line elsewhere.
pub(super) fn secret(question: &str) -> io::Result<String> {
    let stdin = io::stdin();
    let mut line = String::new();
    if !stdin.is_terminal() {
        stdin.lock().take(MAX_BYTES).read_line(&mut line)?;
        return Ok(line.trim().to_owned());
    }
    screen::complain(question);
    let shown = hidden_echo()?;
    let read = stdin.lock().take(MAX_BYTES).read_line(&mut line);
    shown()?;
    read?;
    Ok(line.trim().to_owned())
}

/// Turns off that the terminal shows what is typed; gives what turns it on again.
#[cfg(unix)]
fn hidden_echo() -> io::Result<impl FnOnce() -> io::Result<()>> {
    use rustix::{
        stdio::stdin,
        termios::{LocalModes, OptionalActions, tcgetattr, tcsetattr},
    };
    let before = tcgetattr(stdin())?;
    let mut hidden = before.clone();
    hidden.local_modes &= !LocalModes::ECHO;
    hidden.local_modes |= LocalModes::ECHONL;
    tcsetattr(stdin(), OptionalActions::Flush, &hidden)?;
    Ok(move || Ok(tcsetattr(stdin(), OptionalActions::Now, &before)?))
}

/// This system's terminals are not known: what is typed is shown.
#[cfg(not(unix))]
fn hidden_echo() -> io::Result<impl FnOnce() -> io::Result<()>> {
    Ok(|| Ok(()))
}
