//! Drafts: begun, listed, compared, published, discarded.

use super::{PAGE, ago, counted, difference_text, summary_text, what};
use crate::{
    screen::Table,
    session::{Consent, Session},
};
use client::{
    MapClient,
    api::{Draft, DraftDifference, PageQuery, Replay, ReplayChange, ReplayedPose},
};
use std::time::SystemTime;

pub(super) async fn begin(session: &Session, map: &str, name: &str) -> anyhow::Result<()> {
    let made = session.maps().begin_draft(map, name).await?;
    let landmarks = counted(made.landmarks, "landmark");
    session.show(
        &made,
        &format!("{name} is a draft of {map} at commit {}, with {landmarks}", made.from_commit),
    )?;
    session.note(&format!(
        "  Edit it with --map {name}; see what it changes: waymark history drafts {name} --map {map}"
    ));
    Ok(())
}

pub(super) async fn list(session: &Session, map: &str) -> anyhow::Result<()> {
    let all = session.maps().drafts(map).await?;
    let now = SystemTime::now();
    let table = |all: &[Draft]| {
        Table::of(["draft", "begun", "at commit", "landmarks"], all, |d| {
            [d.name.clone(), ago(d.created_ms, now), d.from_commit.to_string(), d.landmarks.to_string()]
        })
    };
    session.list(
        &all,
        table,
        &format!("{map} has no draft. Begin one: waymark history draft NAME --map {map}"),
    )
}

/// A comparison with all its landmarks.
async fn compared(maps: &MapClient, map: &str, draft: &str) -> anyhow::Result<DraftDifference> {
    let mut query = PageQuery { limit: Some(PAGE), cursor: None };
    let mut whole = maps.draft_difference(map, draft, &query).await?;
    while let Some(next) = whole.landmarks.next.take() {
        query.cursor = Some(next);
        let page = maps.draft_difference(map, draft, &query).await?.landmarks;
        whole.landmarks.items.extend(page.items);
        whole.landmarks.next = page.next;
    }
    Ok(whole)
}

pub(super) async fn show(session: &Session, map: &str, draft: &str) -> anyhow::Result<()> {
    let whole = compared(session.maps(), map, draft).await?;
    let head = format!("publishing {draft} changes of {map}");
    let mut lines =
        vec![difference_text(&head, &whole.summary, whole.walls.as_ref(), &whole.landmarks.items)];
    let in_the_way = |conflict: &String| format!("in the way, changed on both sides: {conflict}");
    lines.extend(whole.conflicts.iter().map(in_the_way));
    session.show(&whole, &lines.join("\n"))
}

/// Frames that are shown one by one.
const SHOWN: usize = 10;

pub(super) async fn replay(session: &Session, map: &str, draft: &str, frames: usize) -> anyhow::Result<()> {
    let report = session.maps().replay_draft(map, draft, Some(frames)).await?;
    session.show(&report, &report_text(&report, map, draft))?;
    if report.frames == 0 {
        session.note(
            "  Frames are kept while robots drive, of one answer in some seconds; a restart forgets them.",
        );
    }
    Ok(())
}

fn report_text(report: &Replay, map: &str, draft: &str) -> String {
    let Replay { frames, unchanged, robots, changes } = report;
    if *frames == 0 {
        return format!("no frame of a robot on {map} is kept: nothing to try {draft} with");
    }
    let all = counted(*frames, "frame");
    let mut lines = vec![format!("{all} of robots on {map}, answered by {draft}: {unchanged} as before")];
    for r in robots.iter().filter(|r| r.unchanged < r.frames) {
        let parts = [
            (r.lost, "with landmarks lost".to_owned()),
            (r.gained, "with landmarks gained".to_owned()),
            (r.pose_lost, "without a pose now".to_owned()),
            (r.pose_gained, "with a pose now".to_owned()),
            (r.pose_moved, format!("with another pose, up to {:.3} m away", r.longest_move_m)),
        ];
        let parts =
            parts.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}"));
        let all = counted(r.frames, "frame");
        lines.push(format!("  {}, {all}: {}", r.robot, parts.collect::<Vec<_>>().join("; ")));
    }
    lines.extend(changes.iter().take(SHOWN).map(|change| format!("  {}", change_text(change))));
    if let Some(more @ 1..) = changes.len().checked_sub(SHOWN) {
        lines.push(format!("  and {more} more; all with --json"));
    }
    lines.join("\n")
}

fn change_text(change: &ReplayChange) -> String {
    let mut parts = Vec::new();
    if !change.lost.is_empty() {
        parts.push(format!("not named any more: {}", change.lost.join(", ")));
    }
    if !change.gained.is_empty() {
        parts.push(format!("named now: {}", change.gained.join(", ")));
    }
    match change.pose {
        ReplayedPose::Same => {}
        ReplayedPose::Gained => parts.push("a pose now".to_owned()),
        ReplayedPose::Lost => parts.push("no pose any more".to_owned()),
        ReplayedPose::Moved => {
            let (distance_m, angle) =
                (change.distance_m.unwrap_or_default(), change.angle_rad.unwrap_or_default());
            parts.push(format!("pose {distance_m:.3} m and {:.1} degrees away", angle.to_degrees()));
        }
    }
    format!("{}/{} at {} ms: {}", change.robot, change.camera, change.captured_ms, parts.join("; "))
}

pub(super) async fn publish(
    session: &Session,
    maps: &MapClient,
    (map, draft): (&str, &str),
    consent: &Consent,
) -> anyhow::Result<()> {
    let ahead = maps.draft_difference(map, draft, &PageQuery { limit: Some(1), cursor: None }).await?;
    consent.ask(&format!("Publish {draft} to {map}? It changes: {}.", summary_text(&ahead.summary)))?;
    let done = maps.publish_draft(map, draft).await?;
    let text = if done.changed {
        format!("{draft} is published to {map} by commit {}: {}", done.commit.id, what(&done.commit))
    } else {
        format!("{draft} had changed nothing of {map}, and is gone")
    };
    session.show(&done, &text)?;
    if done.changed {
        session.note(&format!("  Take that back: waymark history undo {} --map {map}", done.commit.id));
    }
    Ok(())
}

pub(super) async fn discard(
    session: &Session,
    map: &str,
    draft: &str,
    consent: &Consent,
) -> anyhow::Result<()> {
    let maps = session.maps();
    let ahead = maps.draft_difference(map, draft, &PageQuery { limit: Some(1), cursor: None }).await?;
    consent
        .ask(&format!("Discard {draft}? What it would change is lost: {}.", summary_text(&ahead.summary)))?;
    maps.discard_draft(map, draft).await?;
    session.show(
        &serde_json::json!({ "discarded": draft }),
        &format!("draft {draft} is gone; {map} is as it was"),
    )
}
