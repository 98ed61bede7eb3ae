//! `waymark-lab evaluate lookalikes`: pairs of pictures that are nearly the same. With one taught:
//! is the other accepted as it? With both taught: are they distinguished, refused as ambiguous, or
//! confused?

use super::{
    Common, Setting,
    lesson::{Class, noisy},
    mixed, of_each,
    pictures::{Picture, generated},
    say,
    view_outcome::quad,
};
use crate::evaluate::statistics::{Interval, upper_bound, wilson};
use serde::Serialize;
use sim::{
    exhibit::{Conditions, Extent, exhibit},
    lookalikes::{LookAlikeKind, lookalikes},
};
use std::sync::Arc;
use vision::{
    model::LandmarkId,
    params::Params,
    random::Random,
    recognise::{Verdict, recognise},
};

/// `waymark-lab evaluate lookalikes`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Pairs of each kind.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=100))]
    pairs: u32,
    /// Views of each picture.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=1000))]
    views: u32,
    #[command(flatten)]
    common: Common,
}

/// Results of the pairs of one kind.
#[derive(Debug, Clone, Serialize)]
struct Kind {
    change: &'static str,
    pairs: usize,
    /// One of each pair is taught: views of the other.
    alone: Counts,
    /// Both are taught: pictures that failed a quality gate, and views of the active ones.
    inactive: usize,
    both: Counts,
    /// Exact upper 95 % bound of the share accepted as the look-alike, with one taught and with
    /// both.
    alone_bound: f64,
    both_bound: f64,
    right_interval: Interval,
}

#[derive(Debug, Default, Clone, Serialize)]
struct Counts {
    views: usize,
    right: usize,
    look_alike: usize,
    other: usize,
    ambiguous: usize,
    unknown: usize,
}

#[derive(Debug, Serialize)]
struct Report {
    #[serde(flatten)]
    setting: Setting,
    kinds: Vec<Kind>,
}

/// A pair of pictures that look alike.
struct Pair {
    change: LookAlikeKind,
    pictures: [Picture; 2],
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let (p, preset) = (args.common.preset.params(), args.common.preset);
    anyhow::ensure!(
        !args.common.detector && args.common.plot.is_none(),
        "there is neither --detector nor --plot here"
    );
    let photographs = super::pictures::photographs(&args.common.photographs, args.common.part)?;
    let pairs = pairs(&photographs, args);
    let first: Vec<Picture> = pairs.iter().map(|pair| pair.pictures[0].clone()).collect();
    let alone = Class::new(first, args.common.taught, args.common.seed, &p)?.deciding_by(preset);
    let both: Vec<Picture> = pairs.iter().flat_map(|pair| pair.pictures.clone()).collect();
    let both = Class::new(both, args.common.taught, args.common.seed, &p)?.deciding_by(preset);
    let counted = of_each(&pairs, "look-alikes", |i, pair| {
        // The look-alike of landmark i, with only i taught.
        let one = count(&alone, &pair.pictures[1], [None, Some(i)], args, &p);
        let of = |side: usize| {
            let own = 2 * i + side;
            let in_use = both.models.get(LandmarkId(own as u64)).is_some();
            in_use.then(|| count(&both, &pair.pictures[side], [Some(own), Some(2 * i + 1 - side)], args, &p))
        };
        (one, [of(0), of(1)])
    });
    let kinds = LookAlikeKind::ALL.into_iter().map(|change| kind(change, &pairs, &counted)).collect();
    let report = Report { setting: Setting::new("lookalikes", &args.common, &both, &p), kinds };
    say(args.common.json, &report, || table(&report))
}

/// Pairs of all kinds, each of a picture of its own.
fn pairs(photographs: &[Picture], args: &Args) -> Vec<Pair> {
    let numbers: Vec<usize> = (0..LookAlikeKind::ALL.len() * args.pairs as usize).collect();
    of_each(&numbers, "drawing", |_, i| {
        let (seed, part) = (args.common.seed, args.common.part);
        let change = LookAlikeKind::ALL[i % LookAlikeKind::ALL.len()];
        // Every other picture is a photograph while there are any.
        let photograph = photographs.get(i / 2).filter(|_| i % 2 == 0).cloned();
        let picture = photograph.unwrap_or_else(|| generated(part, seed, *i));
        let textures = lookalikes(&picture.texture, change, mixed(&[seed, 9, *i as u64]));
        let pictures = textures.map(|texture| Picture { texture: Arc::new(texture), ..picture.clone() });
        Pair { change, pictures }
    })
}

