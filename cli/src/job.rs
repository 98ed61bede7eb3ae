//! `waymark job`: long work of the server.

use super::{
    failure::{Class, Failure},
    screen::Table,
    session::{ServerArgs, Session},
};
use client::api::{Job, JobQuery, JobState};

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
    /// List jobs, newest first: those that wait or run, and the last that have ended.
    List {
        /// Only those that stand so.
        #[arg(long, value_enum)]
        state: Option<StateWord>,
        /// Only those of this map.
        #[arg(long, value_name = "MAP")]
        map: Option<String>,
        /// Most jobs that are listed.
        #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u16).range(1..=500))]
        limit: u16,
    },
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

/// Where a job stands, as it is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum StateWord {
    Queued,
    Running,
    Done,
    Failed,
    Cancelled,
}

impl From<StateWord> for JobState {
    fn from(word: StateWord) -> Self {
        match word {
            StateWord::Queued => Self::Queued,
            StateWord::Running => Self::Running,
            StateWord::Done => Self::Done,
            StateWord::Failed => Self::Failed,
            StateWord::Cancelled => Self::Cancelled,
        }
    }
}

async fn list(session: &Session, query: &JobQuery) -> anyhow::Result<()> {
    let page = session.maps().jobs(query).await?;
    let table = |all: &[Job]| {
        Table::of(["job", "what", "map", "state", "done", "message"], all, |job| {
            let done = format!("{:.0} %", 100.0 * job.progress);
            let state = job.state.as_str().to_owned();
            [job.id.to_string(), job.kind.clone(), job.map.clone(), state, done, job.message.clone()]
        })
    };
    session.list(&page.items, table, "There is no such job.")?;
    let more = page.total.saturating_sub(page.items.len() as u64);
    if page.next.is_some() {
        session.note(&format!("  {more} more: --limit, --state or --map"));
    }
    Ok(())
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let maps = session.maps();
    let done = match &args.verb {
        Verb::List { state, map, limit } => {
            let query = JobQuery {
                limit: Some(usize::from(*limit)),
                cursor: None,
                state: state.map(JobState::from),
                map: map.clone(),
            };
            return session.explained(list(&session, &query).await).await;
        }
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
            by: "local".into(),
            created_ms: 1,
            started_ms: Some(2),
            ended_ms: None,
        };
        assert_eq!(line(&job), "7  learn on office: running, 25 %, poster");
    }
}
