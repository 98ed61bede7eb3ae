//! Claim: an accepted request is completed although its client disconnects at once, and one that
//! was not accepted blocks nothing.

use client::{
    LandmarkRegion,
    api::{JobState, NewMap},
};
use serde_json::Value;
use server::config::Limits;
use tests::{Inside, eventually, pictures};
use tokio::{io::AsyncWriteExt, net::TcpStream};

/// More than the limit of open jobs, so that jobs that nobody runs would block all lessons.
const REQUESTS: u64 = 20;

#[tokio::test(flavor = "multi_thread")]
async fn no_job_stays_open_when_clients_disconnect() {
    let inside = Inside::start(Limits { jobs: 4, ..Limits::default() }).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    maps.add_landmark("hall", "p1", None, None).await.expect("landmark");
    maps.upload_view("hall", "p1", pictures::picture(1), LandmarkRegion::WholeImage).await.expect("view");
    let token = tests::token(&inside.url()).await;
    for i in 0..REQUESTS {
        let mut stream = TcpStream::connect(inside.server.http_addr).await.expect("connection");
        let path = "/api/v1/maps/hall/landmarks/p1/learn";
        let head = format!(
            "POST {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {token}\r\nContent-Length: 0\r\n\r\n"
        );
        stream.write_all(head.as_bytes()).await.expect("sent");
        // Disconnects at once, then ever later: at some delay the job is committed but not yet
        // answered.
        tokio::time::sleep(std::time::Duration::from_micros(250 * i)).await;
        drop(stream);
    }
    let (url, http) = (inside.url(), tests::http(&inside.url()).await);
    let state = async |job: i64| {
        let answer = http.get(format!("{url}/api/v1/jobs/{job}")).send().await.expect("answer");
        let job: Value = answer.json().await.expect("JSON");
        job["state"].as_str().map(str::to_owned)
    };
    let last = eventually("there is room for another lesson", || async {
        maps.learn("hall", None, Some(2)).await.ok()
    })
    .await;
    eventually("the lesson after all of them is done", || async {
        (maps.job(last.id).await.expect("job").state == JobState::Done).then_some(())
    })
    .await;
    let number = last.id;
    for job in 1..number {
        assert_eq!(state(job).await.as_deref(), Some("done"), "job {job} of {number}");
    }
    inside.server.stop().await;
}