/// Views of a picture in a class with the landmarks `own` and its `look_alike`, if given.
fn count(
    class: &Class,
    picture: &Picture,
    [own, look_alike]: [Option<usize>; 2],
    args: &Args,
    p: &Params,
) -> Counts {
    let mut counts = Counts::default();
    let is = |id: LandmarkId, index: Option<usize>| index.is_some_and(|i| id.0 == i as u64);
    for v in 0..args.views {
        let key = own.map_or(u64::MAX, |o| o as u64);
        let draw = mixed(&[args.common.seed, 10, key, look_alike.unwrap_or(0) as u64, u64::from(v)]);
        let mut random = Random::new(draw);
        let conditions = Conditions { yaw_rad: random.range(-0.9, 0.9), ..Conditions::realistic(draw) };
        let Some(rendered) = exhibit(&picture.texture, &class.wall, &conditions, Extent::Around, draw) else {
            continue;
        };
        let Some(corners) = noisy(&rendered.corners, args.common.corner_noise_px, &mut random) else {
            continue;
        };
        counts.views += 1;
        match recognise(&rendered.image, &quad(corners), &class.models, class.kind, p).verdict {
            Verdict::Unique(id) if is(id, own) => counts.right += 1,
            Verdict::Unique(id) if is(id, look_alike) => counts.look_alike += 1,
            Verdict::Unique(_) => counts.other += 1,
            Verdict::Ambiguous(_) => counts.ambiguous += 1,
            Verdict::Unknown => counts.unknown += 1,
        }
    }
    counts
}

impl Counts {
    fn add(&mut self, o: &Self) {
        self.views += o.views;
        self.right += o.right;
        self.look_alike += o.look_alike;
        self.other += o.other;
        self.ambiguous += o.ambiguous;
        self.unknown += o.unknown;
    }
}

fn kind(change: LookAlikeKind, pairs: &[Pair], counted: &[(Counts, [Option<Counts>; 2])]) -> Kind {
    let (mut alone, mut both, mut inactive, mut count) = (Counts::default(), Counts::default(), 0, 0);
    for (_, (one, two)) in pairs.iter().zip(counted).filter(|(pair, _)| pair.change == change) {
        count += 1;
        alone.add(one);
        inactive += two.iter().filter(|t| t.is_none()).count();
        two.iter().flatten().for_each(|t| both.add(t));
    }
    Kind {
        change: change.name(),
        pairs: count,
        alone_bound: upper_bound(alone.look_alike, alone.views),
        both_bound: upper_bound(both.look_alike + both.other, both.views),
        right_interval: wilson(both.right, both.views),
        alone,
        inactive,
        both,
    }
}

fn table(r: &Report) -> Vec<String> {
    let mut lines = r.setting.lines();
    lines.push(format!(
        "  {:<12} {:>5} | {:<46} | {}",
        "", "pairs", "one taught, views of the other", "both taught"
    ));
    lines.push(format!(
        "  {:<12} {:>5} | {:>5} {:>6} {:>9} {:>7} {:>9}      | {:>8} {:>5} {:>6} {:>21} {:>6} {:>9} {:>9} {:>7}",
        "", "", "views", "taken", "at most", "unsure", "refused", "inactive", "views", "right", "", "wrong", "at most", "ambiguous", "unknown"
    ));
    for k in &r.kinds {
        let (a, b) = (&k.alone, &k.both);
        let share = b.right as f64 / b.views.max(1) as f64;
        lines.push(format!(
            "  {:<12} {:>5} | {:>5} {:>6} {:>9.3} {:>7} {:>9}      | {:>8} {:>5} {:>6} {share:.3} ({:.3}-{:.3}) {:>6} {:>9.3} {:>9} {:>7}",
            k.change,
            k.pairs,
            a.views,
            a.look_alike + a.other,
            k.alone_bound,
            a.ambiguous,
            a.unknown,
            k.inactive,
            b.views,
            b.right,
            k.right_interval.0,
            k.right_interval.1,
            b.look_alike + b.other,
            k.both_bound,
            b.ambiguous,
            b.unknown
        ));
    }
    lines.push(
        "  At most: exact upper bound of the share at 95 %. In brackets 95 % of the share right".into(),
    );
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_add_up_their_pairs() {
        let picture = || generated(super::super::pictures::Part::Tune, 1, 0);
        let pair = |change| Pair { change, pictures: [picture(), picture()] };
        let counts = |right, look_alike| Counts { views: 4, right, look_alike, ..Counts::default() };
        let pairs = [pair(LookAlikeKind::Text), pair(LookAlikeKind::Doors), pair(LookAlikeKind::Text)];
        let counted = [
            (counts(0, 1), [Some(counts(4, 0)), None]),
            (counts(0, 4), [Some(counts(0, 4)), Some(counts(0, 4))]),
            (counts(0, 0), [Some(counts(3, 1)), Some(counts(2, 0))]),
        ];
        let text = kind(LookAlikeKind::Text, &pairs, &counted);
        assert_eq!((text.pairs, text.alone.look_alike, text.inactive), (2, 1, 1));
        assert_eq!((text.both.views, text.both.right, text.both.look_alike), (12, 9, 1));
        assert!((text.both_bound - upper_bound(1, 12)).abs() < 1e-12);
    }
}
