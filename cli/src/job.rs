//! `waymark job`: long work of the server.

use super::{
    failure::{Class, Failure},
    session::ServerArgs,
};
use client::api::{Job, JobState};

/// `waymark job`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    server: ServerArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// Show a job as it stands.
    Show {
        /// Number of the job.
        job: i64,
    },
    /// Wait until a job has ended.
    Wait {
        /// Number of the job.
        job: i64,
    },
    /// Ask a job to stop. One that has ended stays as it is.
    Cancel {
        /// Number of the job.
        job: i64,
    },
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let maps = session.maps();
    let done = match &args.verb {
        Verb::Show { job } => maps.job(*job).await,
        Verb::Cancel { job } => maps.cancel_job(*job).await,
        Verb::Wait { job } => match maps.job(*job).await {
            Ok(job) => session.finished(job, "job").await,
            Err(error) => Err(error),
        },
    };
    let job = session.explained(done.map_err(Into::into)).await?;
    session.show(&job, &line(&job))?;
    if job.state == JobState::Failed {
        return Err(
            Failure::new(Class::Failed, "job_failed", format!("job {}: {}", job.id, job.message)).into()
        );
    }
    Ok(())
}

fn line(job: &Job) -> String {
    let state = format!("{:?}", job.state).to_lowercase();
    format!(
        "{}  {} on {}: {state}, {:.0} %, {}",
        job.id,
        job.kind,
        job.map,
        100.0 * job.progress,
        job.message
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_is_shown_with_state_and_progress() {
        let job = Job {
            id: 7,
            kind: "learn".into(),
            map: "office".into(),
            state: JobState::Running,
            progress: 0.25,
            message: "poster".into(),
            result: None,
        };
        assert_eq!(line(&job), "7  learn on office: running, 25 %, poster");
    }
}
