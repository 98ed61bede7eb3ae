//! `waymark robot enrol`: a key made here, a certificate signed by the server, and the file with
//! which a robot's program connects.

use crate::{failure::Failure, session::Session};
use anyhow::Context as _;
use client::{
    RobotFile,
    api::{CertificateRequest, EnrolledRobot},
};
use rcgen::{CertificateParams, KeyPair};
use serde_json::json;
use std::{
    fs,
    io::Write as _,
    net::IpAddr,
    path::{Path, PathBuf},
};

/// The file that programs are given.
const ROBOT_FILE: &str = "robot.json";
const KEY_FILE: &str = "key.pem";
const CERTIFICATE_FILE: &str = "certificate.pem";
const AUTHORITY_FILE: &str = "authority.pem";

/// What is asked for.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The robot.
    robot: String,
    /// Folder for the key, the certificate and robot.json; made if missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Name or address by which the robot reaches the server [default: that of --server, or the
    /// first of tls.names].
    #[arg(long, value_name = "HOST")]
    host: Option<String>,
    /// How long the certificate is valid: a number with s, m, h, d or w [default: 365d].
    #[arg(long, value_name = "TIME", value_parser = crate::validity::seconds)]
    valid: Option<u64>,
}

/// Runs the command.
pub(super) async fn run(session: &Session, args: &Args, server: &str) -> anyhow::Result<()> {
    let file = args.out.join(ROBOT_FILE);
    if file.exists() {
        let sentence = format!("{} is there already.", file.display());
        return Err(Failure::usage(sentence).advise("give another folder, or remove this one").into());
    }
    let key = KeyPair::generate().context("no key can be made")?;
    let request = CertificateParams::default().serialize_request(&key).and_then(|request| request.pem());
    let request =
        CertificateRequest { request: request.context("no request can be made")?, valid_s: args.valid };
    let enrolled = session.maps().enrol_robot(&args.robot, &request).await?;
    let written = write(args, &enrolled, &key.serialize_pem(), server);
    written.with_context(|| format!("cannot write to {}", args.out.display()))?;
    let shown = json!({ "file": file, "certificate": enrolled.certificate });
    session.show(&shown, &format!("robot {} enrolled: {}", args.robot, file.display()))?;
    session.note(&format!("  Certificate {}. {KEY_FILE} is secret.", enrolled.certificate.serial));
    Ok(())
}

fn write(args: &Args, enrolled: &EnrolledRobot, key_pem: &str, server: &str) -> anyhow::Result<()> {
    let host = args.host.clone().unwrap_or_else(|| host(server, &enrolled.names));
    let file = RobotFile {
        endpoint: endpoint(&enrolled.zenoh, &host),
        fleet: enrolled.fleet.clone(),
        robot: args.robot.clone(),
        certificate: CERTIFICATE_FILE.into(),
        key: KEY_FILE.into(),
        authority: enrolled.authority_pem.as_ref().map(|_| AUTHORITY_FILE.into()),
        expires_ms: Some(enrolled.certificate.expires_ms),
    };
    fs::create_dir_all(&args.out)?;
    private(&args.out.join(KEY_FILE), key_pem)?;
    fs::write(args.out.join(CERTIFICATE_FILE), &enrolled.certificate_pem)?;
    if let Some(authority) = &enrolled.authority_pem {
        fs::write(args.out.join(AUTHORITY_FILE), authority)?;
    }
    let text = format!("{}\n", serde_json::to_string_pretty(&file)?);
    // Last: it is there only when everything else is.
    Ok(fs::write(args.out.join(ROBOT_FILE), text)?)
}

/// A new file that nobody else can read, not even for a moment.
fn private(path: &Path, text: &str) -> std::io::Result<()> {
    let mut options = fs::OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.open(path)?.write_all(text.as_bytes())
}

/// The host that was asked, unless it is this machine and the server has another name.
fn host(server: &str, names: &[String]) -> String {
    let rest = server.split_once("://").map_or(server, |(_, rest)| rest);
    let authority = rest.split('/').next().unwrap_or_default();
    let asked = authority.rsplit_once(':').filter(|(_, port)| port.bytes().all(|b| b.is_ascii_digit()));
    let asked = asked.map_or(authority, |(host, _)| host).trim_matches(['[', ']']);
    let is_here = asked == "localhost" || asked.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback());
    names.first().filter(|_| is_here).map_or(asked, String::as_str).to_owned()
}

/// The server's endpoint at this host.
fn endpoint(listens: &str, host: &str) -> String {
    let port = listens.rsplit(':').next().unwrap_or_default();
    if host.parse::<std::net::Ipv6Addr>().is_ok() {
        format!("tls/[{host}]:{port}")
    } else {
        format!("tls/{host}:{port}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_gets_the_host_that_was_asked_or_the_servers_name() {
        let names = ["robots.example.org".to_owned()];
        for (server, named, unnamed) in [
            ("http://127.0.0.1:8080", "robots.example.org", "127.0.0.1"),
            ("http://localhost:8080/", "robots.example.org", "localhost"),
            ("https://192.168.1.4:8080", "192.168.1.4", "192.168.1.4"),
            ("https://other.example.org", "other.example.org", "other.example.org"),
            ("https://[fe80::1]:8080", "fe80::1", "fe80::1"),
        ] {
            assert_eq!((host(server, &names), host(server, &[])), (named.into(), unnamed.into()), "{server}");
        }
        assert_eq!(endpoint("tls/0.0.0.0:7447", "h.example.org"), "tls/h.example.org:7447");
        assert_eq!(endpoint("tls/[::]:7447", "fe80::1"), "tls/[fe80::1]:7447");
    }
}
