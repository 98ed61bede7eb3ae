//! `waymark history`: what was changed of a map, and the way back.

mod drafts;

use super::{
    names::name,
    screen::{Table, counted},
    session::{Consent, MapArgs, Session},
};
use client::{
    MapClient,
    api::{
        ChangeKind, ChangeSummary, Commit, Difference, DifferenceQuery, LandmarkDifference, PageQuery,
        WallsDifference,
    },
};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Commits that a list shows where no number is given.
const SHOWN: usize = 20;
/// Landmarks asked for at a time.
const PAGE: usize = 100;

/// `waymark history`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    map: MapArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// List the newest commits of the map: who changed what, when and why.
    List {
        /// How many.
        #[arg(long, short = 'n', default_value_t = SHOWN)]
        count: usize,
    },
    /// Show what differs between two commits, or between one and now
    ///
    /// For example:
    ///   waymark history diff 12
    ///   waymark history diff 12 15
    #[command(verbatim_doc_comment)]
    Diff {
        /// Number of the earlier commit.
        from: u64,
        /// Number of the later commit; left out, now.
        to: Option<u64>,
    },
    /// Make the map what it was at a commit
    ///
    /// Landmarks come back with their views, pictures and models, byte for byte; walls and
    /// settings, too. It is a commit of its own, so it can be undone. Robots get the map at once.
    /// Look first what it changes: waymark history diff COMMIT
    #[command(verbatim_doc_comment)]
    Rollback {
        /// Number of the commit.
        commit: u64,
        #[command(flatten)]
        reason: Reason,
        #[command(flatten)]
        consent: Consent,
    },
    /// Begin a draft: a map of its own, with all that the map has, that no robot sees
    ///
    /// Teach and edit it as any map, with --map NAME; then publish it. For example:
    ///   waymark history draft office-draft
    ///   waymark landmark teach poster poster3.jpg --map office-draft
    ///   waymark history publish office-draft
    #[command(verbatim_doc_comment)]
    Draft {
        /// Its name: lower-case letters, digits, `-` and `_`.
        #[arg(value_parser = name)]
        name: String,
    },
    /// List the drafts of the map, or show what publishing one would change.
    Drafts {
        /// The draft to compare with the map.
        draft: Option<String>,
    },
    /// Try a draft: what the map's robots would be told otherwise in their last frames
    ///
    /// Nothing is changed. The server keeps the frames of stored answers in memory: let robots
    /// drive first.
    #[command(verbatim_doc_comment)]
    Replay {
        /// The draft.
        draft: String,
        /// Most frames.
        #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u8).range(1..=100))]
        frames: u8,
    },
    /// Publish a draft: what it has changed, by one commit of the map. The draft is gone then
    ///
    /// What both have changed since the draft began is named, and nothing is changed (status 4).
    #[command(verbatim_doc_comment)]
    Publish {
        /// The draft.
        draft: String,
        #[command(flatten)]
        reason: Reason,
        #[command(flatten)]
        consent: Consent,
    },
    /// Delete a draft. The map stays as it is; what was done on the draft is lost.
    Discard {
        /// The draft.
        draft: String,
        #[command(flatten)]
        consent: Consent,
    },
    /// Take one commit back, if no later one has changed the same.
    Undo {
        /// Number of the commit.
        commit: u64,
        #[command(flatten)]
        reason: Reason,
        #[command(flatten)]
        consent: Consent,
    },
}

/// Why it is done.
#[derive(Debug, Clone, clap::Args)]
struct Reason {
    /// Why, for the history: one line.
    #[arg(long, value_name = "TEXT")]
    why: Option<String>,
}

impl Reason {
    fn on(&self, maps: &MapClient) -> MapClient {
        self.why.as_ref().map_or_else(|| maps.clone(), |why| maps.with_reason(why))
    }
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.map.session()?;
    let done = on_map(&session, &args.verb).await;
    session.explained(done).await
}

