//! The teacher's side, over HTTP: maps, landmarks, views, lessons with progress, single recognitions.

use crate::{
    ClientError,
    lessons::{Job, JobState, Landmark, Map, Place, Robot, Size, View},
};
use reqwest::{
    Method,
    multipart::{Form, Part},
};
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use vision::{frame::Intrinsics, recognise::DistanceKind};

/// Interval at which a job's state is requested.
const JOB_POLL: Duration = Duration::from_millis(200);
/// Longest wait for one request.
const REQUEST_TIMEOUT: Duration = Duration::from_mins(1);

/// The part of an uploaded image that is the landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LandmarkRegion {
    /// The dominant quad, found by the server.
    Detect,
    /// The whole image, cut out beforehand.
    WholeImage,
    /// A quad with these corners, TL, TR, BR, BL, in pixels.
    Corners([[f64; 2]; 4]),
}

/// A connection to the server's HTTP interface.
#[derive(Debug, Clone)]
pub struct MapClient {
    pub(crate) http: reqwest::Client,
    pub(crate) base: String,
}

impl MapClient {
    /// A client of the server at `base`, such as `http://127.0.0.1:8080`. Nothing is sent yet.
    pub fn new(base: &str) -> Result<Self, ClientError> {
        // Directly to the server: a proxy of the environment is not used between a robot and its map.
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

    /// Creates a map with its location: `site`, `building`, `floor`, `parent`, as in the server's API documentation.
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

    /// Sets the location of a map; absent fields stay, null removes them.
    pub async fn locate_map(&self, name: &str, whereabouts: &Value) -> Result<Map, ClientError> {
        self.send(self.request(Method::PATCH, &format!("/maps/{name}")).json(whereabouts)).await
    }

    /// The visibility settings of a map, as in the server's API documentation.
    pub async fn visibility_settings(&self, map: &str) -> Result<Value, ClientError> {
        self.send(self.request(Method::GET, &format!("/maps/{map}/sight"))).await
    }

    /// Replaces the visibility settings; absent fields take their defaults.
    pub async fn set_visibility_settings(&self, map: &str, sight: &Value) -> Result<Value, ClientError> {
        self.send(self.request(Method::PUT, &format!("/maps/{map}/sight")).json(sight)).await
    }

    /// The transform between two maps, as in the server's API documentation.
    pub async fn transform(&self, from: &str, to: &str) -> Result<Value, ClientError> {
        self.send(self.request(Method::GET, &format!("/maps/{from}/transform?to={to}"))).await
    }

    /// Reads one map.
    pub async fn map(&self, name: &str) -> Result<Map, ClientError> {
        self.send(self.request(Method::GET, &format!("/maps/{name}"))).await
    }

    /// Reads all maps.
    pub async fn maps(&self) -> Result<Vec<Map>, ClientError> {
        self.all("/maps").await
    }

    /// Replaces the walls: segments of two end points each, metres, map frame.
    pub async fn set_walls(&self, map: &str, segments_m: &[[[f64; 2]; 2]]) -> Result<Value, ClientError> {
        let segments: Vec<_> = segments_m.iter().map(|[a, b]| json!({ "a": a, "b": b })).collect();
        let path = format!("/maps/{map}/laser");
        self.send(self.request(Method::PUT, &path).json(&json!({ "segments": segments }))).await
    }

    /// The walls of a map.
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

    /// Reads one landmark.
    pub async fn landmark(&self, map: &str, name: &str) -> Result<Landmark, ClientError> {
        self.send(self.request(Method::GET, &format!("/maps/{map}/landmarks/{name}"))).await
    }

    /// All landmarks of a map.
    pub async fn landmarks(&self, map: &str) -> Result<Vec<Landmark>, ClientError> {
        self.all(&format!("/maps/{map}/landmarks")).await
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

    /// Starts learning of these landmarks, or of all with new views. `generated_views` warped views are generated
    /// from each photograph; `None` leaves the number to the server.
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

    /// The present state of a job.
    pub async fn job(&self, id: &str) -> Result<Job, ClientError> {
        self.send(self.request(Method::GET, &format!("/jobs/{id}"))).await
    }

    /// Waits until a job is done; `progress` is called with every state.
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

    /// Recognises the landmarks in one photograph.
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

    /// Registers a robot, or assigns it to another map.
    pub async fn put_robot(&self, robot: &str, map: &str) -> Result<Robot, ClientError> {
        self.send(self.request(Method::PUT, &format!("/robots/{robot}")).json(&json!({ "map": map }))).await
    }

    /// One robot: whether it is connected, its pose and how old that is, and whether a second program uses its name.
    pub async fn robot(&self, name: &str) -> Result<Robot, ClientError> {
        self.send(self.request(Method::GET, &format!("/robots/{name}"))).await
    }

    /// Reads all robots.
    pub async fn robots(&self) -> Result<Vec<Robot>, ClientError> {
        self.all("/robots").await
    }
}

fn image_part(image: Vec<u8>) -> Part {
    Part::bytes(image).file_name("image")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn nobody_there_says_what_to_do() {
        let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let error = MapClient::new(&format!("http://{free}")).unwrap().maps().await.unwrap_err();
        let text = error.to_string();
        assert!(text.contains("waymark serve") && text.contains(&free.to_string()), "{text}");
    }
}
