//! The figures of a run: shares, percentiles, processor time, memory, and whether the counters add
//! up.

use super::{
    Args,
    plan::{End, Outcome, Phase, Plan, Sent},
    process::Usage,
    site::{Counters, Taught, summed},
};
use crate::evaluate::statistics::quantile;
use cli::screen::say;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// The server has recovered from the second on from which 99 % of the answers of every further
/// second take at most this, ms.
const RECOVERED_MS: f64 = 150.0;
/// The first minutes of a soak, in which memory still grows to its size.
const WARM_UP_S: f64 = 300.0;

/// What became of the frames of one phase.
struct PhaseFigures {
    sent: usize,
    shares: [f64; 4],
    percentiles_ms: [f64; 4],
    oldest_begun_ms: f64,
    work_ms: f64,
    guided: f64,
    named: f64,
    quiet_processed: f64,
    loud_processed: f64,
    answers_per_s: f64,
}

fn share(of: usize, all: usize) -> f64 {
    of as f64 / all.max(1) as f64
}

fn phase_figures(phase: &Phase, begins_s: f64, plan: &Plan, outcome: &Outcome) -> PhaseFigures {
    let is_in = |s: &&Sent| (begins_s..begins_s + phase.seconds).contains(&f64::from(s.intended_s));
    let frames = || outcome.robots.iter().flat_map(|robot| &robot.frames).filter(is_in);
    let sent = frames().count();
    let processed: Vec<&Sent> = frames().filter(|s| s.end == End::Processed).collect();
    let count = |end: End| frames().filter(|s| s.end == end).count();
    let mut latencies: Vec<f64> = processed.iter().map(|s| f64::from(s.latency_ms)).collect();
    let mut work: Vec<f64> = processed.iter().map(|s| f64::from(s.work_ms)).collect();
    let processed_of = |quiet: bool| {
        let of = outcome.robots.iter().enumerate().filter(|(i, _)| plan.is_quiet(*i) == quiet);
        let all: Vec<&Sent> = of.flat_map(|(_, robot)| &robot.frames).filter(is_in).collect();
        share(all.iter().filter(|s| s.end == End::Processed).count(), all.len())
    };
    PhaseFigures {
        sent,
        shares: [End::Processed, End::Expired, End::Rejected, End::Unanswered]
            .map(|end| share(count(end), sent)),
        percentiles_ms: [0.5, 0.9, 0.99, 0.999]
            .map(|share| quantile(&mut latencies, share).unwrap_or(f64::NAN)),
        oldest_begun_ms: processed.iter().map(|s| f64::from(s.age_ms)).fold(0.0, f64::max),
        work_ms: quantile(&mut work, 0.5).unwrap_or(f64::NAN),
        guided: share(processed.iter().filter(|s| s.is_guided).count(), processed.len()),
        named: share(processed.iter().filter(|s| s.is_named).count(), processed.len()),
        quiet_processed: processed_of(true),
        loud_processed: processed_of(false),
        answers_per_s: processed.len() as f64 / phase.seconds,
    }
}

/// Whole seconds after `begins_s` until every further second has its answers in time; `None`:
/// never.
fn recovery_s(begins_s: f64, ends_s: f64, outcome: &Outcome) -> Option<f64> {
    let mut seconds: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
    for sent in outcome.robots.iter().flat_map(|robot| &robot.frames) {
        let at_s = f64::from(sent.intended_s) - begins_s;
        if (0.0..ends_s - begins_s).contains(&at_s) {
            let latency_ms =
                if sent.end == End::Processed { f64::from(sent.latency_ms) } else { f64::INFINITY };
            seconds.entry(at_s as u64).or_default().push(latency_ms);
        }
    }
    let late = |all: &mut Vec<f64>| quantile(all, 0.99).is_none_or(|ms| ms > RECOVERED_MS);
    let last = seconds.iter_mut().filter_map(|(second, all)| late(all).then_some(*second)).max();
    let recovered = last.map_or(0.0, |second| second as f64 + 1.0);
    (begins_s + recovered < ends_s).then_some(recovered)
}