async fn on_map(session: &Session, verb: &Verb) -> anyhow::Result<()> {
    let (maps, map) = (session.maps(), session.map().await?);
    match verb {
        Verb::List { count } => {
            let all = newest(maps, map, *count).await?;
            let now = SystemTime::now();
            let table = |all: &[Commit]| {
                Table::of(["commit", "when", "who", "what", "why"], all, |c| {
                    let why = c.why.clone().unwrap_or_default();
                    [c.id.to_string(), ago(c.created_ms, now), c.author.clone(), what(c), why]
                })
            };
            session.list(&all, table, &format!("Nothing is known of what was changed of {map}."))
        }
        Verb::Diff { from, to } => {
            let (difference, landmarks) = difference(maps, map, *from, *to).await?;
            let Difference { from_commit, to_commit, summary, walls, .. } = &difference;
            let head = format!("from commit {from_commit} to {to_commit}");
            let text = difference_text(&head, summary, walls.as_ref(), &landmarks);
            let mut whole = difference;
            whole.landmarks.items = landmarks;
            whole.landmarks.next = None;
            session.show(&whole, &text)
        }
        Verb::Rollback { commit, reason, consent } => {
            let (ahead, _) = difference(maps, map, *commit, None).await?;
            let since = summary_text(&ahead.summary);
            consent.ask(&format!("Roll {map} back to commit {commit}? What was changed since: {since}."))?;
            let done = reason.on(maps).roll_back(map, *commit).await?;
            let text = if done.changed {
                format!(
                    "{map} is as at commit {commit}, by commit {}: {}",
                    done.commit.id,
                    what(&done.commit)
                )
            } else {
                format!("{map} was as at commit {commit} already")
            };
            session.show(&done, &text)?;
            if done.changed {
                session
                    .note(&format!("  Take that back: waymark history undo {} --map {map}", done.commit.id));
            }
            Ok(())
        }
        Verb::Draft { name } => drafts::begin(session, map, name).await,
        Verb::Drafts { draft: None } => drafts::list(session, map).await,
        Verb::Drafts { draft: Some(draft) } => drafts::show(session, map, draft).await,
        Verb::Replay { draft, frames } => drafts::replay(session, map, draft, usize::from(*frames)).await,
        Verb::Publish { draft, reason, consent } => {
            drafts::publish(session, &reason.on(maps), (map, draft), consent).await
        }
        Verb::Discard { draft, consent } => drafts::discard(session, map, draft, consent).await,
        Verb::Undo { commit, reason, consent } => {
            let meant = maps.commit(map, *commit).await?;
            consent.ask(&format!("Take commit {commit} of {map} back ({})?", what(&meant)))?;
            let done = reason.on(maps).undo_commit(map, *commit).await?;
            let text =
                format!("commit {commit} is taken back by commit {}: {}", done.commit.id, what(&done.commit));
            session.show(&done, &text)
        }
    }
}

/// The newest commits of a map.
async fn newest(maps: &MapClient, map: &str, count: usize) -> anyhow::Result<Vec<Commit>> {
    let mut all = Vec::new();
    let mut query = PageQuery { limit: Some(count.clamp(1, PAGE)), cursor: None };
    while all.len() < count {
        let page = maps.commits(map, &query).await?;
        all.extend(page.items);
        query.cursor = page.next;
        if query.cursor.is_none() {
            break;
        }
    }
    all.truncate(count);
    Ok(all)
}

/// A difference with all its landmarks.
async fn difference(
    maps: &MapClient,
    map: &str,
    from: u64,
    to: Option<u64>,
) -> anyhow::Result<(Difference, Vec<LandmarkDifference>)> {
    let mut query = DifferenceQuery { from, to, limit: Some(PAGE), cursor: None };
    let first = maps.difference(map, &query).await?;
    let mut landmarks = first.landmarks.items.clone();
    // The later commit stays the same on every page.
    query.to = Some(first.to_commit);
    query.cursor.clone_from(&first.landmarks.next);
    while query.cursor.is_some() {
        let page = maps.difference(map, &query).await?.landmarks;
        landmarks.extend(page.items);
        query.cursor = page.next;
    }
    Ok((first, landmarks))
}

/// How long ago, to one unit.
fn ago(created_ms: i64, now: SystemTime) -> String {
    let then = UNIX_EPOCH + Duration::from_millis(created_ms.max(0) as u64);
    let seconds = now.duration_since(then).unwrap_or_default().as_secs();
    match seconds {
        0..60 => format!("{seconds} s ago"),
        60..3_600 => format!("{} min ago", seconds / 60),
        3_600..86_400 => format!("{} h ago", seconds / 3_600),
        _ => counted(seconds / 86_400, "day") + " ago",
    }
}

/// What a commit did: what changed, or how, where nothing is counted.
fn what(commit: &Commit) -> String {
    let text = summary_text(&commit.summary);
    if text == NOTHING { commit.operation.clone() } else { text }
}

