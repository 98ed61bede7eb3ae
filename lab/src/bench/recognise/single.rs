//! Single quads: from the picture to the verdict in maps of several sizes, by step; and recall of
//! the short list.

use super::{
    Args, fastest,
    landmarks::each_of,
    queries::{Query, query},
    threads,
};
use crate::evaluate::statistics::median;
use cli::clock::Clock;
use serde::Serialize;
use std::{collections::BTreeMap, sync::Arc};
use vision::{
    model::{LandmarkModel, ModelSet},
    params::Params,
    recognise::{DistanceKind, RecogniseStep, StepListener, Verdict, recognise, recognise_watched},
};

/// Distractors are posters from this number on.
const DISTRACTORS: usize = 1_000_000;

/// Times and verdicts of single quads in one map.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    pub(super) landmarks: usize,
    /// Medians over the quads.
    pub(super) own_ms: f64,
    pub(super) distractor_ms: f64,
    /// Quads of landmarks, and as many of distractors.
    pub(super) asked: usize,
    pub(super) right: usize,
    pub(super) wrong: usize,
    pub(super) distractors_accepted: usize,
    /// Means over all quads, by step.
    pub(super) steps_ms: BTreeMap<&'static str, f64>,
}

/// Recall of the short list.
#[derive(Debug, Serialize)]
pub(super) struct Recall {
    pub(super) short_list: usize,
    pub(super) landmarks: usize,
    /// Quads that are accepted when their landmark is the only one.
    pub(super) accepted: usize,
    /// Of these, quads whose landmark is not on the list.
    pub(super) lost: usize,
}

/// Quads of landmarks and of distractors.
pub(super) struct Asked {
    own: Vec<(u64, Query)>,
    distractors: Vec<Query>,
}

impl Asked {
    /// Quads of the first `landmarks`.
    pub(super) fn new(args: &Args, first: u64, landmarks: usize) -> anyhow::Result<Self> {
        let n = args.quads as usize;
        let own = |i: usize| {
            Ok((1 + (i % landmarks) as u64, query(first, i % landmarks, args.seed.wrapping_add(i as u64))?))
        };
        let distractor = |i: usize| query(first, DISTRACTORS + i, args.seed);
        Ok(Self {
            own: each_of(n, threads(), "quads", own)?,
            distractors: each_of(n, threads(), "quads", distractor)?,
        })
    }

    /// Times of every quad in the map `models`.
    pub(super) fn time(&self, models: &ModelSet, rounds: usize, p: &Params) -> Report {
        let ask = |q: &Query| {
            fastest(rounds, || recognise(&q.image, &q.quad, models, DistanceKind::default(), p).verdict)
        };
        let own: Vec<(u64, (f64, Verdict))> = self.own.iter().map(|(id, q)| (*id, ask(q))).collect();
        let distractors: Vec<(f64, Verdict)> = self.distractors.iter().map(ask).collect();
        let unique = |r: &Verdict| if let Verdict::Unique(id) = r { Some(id.0) } else { None };
        let mut steps = StepClock { last: Clock::start(), ms: BTreeMap::new() };
        for q in self.own.iter().map(|(_, q)| q).chain(&self.distractors) {
            steps.last = Clock::start();
            recognise_watched(&q.image, &q.quad, models, DistanceKind::default(), p, &mut steps);
        }
        let asked = self.own.len() + self.distractors.len();
        Report {
            landmarks: models.len(),
            own_ms: median(&mut own.iter().map(|(_, (ms, _))| *ms).collect::<Vec<_>>()).unwrap_or(0.0),
            distractor_ms: median(&mut distractors.iter().map(|(ms, _)| *ms).collect::<Vec<_>>())
                .unwrap_or(0.0),
            asked: self.own.len(),
            right: own.iter().filter(|(id, (_, r))| unique(r) == Some(*id)).count(),
            wrong: own.iter().filter(|(id, (_, r))| unique(r).is_some_and(|u| u != *id)).count(),
            distractors_accepted: distractors.iter().filter(|(_, r)| unique(r).is_some()).count(),
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

/// Of quads that are accepted when their landmark is the only one: those without it on the short
/// list of `models`.
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
