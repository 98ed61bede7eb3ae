//! The teacher's side, over HTTP: maps, landmarks, views, lessons with progress, single recognitions.

use crate::{
    ClientError,
    lessons::{
        Accepted, Candidate, Gathering, Job, JobState, Landmark, Map, Page, Pick, Place, Problem, Robot,
        Size, View,
    },
};
use reqwest::{
    Method, RequestBuilder, Response,
    multipart::{Form, Part},
};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use vision::{frame::Intrinsics, recognise::DistanceKind};

/// How often a job is asked for.
const JOB_POLL: Duration = Duration::from_millis(200);
/// Longest wait for one request.
const REQUEST_TIMEOUT: Duration = Duration::from_mins(1);

/// What part of an uploaded image is the landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LandmarkRegion {
    /// The server looks for the one dominant quad.
    Detect,
    /// The whole image is the landmark, cut out beforehand.
    WholeImage,
    /// These corners, TL, TR, BR, BL, in pixels.
    Corners([[f64; 2]; 4]),
}

/// A connection to the server's HTTP interface.
#[derive(Debug, Clone)]
pub struct MapClient {
    http: reqwest::Client,
    base: String,
}

impl MapClient {
    /// A client of the server at `base`, such as `http://127.0.0.1:8080`. Nothing is sent yet.
    pub fn new(base: &str) -> Result<Self, ClientError> {
        // Straight to the server: a proxy of the environment has no business between a robot and its map.
        let http = reqwest::Client::builder().no_proxy().timeout(REQUEST_TIMEOUT).build();
        let http = http.map_err(|e| ClientError::Http { url: base.to_owned(), detail: e.to_string() })?;
        Ok(Self { http, base: base.trim_end_matches('/').to_owned() })
    }

    /// Creates a map.
    pub async fn create_map(&self, name: &str, distance: Option<DistanceKind>) -> Result<Map, ClientError> {
        let mut body = json!({ "name": name });
        if let Some(distance) = distance {
            body["distance"] = json!(distance);
        }
        self.send(self.request(Method::POST, "/maps").json(&body)).await
    }

    /// Creates a map and says where it is: `site`, `building`, `floor`, `parent`, as the server's documentation has them.
    pub async fn create_map_at(
        &self,
        name: &str,
        distance: Option<DistanceKind>,
        whereabouts: &Value,
    ) -> Result<Map, ClientError> {
        let mut body = whereabouts.clone();
        body["name"] = json!(name);
        if let Some(distance) = distance {
            body["distance"] = json!(distance);
        }
        self.send(self.request(Method::POST, "/maps").json(&body)).await
    }

    /// Says where a map is; what is not named stays, null forgets.
    pub async fn locate_map(&self, name: &str, whereabouts: &Value) -> Result<Map, ClientError> {
        self.send(self.request(Method::PATCH, &format!("/maps/{name}")).json(whereabouts)).await
    }

    /// The camera that looks for a map's landmarks, and what counts as seen, as the server's documentation has it.
    pub async fn visibility_settings(&self, map: &str) -> Result<Value, ClientError> {
        self.send(self.request(Method::GET, &format!("/maps/{map}/sight"))).await
    }

    /// Sets it; what is not named becomes that of a usual robot.
    pub async fn set_visibility_settings(&self, map: &str, sight: &Value) -> Result<Value, ClientError> {
        self.send(self.request(Method::PUT, &format!("/maps/{map}/sight")).json(sight)).await
    }

    /// How a map lies in another, as the server's documentation has it.
    pub async fn transform(&self, from: &str, to: &str) -> Result<Value, ClientError> {
        self.send(self.request(Method::GET, &format!("/maps/{from}/transform?to={to}"))).await
    }

    /// One map.
    pub async fn map(&self, name: &str) -> Result<Map, ClientError> {
        self.send(self.request(Method::GET, &format!("/maps/{name}"))).await
    }

