//! Lessons and jobs.

use super::{
    events::{Events, endless},
    map_client::MapClient,
    operation::operations,
};
use crate::ClientError;
use protos::api::{Job, JobQuery, JobState, LandmarkLesson, MapLesson, Page};
use std::time::{Duration, Instant};

operations! {
    LEARN: POST "/maps/{map}/learn" => learn,
    LEARN_LANDMARK: POST "/maps/{map}/landmarks/{landmark}/learn" => learn_landmark,
    LIST: GET "/jobs" => jobs,
    GET: GET "/jobs/{job}" => job,
    CANCEL: DELETE "/jobs/{job}" => cancel_job,
    EVENTS: GET "/jobs/{job}/events" => job_events,
}

/// Period of polling a job.
const JOB_POLL: Duration = Duration::from_millis(200);

/// A job with each change, the last one with its end.
#[derive(Debug)]
pub struct JobEvents(Events);

impl JobEvents {
    /// The job after its next change; `None` when it has ended, or the server stops.
    pub async fn next(&mut self) -> Result<Option<Job>, ClientError> {
        while let Some(event) = self.0.next().await? {
            // A newer server may send other events.
            if event.name == "job" {
                let job = serde_json::from_str(&event.data);
                let url = self.0.url();
                return job.map(Some).map_err(|e| ClientError::Unexpected { url, detail: e.to_string() });
            }
        }
        Ok(None)
    }
}

impl MapClient {
    /// Starts to learn: these landmarks, or all that have views. `generated_views` warped views are
    /// made of each photograph, 0 to 100; `None` leaves the number to the server.
    pub async fn learn(
        &self,
        map: &str,
        landmarks: Option<&[String]>,
        generated_views: Option<u32>,
    ) -> Result<Job, ClientError> {
        let lesson = MapLesson {
            landmarks: landmarks.map(<[String]>::to_vec),
            generated_views: generated_views.map(|n| n as usize),
        };
        self.send(self.ask(&LEARN, &[&map])?.json(&lesson)).await
    }

    /// Starts to learn one landmark again from its views.
    pub async fn learn_landmark(
        &self,
        map: &str,
        landmark: &str,
        generated_views: Option<u32>,
    ) -> Result<Job, ClientError> {
        let lesson = LandmarkLesson { generated_views: generated_views.map(|n| n as usize) };
        self.send(self.ask(&LEARN_LANDMARK, &[&map, &landmark])?.json(&lesson)).await
    }

    /// A page of jobs, newest first, with their number on all pages.
    pub async fn jobs(&self, query: &JobQuery) -> Result<Page<Job>, ClientError> {
        self.send(self.ask_query(&LIST, &[], query)?).await
    }

    /// The present state of a job.
    pub async fn job(&self, job: i64) -> Result<Job, ClientError> {
        self.send(self.ask(&GET, &[&job])?).await
    }

    /// Asks a job to stop. No effect on a job that has ended.
    pub async fn cancel_job(&self, job: i64) -> Result<Job, ClientError> {
        self.send(self.ask(&CANCEL, &[&job])?).await
    }

    /// Follows a job.
    pub async fn job_events(&self, job: i64) -> Result<JobEvents, ClientError> {
        let response = self.checked(endless(self.ask(&EVENTS, &[&job])?)).await?;
        Ok(JobEvents(Events::new(response)))
    }

    /// Waits until a job is done; calls `progress` with every state received.
    pub async fn wait_for_job(
        &self,
        job: Job,
        wait: Duration,
        mut progress: impl FnMut(&Job),
    ) -> Result<Job, ClientError> {
        let (started, mut job) = (Instant::now(), job);
        loop {
            progress(&job);
            let id = job.id;
            let state = match job.state {
                JobState::Done => return Ok(job),
                JobState::Failed => "failed",
                JobState::Cancelled => "cancelled",
                JobState::Queued | JobState::Running if started.elapsed() < wait => {
                    tokio::time::sleep(JOB_POLL).await;
                    job = self.job(id).await?;
                    continue;
                }
                JobState::Queued | JobState::Running => {
                    return Err(ClientError::JobTimeout { id, waited: started.elapsed() });
                }
            };
            return Err(ClientError::Job { id, state, message: job.message });
        }
    }
}
