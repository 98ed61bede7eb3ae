//! Claim: every change over HTTP is in the audit log with who made it, whatever the operation; a
//! kill leaves the log whole; the command finds a log that is not what was noted.

use client::{
    LandmarkRegion,
    api::{AuditHead, AuditQuery, NewMap, NewToken, Role},
};
use std::time::Duration;
use tempfile::TempDir;
use tests::{Child, Inside, SOON, command::waymark, pictures::picture};

#[tokio::test(flavor = "multi_thread")]
async fn changes_have_their_maker_and_survive_a_kill() {
    let data = TempDir::new().expect("a folder");
    let server = Child::start(data.path());
    let maps = server.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    let new = NewToken { name: "kim".into(), role: Role::Teacher, maps: None, valid_s: None };
    let token = maps.create_token(&new).await.expect("token");
    let kim = server.maps().with_token(&token.text);
    kim.add_landmark("hall", "poster", None, None).await.expect("landmark");
    kim.upload_view("hall", "poster", picture(1), LandmarkRegion::WholeImage).await.expect("view");
    assert!(kim.add_landmark("hall", "poster", None, None).await.is_err(), "there is one already");
    let job = kim.learn_landmark("hall", "poster", None).await.expect("a job");
    assert_eq!((job.by.as_str(), job.ended_ms), ("kim", None));
    let id = job.id;
    kim.wait_for_job(job, SOON, |_| ()).await.expect("learnt");
    let learnt = maps.job(id).await.expect("the job");
    let (Some(started), Some(ended)) = (learnt.started_ms, learnt.ended_ms) else { panic!("{learnt:?}") };
    assert!(learnt.by == "kim" && learnt.created_ms <= started && started <= ended, "{learnt:?}");
    let of = async |query: AuditQuery| {
        let page = server.maps().audit(&query).await.expect("the log");
        page.items.into_iter().map(|entry| (entry.actor, entry.action)).collect::<Vec<_>>()
    };
    let entry = |who: &str, what: &str| (who.to_owned(), what.to_owned());
    assert_eq!(
        of(AuditQuery { actor: Some("kim".into()), ..AuditQuery::default() }).await,
        [
            entry("kim", "learn"),
            entry("kim", "POST /maps/{map}/landmarks/{landmark}/learn"),
            entry("kim", "POST /maps/{map}/landmarks/{landmark}/views"),
            entry("kim", "POST /maps/{map}/landmarks"),
        ]
    );
    assert_eq!(
        of(AuditQuery { target: Some("/jobs/".into()), ..AuditQuery::default() }).await[0],
        entry("kim", "learn")
    );
    let noted = maps.check_audit(None).await.expect("a check");
    assert_eq!(noted.fault, None);
    assert!(kim.audit(&AuditQuery::default()).await.is_err(), "administrators only");
    server.kill();

    let server = Child::start(data.path());
    let again = server.maps().check_audit(Some(&noted.head)).await.expect("a check");
    assert_eq!(again.fault, None);
    assert!(again.entries >= noted.entries);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_command_verifies_a_server_a_directory_and_a_noted_head() {
    let inside = Inside::start(server::config::Limits::default()).await;
    inside.maps().create_map(&NewMap::new("hall")).await.expect("map");
    let url = inside.url();
    let run = |args: &[&str]| {
        let args: Vec<_> = args.iter().copied().chain(["--server", url.as_str()]).collect();
        waymark(&args, Duration::from_mins(1))
    };
    let said = run(&["audit", "verify"]);
    let head = said.stdout.lines().last().and_then(|line| line.strip_prefix("head ")).expect("the head");
    assert!(said.status == 0 && said.stdout.starts_with("1 entries, as they were written"), "{said:?}");
    let listed = run(&["audit", "list"]).stdout;
    assert!(listed.contains("\tlocal\tPOST /maps\t/maps"), "{listed}");
    let data = inside.data().to_str().expect("text").to_owned();
    for place in [&[][..], &["--file", &data]] {
        let with = |head: &str| run(&[&["audit", "verify", "--head", head], place].concat());
        assert_eq!(with(head).status, 0, "{place:?}");
        let other = AuditHead { seq: 1, sha256: "0".repeat(64) };
        let broken = with(&format!("{}:{}", other.seq, other.sha256));
        assert_eq!(broken.status, 1, "{broken:?}");
        assert!(broken.stderr.contains("entry 1 has another digest than was noted"), "{broken:?}");
        let cut = with(&format!("9:{}", other.sha256));
        assert!(cut.stderr.contains("entry 9 is missing: the log ends at 1"), "{cut:?}");
    }
    let missing = run(&["audit", "verify", "--file", "/nowhere"]);
    assert_eq!(missing.status, 3, "{missing:?}");
    inside.server.stop().await;
}