    /// All maps.
    pub async fn maps(&self) -> Result<Vec<Map>, ClientError> {
        self.all("/maps").await
    }

    /// Replaces the walls: segments of two end points each, in metres, map frame.
    pub async fn set_walls(&self, map: &str, segments_m: &[[[f64; 2]; 2]]) -> Result<Value, ClientError> {
        let segments: Vec<_> = segments_m.iter().map(|[a, b]| json!({ "a": a, "b": b })).collect();
        let path = format!("/maps/{map}/laser");
        self.send(self.request(Method::PUT, &path).json(&json!({ "segments": segments }))).await
    }

    /// The walls, as stored.
    pub async fn laser(&self, map: &str) -> Result<Value, ClientError> {
        self.send(self.request(Method::GET, &format!("/maps/{map}/laser"))).await
    }

    /// Adds a landmark without views.
    pub async fn add_landmark(
        &self,
        map: &str,
        name: &str,
        size: Option<Size>,
        place: Option<Place>,
    ) -> Result<Landmark, ClientError> {
        let mut body = json!({ "name": name });
        if let Some(size) = size {
            body["size"] = json!(size);
        }
        if let Some(place) = place {
            body["place"] = json!(place);
        }
        self.send(self.request(Method::POST, &format!("/maps/{map}/landmarks")).json(&body)).await
    }

    /// One landmark.
    pub async fn landmark(&self, map: &str, name: &str) -> Result<Landmark, ClientError> {
        self.send(self.request(Method::GET, &format!("/maps/{map}/landmarks/{name}"))).await
    }

    /// All landmarks of a map.
    pub async fn landmarks(&self, map: &str) -> Result<Vec<Landmark>, ClientError> {
        self.all(&format!("/maps/{map}/landmarks")).await
    }

    /// Removes a landmark with its views and model.
    pub async fn delete_landmark(&self, map: &str, name: &str) -> Result<(), ClientError> {
        self.checked(self.request(Method::DELETE, &format!("/maps/{map}/landmarks/{name}"))).await.map(drop)
    }

    /// Teaches one view: a JPEG or PNG photograph.
    pub async fn upload_view(
        &self,
        map: &str,
        landmark: &str,
        image: Vec<u8>,
        extent: LandmarkRegion,
    ) -> Result<View, ClientError> {
        let mut form = Form::new().part("image", image_part(image));
        match extent {
            LandmarkRegion::Detect => {}
            LandmarkRegion::WholeImage => form = form.text("whole_image", "true"),
            LandmarkRegion::Corners(corners) => form = form.text("corners", json!(corners).to_string()),
        }
        let path = format!("/maps/{map}/landmarks/{landmark}/views");
        self.send(self.request(Method::POST, &path).multipart(form)).await
    }

    /// Starts to learn: these landmarks, or all that have new views. `generated_views` warped views are made of each
    /// photograph; `None` leaves the number to the server.
    pub async fn learn(
        &self,
        map: &str,
        landmarks: Option<&[String]>,
        generated_views: Option<u32>,
    ) -> Result<Job, ClientError> {
        let mut body = json!({});
        if let Some(landmarks) = landmarks {
            body["landmarks"] = json!(landmarks);
        }
        if let Some(views) = generated_views {
            body["generated_views"] = json!(views);
        }
        self.send(self.request(Method::POST, &format!("/maps/{map}/learn")).json(&body)).await
    }

    /// Begins to gather views with a robot: of one landmark, or of whatever is new (and of known landmarks, too).
    pub async fn gather(
        &self,
        map: &str,
        robot: &str,
        landmark: Option<&str>,
        known: bool,
    ) -> Result<Gathering, ClientError> {
        let body = json!({ "robot": robot, "landmark": landmark, "known": known });
        self.send(self.request(Method::POST, &format!("/maps/{map}/gatherings")).json(&body)).await
    }