const NOTHING: &str = "nothing";

/// Counts in words; one landmark is named.
fn summary_text(s: &ChangeSummary) -> String {
    let mut parts = Vec::new();
    let landmarks = [(s.landmarks_added, "+"), (s.landmarks_removed, "-"), (s.landmarks_changed, "")];
    let is_one = landmarks.iter().map(|(count, _)| count).sum::<u64>() == 1;
    for (count, sign) in landmarks.into_iter().filter(|(count, _)| *count > 0) {
        parts.push(match s.landmarks.first().filter(|_| is_one) {
            Some(name) => format!("{sign}{name}"),
            None => format!("{sign}{}", counted(count, "landmark")),
        });
    }
    for (count, word) in [
        (s.views_added, "+view"),
        (s.views_removed, "-view"),
        (s.models_changed, "model"),
        (s.reference_runs_added, "+run"),
        (s.reference_runs_removed, "-run"),
    ] {
        if count > 0 {
            let sign = word.chars().next().filter(|c| "+-".contains(*c));
            let noun = word.trim_start_matches(['+', '-']);
            parts.push(format!("{}{}", sign.map(String::from).unwrap_or_default(), counted(count, noun)));
        }
    }
    for (is_changed, word) in [(s.walls_changed, "walls"), (s.underlay_changed, "underlay")] {
        if is_changed {
            parts.push(word.to_owned());
        }
    }
    parts.extend(s.settings.iter().cloned());
    if parts.is_empty() { NOTHING.to_owned() } else { parts.join(", ") }
}

fn difference_text(
    head: &str,
    summary: &ChangeSummary,
    walls: Option<&WallsDifference>,
    landmarks: &[LandmarkDifference],
) -> String {
    let mut lines = vec![format!("{head}: {}", summary_text(summary))];
    if let Some(walls) = walls {
        let at = walls
            .bounds_m
            .map(|[x0, y0, x1, y1]| format!(", in x {x0:.2} to {x1:.2} m, y {y0:.2} to {y1:.2} m"));
        let (before, after) = (counted(walls.before, "segment"), walls.after);
        let (added, removed) = (walls.added, walls.removed);
        lines.push(format!("walls: {before}, now {after}: +{added} -{removed}{}", at.unwrap_or_default()));
    }
    if !landmarks.is_empty() {
        let table = Table::of(["landmark", "change", "what", "views", "model"], landmarks, |l| {
            let change = match l.change {
                ChangeKind::Added => "added",
                ChangeKind::Removed => "removed",
                ChangeKind::Changed => "changed",
            };
            let was = l.old_name.as_ref().map(|old| format!("was {old}"));
            let fields: Vec<String> = was.into_iter().chain(l.fields.iter().cloned()).collect();
            let views = format!("+{} -{}", l.views_added, l.views_removed);
            let model = if l.model_changed { "other" } else { "same" };
            [l.name.clone(), change.to_owned(), fields.join(", "), views, model.to_owned()]
        });
        lines.push(table.text());
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_names_one_landmark_and_counts_several() {
        let one = ChangeSummary {
            landmarks_removed: 1,
            landmarks: vec!["door".into()],
            ..ChangeSummary::default()
        };
        assert_eq!(summary_text(&one), "-door");
        let several = ChangeSummary {
            landmarks_added: 1,
            landmarks_changed: 2,
            views_added: 3,
            models_changed: 1,
            settings: vec!["areas".into()],
            landmarks: vec!["a".into(), "b".into(), "c".into()],
            ..ChangeSummary::default()
        };
        assert_eq!(summary_text(&several), "+1 landmark, 2 landmarks, +3 views, 1 model, areas");
        assert_eq!(summary_text(&ChangeSummary::default()), NOTHING);
    }

    #[test]
    fn times_are_shown_to_one_unit() {
        let at = |seconds: u64| ago(1_000, UNIX_EPOCH + Duration::from_secs(1 + seconds));
        assert_eq!([at(0), at(59), at(60)], ["0 s ago", "59 s ago", "1 min ago"]);
        assert_eq!([at(7_199), at(86_400), at(200_000)], ["1 h ago", "1 day ago", "2 days ago"]);
        assert_eq!(ago(5_000, UNIX_EPOCH), "0 s ago", "a clock that differs");
    }
}
