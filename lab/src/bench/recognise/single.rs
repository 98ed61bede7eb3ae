//! Single quads: from the picture to the verdict in maps of several sizes, step by step; and what the short list loses.

use super::{
    Args, fastest,
    landmarks::each_of,
    queries::{Query, query},
    threads,
};
use crate::evaluate::statistics::median;
use serde::Serialize;
use server::cli::clock::Clock;
use std::{collections::BTreeMap, sync::Arc};
use vision::{
    model::{LandmarkModel, ModelSet},
    params::Params,
    recognise::{DistanceKind, RecogniseStep, StepListener, Verdict, recognise, recognise_watched},
};

/// Strangers are posters from this number on.
const STRANGERS: usize = 1_000_000;

/// What one quad costs in one map.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    pub(super) landmarks: usize,
    /// Medians over the quads.
    pub(super) own_ms: f64,
    pub(super) stranger_ms: f64,
    /// Quads of landmarks, and as many of none.
    pub(super) asked: usize,
    pub(super) right: usize,
    pub(super) wrong: usize,
    pub(super) strangers_accepted: usize,
    /// Means over all quads, by step.
    pub(super) steps_ms: BTreeMap<&'static str, f64>,
}

/// What the short list loses.
#[derive(Debug, Serialize)]
pub(super) struct Recall {
    pub(super) short_list: usize,
    pub(super) landmarks: usize,
    /// Quads whose landmark accepts them when it is alone.
    pub(super) accepted: usize,
    /// Those of them that are not on the list.
    pub(super) lost: usize,
}

/// Quads of known landmarks, and of none.
pub(super) struct Asked {
    own: Vec<(u64, Query)>,
    strangers: Vec<Query>,
}

impl Asked {
    /// Quads of the first `landmarks`.
    pub(super) fn new(args: &Args, first: u64, landmarks: usize) -> anyhow::Result<Self> {
        let n = args.quads as usize;
        let own = |i: usize| {
            Ok((1 + (i % landmarks) as u64, query(first, i % landmarks, args.seed.wrapping_add(i as u64))?))
        };
        let stranger = |i: usize| query(first, STRANGERS + i, args.seed);
        Ok(Self {
            own: each_of(n, threads(), "quads", own)?,
            strangers: each_of(n, threads(), "quads", stranger)?,
        })
    }

    /// Times of every quad in the map `models`.
    pub(super) fn time(&self, models: &ModelSet, rounds: usize, p: &Params) -> Report {
        let ask = |q: &Query| {
            fastest(rounds, || recognise(&q.image, &q.quad, models, DistanceKind::default(), p).verdict)
        };
        let own: Vec<(u64, (f64, Verdict))> = self.own.iter().map(|(id, q)| (*id, ask(q))).collect();
        let strangers: Vec<(f64, Verdict)> = self.strangers.iter().map(ask).collect();
        let unique = |r: &Verdict| if let Verdict::Unique(id) = r { Some(id.0) } else { None };
        let mut steps = StepClock { last: Clock::start(), ms: BTreeMap::new() };
        for q in self.own.iter().map(|(_, q)| q).chain(&self.strangers) {
            steps.last = Clock::start();
            recognise_watched(&q.image, &q.quad, models, DistanceKind::default(), p, &mut steps);
        }
        let asked = self.own.len() + self.strangers.len();
        Report {
            landmarks: models.len(),
            own_ms: median(&mut own.iter().map(|(_, (ms, _))| *ms).collect::<Vec<_>>()).unwrap_or(0.0),
            stranger_ms: median(&mut strangers.iter().map(|(ms, _)| *ms).collect::<Vec<_>>()).unwrap_or(0.0),
            asked: self.own.len(),
            right: own.iter().filter(|(id, (_, r))| unique(r) == Some(*id)).count(),
            wrong: own.iter().filter(|(id, (_, r))| unique(r).is_some_and(|u| u != *id)).count(),
            strangers_accepted: strangers.iter().filter(|(_, r)| unique(r).is_some()).count(),
            steps_ms: steps.ms.into_iter().map(|(step, ms)| (step, ms / asked as f64)).collect(),
        }
    }
}

/// Processor time between the ends of steps.
struct StepClock {
    last: Clock,
    ms: BTreeMap<&'static str, f64>,
}

impl StepListener for StepClock {
    fn finished(&mut self, step: RecogniseStep) {
        *self.ms.entry(step.name()).or_default() += self.last.ms();
        self.last = Clock::start();
    }
}

/// Of quads that their landmark accepts when it is the only one: how many do not have it on the short list of `models`.
pub(super) fn recall(args: &Args, first: u64, models: &ModelSet, p: &Params) -> anyhow::Result<Recall> {
    let all: Vec<&Arc<LandmarkModel>> = models.iter().collect();
    let n = args.recall_quads as usize;
    let found = each_of(n, threads(), "short list", |i| {
        // Evenly over the map.
        let index = i * all.len() / n;
        let q = query(first, index, args.seed.wrapping_add(0x5000_0000 + i as u64))?;
        let alone = ModelSet::new(vec![Arc::clone(all[index])], p)?;
        let kind = DistanceKind::default();
        let accepted = recognise(&q.image, &q.quad, &alone, kind, p).verdict != Verdict::Unknown;
        let listed = accepted && listed(&q, index, models, p);
        Ok((accepted, listed))
    })?;
    Ok(Recall {
        short_list: p.recognise.verdict.short_list,
        landmarks: models.len(),
        accepted: found.iter().filter(|(accepted, _)| *accepted).count(),
        lost: found.iter().filter(|(accepted, listed)| *accepted && !listed).count(),
    })
}

fn listed(q: &Query, index: usize, models: &ModelSet, p: &Params) -> bool {
    let Ok(icon) = vision::icon::icon(&q.image, &q.quad.corners_px, &p.icon) else { return false };
    let signature = vision::recognise::features::signature::Signature::new(&icon);
    models.short_list(&signature, p.recognise.verdict.short_list).iter().any(|l| l.model == index)
}