    /// Ends a gathering; what was gathered waits for a decision.
    pub async fn stop_gathering(&self, map: &str, gathering: i64) -> Result<Gathering, ClientError> {
        self.send(self.request(Method::POST, &format!("/maps/{map}/gatherings/{gathering}/stop"))).await
    }

    /// All gatherings of a map.
    pub async fn gatherings(&self, map: &str) -> Result<Vec<Gathering>, ClientError> {
        self.all(&format!("/maps/{map}/gatherings")).await
    }

    /// What waits for a decision.
    pub async fn candidates(&self, map: &str, gathering: i64) -> Result<Vec<Candidate>, ClientError> {
        let path = format!("/maps/{map}/gatherings/{gathering}/candidates");
        let found: Candidates = self.send(self.request(Method::GET, &path)).await?;
        Ok(found.candidates)
    }

    /// The rectified picture of a view of a candidate, PNG.
    pub async fn candidate_picture(
        &self,
        map: &str,
        gathering: i64,
        candidate: u32,
        view: i64,
    ) -> Result<Vec<u8>, ClientError> {
        let path = format!("/maps/{map}/gatherings/{gathering}/candidates/{candidate}/views/{view}/icon");
        let response = self.checked(self.request(Method::GET, &path)).await?;
        let url = response.url().to_string();
        let bytes = response.bytes().await.map_err(|e| ClientError::Http { url, detail: reason(&e) })?;
        Ok(bytes.to_vec())
    }

    /// Makes landmarks of candidates and begins to learn them. All or nothing.
    pub async fn accept_candidates(
        &self,
        map: &str,
        gathering: i64,
        picks: &[Pick],
    ) -> Result<Accepted, ClientError> {
        let path = format!("/maps/{map}/gatherings/{gathering}/accept");
        self.send(self.request(Method::POST, &path).json(&json!({ "candidates": picks }))).await
    }

    /// Throws a candidate away.
    pub async fn discard_candidate(
        &self,
        map: &str,
        gathering: i64,
        candidate: u32,
    ) -> Result<(), ClientError> {
        let path = format!("/maps/{map}/gatherings/{gathering}/candidates/{candidate}");
        self.checked(self.request(Method::DELETE, &path)).await.map(drop)
    }

    /// A job as it stands.
    pub async fn job(&self, id: &str) -> Result<Job, ClientError> {
        self.send(self.request(Method::GET, &format!("/jobs/{id}"))).await
    }

    /// Asks a job to stop.
    pub async fn cancel_job(&self, id: &str) -> Result<(), ClientError> {
        self.checked(self.request(Method::DELETE, &format!("/jobs/{id}"))).await.map(drop)
    }

    /// Waits until a job is done, telling `progress` of every state seen.
    pub async fn wait_for_job(
        &self,
        job: Job,
        wait: Duration,
        mut progress: impl FnMut(&Job),
    ) -> Result<Job, ClientError> {
        let id = job.id_text();
        let (started, mut job) = (Instant::now(), job);
        loop {
            progress(&job);
            let state = match job.state {
                JobState::Done => return Ok(job),
                JobState::Failed => "failed",
                JobState::Cancelled => "cancelled",
                JobState::Queued | JobState::Running if started.elapsed() < wait => {
                    tokio::time::sleep(JOB_POLL).await;
                    job = self.job(&id).await?;
                    continue;
                }
                JobState::Queued | JobState::Running => {
                    return Err(ClientError::JobTimeout { id, waited: started.elapsed() });
                }
            };
            return Err(ClientError::Job { id, state, message: job.message.unwrap_or_default() });
        }
    }

    /// Recognises one photograph.
    pub async fn recognise(
        &self,
        map: &str,
        image: Vec<u8>,
        camera: Option<&Intrinsics>,
    ) -> Result<protos::v1::Answer, ClientError> {
        let mut form = Form::new().part("image", image_part(image));
        if let Some(camera) = camera {
            let wire = protos::convert::geometry::intrinsics_wire(camera);
            form = form.text("intrinsics", json!(wire).to_string());
        }
        self.send(self.request(Method::POST, &format!("/maps/{map}/recognise")).multipart(form)).await
    }

