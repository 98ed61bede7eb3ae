//! Options that stand before a command or between its words. In: the arguments. Out: the same, with
//! those options behind the command, where each has its own: `waymark --server URL map list` is
//! `waymark map list --server URL`.

use std::ffi::OsString;

/// Options of commands that may stand before them, and whether a value follows.
const MOVED: [(&str, bool); 5] =
    [("--server", true), ("--token", true), ("--authority", true), ("--map", true), ("--json", false)];
/// Words of a command: a noun and a verb.
const WORDS: u8 = 2;
/// Options of the program itself that have a value.
const OWN: [&str; 2] = ["--log", "--log-format"];

/// The arguments with the options that stand before the command, or between its two words, behind
/// it. What follows `--` stays where it is.
pub(crate) fn behind_the_command(arguments: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let mut rest = arguments.into_iter();
    let mut kept: Vec<OsString> = rest.next().into_iter().collect();
    let (mut moved, mut words) = (Vec::new(), 0);
    while let Some(argument) = rest.next() {
        let text = argument.to_str().unwrap_or_default();
        let (name, is_whole) = text.split_once('=').map_or((text, false), |(name, _)| (name, true));
        let known = MOVED.iter().find(|(option, _)| *option == name);
        let has_value = known.map_or(OWN.contains(&name), |(_, has_value)| *has_value);
        let to = if known.is_some() { &mut moved } else { &mut kept };
        let is_word = !text.starts_with('-');
        // Behind the first word, an option that is not known here may belong to it.
        let is_others = text == "--" || (words > 0 && !is_word && !has_value && known.is_none());
        words += u8::from(is_word);
        to.push(argument);
        if words == WORDS || is_others {
            break;
        }
        if has_value && !is_whole {
            to.extend(rest.next());
        }
    }
    let ends = kept.pop_if(|last| last == "--");
    let mut behind: Vec<OsString> = ends.into_iter().chain(rest).collect();
    let end = behind.iter().position(|argument| argument == "--").unwrap_or(behind.len());
    behind.splice(end..end, moved);
    kept.extend(behind);
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_before_the_command_go_behind_it() {
        let moved = |line: &str| {
            let all = behind_the_command(line.split(' ').map(OsString::from));
            all.iter().map(|a| a.to_str().unwrap().to_owned()).collect::<Vec<_>>().join(" ")
        };
        for (given, expected) in [
            ("waymark map list", "waymark map list"),
            ("waymark --server http://a map list", "waymark map list --server http://a"),
            (
                "waymark --server=http://a --json map list -n 3",
                "waymark map list -n 3 --server=http://a --json",
            ),
            (
                "waymark --log debug --token x --map m landmark list",
                "waymark --log debug landmark list --token x --map m",
            ),
            ("waymark --json recognise -- --map", "waymark recognise --json -- --map"),
            ("waymark map --server http://a list", "waymark map list --server http://a"),
            ("waymark replay --compare --json a.mcap", "waymark replay --compare --json a.mcap"),
            ("waymark replay --json --compare a.mcap", "waymark replay --compare a.mcap --json"),
            // Not known here: clap says what is wrong.
            ("waymark --frob map list", "waymark --frob map list"),
            ("waymark --server", "waymark --server"),
            ("waymark", "waymark"),
        ] {
            assert_eq!(moved(given), expected);
        }
    }
}
