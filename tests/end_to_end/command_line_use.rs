//! Claim: options stand before a command or behind it; a start that fails says which option or file
//! is at fault, with its own exit status, and nothing of the machine that built the program; a
//! variable of no setting is left out and told.

use std::process::{Command, Stdio};
use tempfile::TempDir;
use tests::{
    Child, SOON,
    command::{program, waymark},
};

#[test]
fn options_stand_before_a_command_or_behind_it() {
    let data = TempDir::new().expect("a folder");
    let server = Child::start(data.path());
    let url = server.url.clone();
    assert_eq!(waymark(["--server", &url, "map", "create", "hall"], SOON).status, 0);
    let before = waymark(["--json", "--server", &url, "map", "list"], SOON);
    let between = waymark(["map", "--json", "--server", &url, "list"], SOON);
    let behind = waymark(["map", "list", "--server", &url, "--json"], SOON);
    assert_eq!(behind.status, 0, "{behind:?}");
    assert!(behind.stdout.contains("\"hall\""), "{behind:?}");
    assert_eq!((&before.stdout, &between.stdout), (&behind.stdout, &behind.stdout));
    let of_none = waymark(["--server", &url, "version"], SOON);
    assert_eq!(of_none.status, 2, "{of_none:?}");
    let version = waymark(["version"], SOON);
    assert!(version.stdout.starts_with(concat!("waymark ", env!("CARGO_PKG_VERSION"), " (")), "{version:?}");
}

#[test]
fn an_address_that_is_taken_is_told_with_the_option_that_names_another() {
    let folder = TempDir::new().expect("a folder");
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let taken = taken.local_addr().expect("its address").to_string();
    let data = folder.path().to_str().expect("UTF-8");
    let (http, zenoh, metrics) = ("--http", "--zenoh", "--metrics");
    for option in [http, zenoh, metrics] {
        let address = |of: &str| match (of == option, of) {
            (true, "--zenoh") => format!("tcp/{taken}"),
            (true, _) => taken.clone(),
            (false, "--zenoh") => "tcp/127.0.0.1:0".to_owned(),
            (false, _) => "127.0.0.1:0".to_owned(),
        };
        let addresses = [http, zenoh, metrics].map(|of| (of, address(of)));
        let options = addresses.iter().flat_map(|(of, address)| [*of, address.as_str()]);
        let failed = waymark(["serve", "--data", data].into_iter().chain(options), SOON);
        assert_eq!(failed.status, 4, "{failed:?}");
        assert!(
            failed.stderr.contains(&taken) && failed.stderr.contains(&format!("address with {option}.")),
            "{failed:?}"
        );
        assert!(!failed.stderr.contains("part_failed") && !failed.stderr.contains(".cargo"), "{failed:?}");
    }
    let missing = waymark(["serve", "--data", data, "--config", "/nowhere/waymark.toml"], SOON);
    assert_eq!(missing.status, 3, "{missing:?}");
    assert!(missing.stderr.contains("/nowhere/waymark.toml"), "{missing:?}");
}

#[test]
fn a_variable_of_no_setting_is_left_out_and_told_and_data_lies_by_the_platforms_convention() {
    let home = TempDir::new().expect("a folder");
    let mut command = Command::new(program());
    command.args(["serve", "--http", "127.0.0.1:0", "--zenoh", "tcp/127.0.0.1:0"]);
    command.env("WAYMARK_COLOUR", "1").env("XDG_DATA_HOME", home.path()).env("WAYMARK_LOG", "warn");
    let mut server = Child::start_from(command.stderr(Stdio::piped()));
    let mut log = server.stderr();
    let data = home.path().join("waymark");
    assert!(!cfg!(target_os = "linux") || data.join("local-token").is_file(), "{}", data.display());
    drop(server);
    let mut said = String::new();
    std::io::Read::read_to_string(&mut log, &mut said).expect("a log");
    assert!(said.contains("unknown_variable") && said.contains("WAYMARK_COLOUR"), "{said}");
}