/// Least-squares slope of a figure over the looks after the warm-up, a minute.
fn slope_per_minute(seen: &[Usage], of: impl Fn(&Usage) -> f64) -> Option<f64> {
    let late: Vec<(f64, f64)> =
        seen.iter().filter(|u| u.at_s >= WARM_UP_S).map(|u| (u.at_s / 60.0, of(u))).collect();
    let n = late.len() as f64;
    let (x, y) = late.iter().fold((0.0, 0.0), |(x, y), point| (x + point.0 / n, y + point.1 / n));
    let spread: f64 = late.iter().map(|p| (p.0 - x).powi(2)).sum();
    (spread > 0.0).then(|| late.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / spread)
}

/// The largest of a figure.
fn most(seen: &[Usage], of: impl Fn(&Usage) -> f64) -> f64 {
    seen.iter().map(of).fold(0.0, f64::max)
}

/// All figures, for programs.
pub(super) fn figures(plan: &Plan, outcome: &Outcome, seen: &[Usage], counters: &Counters) -> Value {
    let mut begins_s = 0.0;
    let phases: Vec<Value> = plan
        .phases
        .iter()
        .map(|phase| {
            let figures = phase_figures(phase, begins_s, plan, outcome);
            begins_s += phase.seconds;
            json!({
                "name": phase.name,
                "sent": figures.sent,
                "processed": figures.shares[0],
                "expired": figures.shares[1],
                "rejected": figures.shares[2],
                "unanswered": figures.shares[3],
                "latency_ms": figures.percentiles_ms,
                "oldest_begun_ms": figures.oldest_begun_ms,
                "quiet_processed": figures.quiet_processed,
                "loud_processed": figures.loud_processed,
                "answers_per_s": figures.answers_per_s,
                "work_ms": figures.work_ms,
            })
        })
        .collect();
    json!({
        "phases": phases,
        "rss_mb": most(seen, |u| u.rss_mb),
        "connected_s": outcome.connected_s,
        "missing": counters.missing() as i64,
        "received": counters.received,
    })
}

/// Prints the phases; the length of all, s.
fn print_phases(plan: &Plan, outcome: &Outcome) -> f64 {
    say(
        "\n| phase | frames | processed | expired | refused | no answer | 50 % | 90 % | 99 % | 99.9 % ms | oldest begun ms |",
    );
    say("|---|---|---|---|---|---|---|---|---|---|---|");
    let mut begins_s = 0.0;
    let mut notes = Vec::new();
    for phase in &plan.phases {
        let f = phase_figures(phase, begins_s, plan, outcome);
        let [processed, expired, rejected, unanswered] = f.shares.map(|share| 100.0 * share);
        let [p50, p90, p99, p999] = f.percentiles_ms;
        say(&format!(
            "| {} | {} | {processed:.2} % | {expired:.2} % | {rejected:.2} % | {unanswered:.2} % | {p50:.1} | {p90:.1} | \
             {p99:.1} | {p999:.1} | {:.0} |",
            phase.name, f.sent, f.oldest_begun_ms
        ));
        notes.push(format!(
            "{}: {:.1} answers a second, work on a frame {:.1} ms (median), {:.0} % of them by expected landmarks alone, {:.0} % \
             with a pose; quiet robots {:.1} % processed, the others {:.1} %",
            phase.name,
            f.answers_per_s,
            f.work_ms,
            100.0 * f.guided,
            100.0 * f.named,
            100.0 * f.quiet_processed,
            100.0 * f.loud_processed
        ));
        begins_s += phase.seconds;
    }
    say("");
    for note in &notes {
        say(note);
    }
    if plan.phases.len() == 3 {
        let after_s = plan.phases[0].seconds + plan.phases[1].seconds;
        let recovered = recovery_s(after_s, begins_s, outcome);
        let text = recovered.map_or("not within the phase".to_owned(), |s| format!("within {s:.0} s"));
        say(&format!("99 % at most {RECOVERED_MS} ms again {text} after the overload"));
    }
    begins_s
}