    /// Registers a robot, or gives it another map.
    pub async fn put_robot(&self, robot: &str, map: &str) -> Result<Robot, ClientError> {
        self.send(self.request(Method::PUT, &format!("/robots/{robot}")).json(&json!({ "map": map }))).await
    }

    /// One robot: whether it is connected, its pose and how old that is, and whether a second program uses its name.
    pub async fn robot(&self, name: &str) -> Result<Robot, ClientError> {
        self.send(self.request(Method::GET, &format!("/robots/{name}"))).await
    }

    /// All robots.
    pub async fn robots(&self) -> Result<Vec<Robot>, ClientError> {
        self.all("/robots").await
    }

    pub(crate) fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.http.request(method, format!("{}/api/v1{path}", self.base))
    }

    /// Every page of a list.
    async fn all<T: DeserializeOwned>(&self, path: &str) -> Result<Vec<T>, ClientError> {
        let mut items = Vec::new();
        let mut cursor: Option<String> = None;
        loop {
            // Cursors come from the server and may hold any character.
            let query = cursor.map_or_else(String::new, |c| format!("?cursor={}", escaped(&c)));
            let page: Page<T> = self.send(self.request(Method::GET, &format!("{path}{query}"))).await?;
            items.extend(page.items);
            match page.next {
                Some(next) => cursor = Some(next),
                None => return Ok(items),
            }
        }
    }

    pub(crate) async fn send<T: DeserializeOwned>(&self, request: RequestBuilder) -> Result<T, ClientError> {
        let response = self.checked(request).await?;
        let url = response.url().to_string();
        let bytes =
            response.bytes().await.map_err(|e| ClientError::Http { url: url.clone(), detail: reason(&e) })?;
        serde_json::from_slice(&bytes).map_err(|e| ClientError::Unexpected { url, detail: e.to_string() })
    }

    /// Sends, and turns refusals into errors.
    pub(crate) async fn checked(&self, request: RequestBuilder) -> Result<Response, ClientError> {
        let response = request.send().await.map_err(|e| {
            let url = e.url().map_or_else(|| self.base.clone(), ToString::to_string);
            ClientError::Http { url, detail: reason(&e) }
        })?;
        let status = response.status();
        if status.is_success() {
            return Ok(response);
        }
        let body = response.bytes().await.unwrap_or_default();
        let problem: Problem = serde_json::from_slice(&body).unwrap_or_default();
        Err(ClientError::Refused {
            status: status.as_u16(),
            code: if problem.code.is_empty() { "unknown".to_owned() } else { problem.code },
            field: problem.field.unwrap_or_default(),
            detail: problem.detail.unwrap_or(problem.title),
        })
    }
}

#[derive(serde::Deserialize)]
struct Candidates {
    candidates: Vec<Candidate>,
}

fn image_part(image: Vec<u8>) -> Part {
    Part::bytes(image).file_name("image")
}

/// An error with its causes: the outer one alone says little.
fn reason(error: &reqwest::Error) -> String {
    let mut text = error.to_string();
    let mut cause = std::error::Error::source(error);
    while let Some(inner) = cause {
        text = format!("{text}: {inner}");
        cause = inner.source();
    }
    text
}

fn escaped(text: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-_.~".contains(&b);
    text.bytes().map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cursors_are_escaped() {
        assert_eq!(escaped("a-1/é&="), "a-1%2F%C3%A9%26%3D");
    }

    #[tokio::test]
    async fn nobody_there_says_what_to_do() {
        let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let error = MapClient::new(&format!("http://{free}")).unwrap().maps().await.unwrap_err();
        let text = error.to_string();
        assert!(text.contains("waymark serve") && text.contains(&free.to_string()), "{text}");
    }
}