/// Prints what the processes used in so many seconds.
fn print_processes(outcome: &Outcome, seen: &[Usage], seconds: f64) {
    let span = |of: fn(&Usage) -> f64| Some(of(seen.last()?) - of(seen.first()?));
    let (cpu, wall) = (span(|u| u.processor_s).unwrap_or(0.0), span(|u| u.at_s).unwrap_or(f64::NAN));
    say(&format!(
        "server: {:.2} cores, {:.0} MB resident at most, {:.0} threads, {:.0} files; robots: {:.2} cores, {:.0} MB",
        cpu / wall,
        most(seen, |u| u.rss_mb),
        most(seen, |u| u.threads as f64),
        most(seen, |u| u.files as f64),
        outcome.processor_s / seconds,
        outcome.rss_mb
    ));
    if let Some(rss) = slope_per_minute(seen, |u| u.rss_mb) {
        let [threads, files] =
            [slope_per_minute(seen, |u| u.threads as f64), slope_per_minute(seen, |u| u.files as f64)]
                .map(|slope| slope.unwrap_or(f64::NAN));
        say(&format!(
            "after {:.0} minutes: {rss:+.3} MB, {threads:+.3} threads, {files:+.3} files a minute",
            WARM_UP_S / 60.0
        ));
    }
}

/// Prints everything for people.
pub(super) fn print(
    args: &Args,
    plan: &Plan,
    outcome: &Outcome,
    seen: &[Usage],
    counters: &Counters,
    taught: &Taught,
) {
    let mut connect: Vec<f64> = outcome.connect_ms.iter().map(|ms| f64::from(*ms)).collect();
    let [median, late] = [0.5, 0.99].map(|share| quantile(&mut connect, share).unwrap_or(f64::NAN));
    say(&format!(
        "{} robots, {} Hz each, encrypted; all connected after {:.1} s, one in {median:.0} ms (median), {late:.0} ms (99 %)",
        args.robots, args.rate, outcome.connected_s
    ));
    let seconds = print_phases(plan, outcome);
    print_processes(outcome, seen, seconds);
    let sent: usize = outcome.robots.iter().map(|robot| robot.frames.len()).sum();
    let faults: u64 = outcome.robots.iter().map(|robot| robot.faults).sum();
    let Counters { received, processed, superseded, expired, rejected, open } = *counters;
    say(&format!(
        "sent {sent} frames (and {faults} faults); the server received {received}: {processed} processed, {superseded} \
         superseded, {expired} expired, {rejected} refused, {open} open; {} missing",
        counters.missing()
    ));
    let refusals = summed(outcome.robots.iter().map(|robot| &robot.refusals));
    if !refusals.is_empty() {
        say(&format!("refusals: {refusals:?}"));
    }
    say(&format!(
        "lesson of {} landmarks: {} ended in {:.0} s, {}",
        args.lesson,
        taught.lessons,
        taught.seconds,
        if taught.was_running { "one was running all the time" } else { "none was running at the end" }
    ));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::load::plan::RobotOutcome;

    fn sent(intended_s: f32, latency_ms: f32) -> Sent {
        Sent {
            intended_s,
            end: End::Processed,
            latency_ms,
            age_ms: 1.0,
            work_ms: 1.0,
            is_guided: false,
            is_named: false,
        }
    }

    #[test]
    fn recovery_is_counted_from_the_end_of_the_overload() {
        let frames = (0..100).map(|i| sent(0.1 * i as f32, if i < 62 { 400.0 } else { 20.0 })).collect();
        let outcome = Outcome {
            robots: vec![RobotOutcome { frames, ..RobotOutcome::default() }],
            ..Outcome::default()
        };
        assert_eq!(recovery_s(5.0, 10.0, &outcome), Some(2.0));
        assert_eq!(recovery_s(7.0, 10.0, &outcome), Some(0.0));
        assert_eq!(recovery_s(2.0, 6.0, &outcome), None);
    }

    #[test]
    fn a_slope_is_a_minute() {
        let look = |i: i32| Usage {
            at_s: 60.0 * f64::from(i),
            rss_mb: 100.0 + 2.0 * f64::from(i),
            ..Usage::default()
        };
        let seen: Vec<Usage> = (0..20).map(look).collect();
        assert!((slope_per_minute(&seen, |u| u.rss_mb).unwrap() - 2.0).abs() < 1e-9);
        assert_eq!(slope_per_minute(&seen[..3], |u| u.rss_mb), None);
    }
}
