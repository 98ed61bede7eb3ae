//! `waymark-lab evaluate discrimination` (E3, E4, the paper's Fig. 11; E11, E14): how seldom a stranger is taken for a
//! landmark, per pair by the paper's thresholds and per quad by the whole decision, and what that costs in landmarks
//! missed.

use super::{
    Common, Setting,
    humps::{Humps, Pairs},
    lesson::{Class, noisy},
    look::{Outcome, detected, look, quad},
    mixed, of_each, pictures, say,
    strangers::{Stranger, strangers},
    write_plot,
};
use crate::evaluate::statistics::{Interval, upper_bound, wilson};
use serde::Serialize;
use sim::exhibit::{Conditions, Exhibit, Extent, exhibit};
use std::collections::BTreeMap;
use vision::{
    geometry::Corners,
    model::LandmarkId,
    params::Params,
    random::Random,
    recognise::{DistanceKind, Verdict, recognise},
};

/// `waymark-lab evaluate discrimination`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Landmarks in the map; several numbers, several maps.
    #[arg(long, value_delimiter = ',', default_value = "50", value_parser = clap::value_parser!(u32).range(2..=1000))]
    landmarks: Vec<u32>,
    /// Posters that are strangers, each a texture of its own; as many tenths of doors, windows, tiles and the like.
    #[arg(long, default_value_t = 250, value_parser = clap::value_parser!(u32).range(2..=2000))]
    strangers: u32,
    /// Views of each stranger.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    views: u32,
    /// Views of each landmark.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=1000))]
    own_views: u32,
    #[command(flatten)]
    common: Common,
}

/// Unknown quads of one kind.
#[derive(Debug, Default, Clone, Serialize)]
struct Stratum {
    name: String,
    hard: bool,
    textures: usize,
    quads: usize,
    accepted: usize,
    ambiguous: usize,
    /// Textures of which any quad was accepted.
    accepted_textures: usize,
    /// Upper 95 % bounds (exact) of the share of quads accepted, and of textures.
    bound: f64,
    texture_bound: f64,
}

/// Quads of landmarks.
#[derive(Debug, Clone, Serialize)]
struct Mated {
    quads: usize,
    right: usize,
    right_interval: Interval,
    wrong: usize,
    wrong_bound: f64,
    ambiguous: usize,
}

/// A stranger that is no look-alike on purpose and was taken for a landmark.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
struct Taken {
    /// Which stratum, and the how manieth of all strangers.
    stratum: &'static str,
    number: usize,
    /// For which landmark, in how many of its views.
    landmark: String,
    views: usize,
    of: usize,
}

#[derive(Debug, Serialize)]
struct Report {
    #[serde(flatten)]
    setting: Setting,
    mated: Mated,
    /// All that is no look-alike on purpose, then all, then each.
    unknown: Vec<Stratum>,
    taken: Vec<Taken>,
    /// By the paper's distances alone: H^r, C^r.
    pairs: [Pairs; 2],
    humps: [Humps; 2],
}

/// What one view of a stranger says.
struct Sight {
    recognition: Verdict,
    /// H^r and C^r to the first landmark, and pairs below tau of those compared.
    distances: Option<[f64; 2]>,
    below: [usize; 2],
    pairs: usize,
}

/// Landmarks that each stranger is compared with by the paper's distances alone.
const COMPARED: usize = 12;
/// Views of the first landmark for its histogram.
const HUMP_VIEWS: u64 = 200;

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let p = Params::default();
    let photographs = pictures::photographs(&args.common.photographs, args.common.part)?;
    // Every other one is taught, the rest are strangers.
    let deal = |odd: usize| photographs.iter().skip(odd).step_by(2).cloned().collect::<Vec<_>>();
    let (to_teach, unknown) = (deal(0), deal(1));
    let mut reports = Vec::new();
    for landmarks in &args.landmarks {
        let pictures = pictures::mixed(&to_teach, 0.5, *landmarks as usize, |i| {
            pictures::generated(args.common.part, args.common.seed, i)
        });
        let class = Class::new(pictures, args.common.taught, args.common.seed, &p)?;
        anyhow::ensure!(!class.models.is_empty(), "no landmark passed its gates");
        let report = measure(&class, &unknown, args, &p);
        say(args.common.json, &report, || table(&report))?;
        reports.push(report);
    }
    write_plot(args.common.plot.as_deref(), || {
        let humps: Vec<&Humps> = reports.iter().take(1).flat_map(|r| &r.humps).collect();
        super::humps::svg(&humps)
    })
}

fn measure(class: &Class, unknown: &[pictures::Picture], args: &Args, p: &Params) -> Report {
    let strangers = strangers(class, unknown, args.strangers, &args.common);
    let seen = of_each(&strangers, "strangers", |i, stranger| {
        (0..args.views)
            .filter_map(|v| stranger_view(class, stranger, (i, v), &args.common, p))
            .collect::<Vec<_>>()
    });
    let sights = || seen.iter().flatten();
    let own = own_distances(class, &args.common, p);
    let humps = [0, 1].map(|d| {
        let others: Vec<f64> = sights().filter_map(|s| s.distances.map(|x| x[d])).collect();
        let own: Vec<f64> = own.iter().map(|x| x[d]).collect();
        Humps::new(
            ["H^r", "C^r"][d],
            own,
            others,
            class.models.iter().next().map_or(0.0, |m| [m.hausdorff.tau, m.correlation.tau][d]),
        )
    });
    let (mated, missed) = mated(class, args, p);
    let pairs = [0, 1].map(|d| {
        let tried = sights().map(|s| s.pairs).sum();
        Pairs::new(sights().map(|s| s.below[d]).sum(), tried, missed[d], mated.quads)
    });
    Report {
        setting: Setting::new("discrimination", &args.common, class, p),
        mated,
        unknown: strata(&strangers, &seen),
        taken: taken(&strangers, &seen, |id| class.landmarks[id.0 as usize].name.clone()),
        pairs,
        humps,
    }
}

/// A view under a robot's conditions, and its corners as they are given (none: the detector finds them).
fn view(
    class: &Class,
    texture: &sim::texture::Texture,
    draw: u64,
    common: &Common,
) -> Option<(Exhibit, Option<Corners>)> {
    let mut random = Random::new(draw);
    let conditions = Conditions { yaw_rad: random.range(-1.05, 1.05), ..Conditions::realistic(draw) };
    let extent = if common.detector { Extent::Whole } else { Extent::Around };
    let seen = exhibit(texture, &class.wall, &conditions, extent, draw)?;
    let corners = noisy(&seen.corners, common.corner_noise_px, &mut random)?;
    Some((seen, (!common.detector).then_some(corners)))
}

fn stranger_view(
    class: &Class,
    stranger: &Stranger,
    (i, v): (usize, u32),
    common: &Common,
    p: &Params,
) -> Option<Sight> {
    let (seen, corners) =
        view(class, &stranger.texture, mixed(&[common.seed, 3, i as u64, u64::from(v)]), common)?;
    let quads = corners.map_or_else(|| detected(&seen, p), |c| vec![quad(c)]);
    let verdicts =
        quads.iter().map(|q| recognise(&seen.image, q, &class.models, DistanceKind::Both, p).verdict);
    let worst = verdicts.min_by_key(|r| match r {
        Verdict::Unique(_) => 0,
        Verdict::Ambiguous(_) => 1,
        Verdict::Unknown => 2,
    });
    let mut sight = Sight { recognition: worst?, distances: None, below: [0; 2], pairs: 0 };
    let Ok(icon) = vision::icon::icon(&seen.image, &quads.first()?.corners_px, &p.icon) else {
        return Some(sight);
    };
    let icon = vision::recognise::features(icon, &p.recognise);
    let every = class.models.len().div_ceil(COMPARED).max(1);
    for (n, model) in class.models.iter().enumerate() {
        // The first for its histogram, and others by turns.
        if n > 0 && (n + i) % every != 0 {
            continue;
        }
        let d = model.distances(&icon, &p.recognise);
        sight.pairs += 1;
        sight.below[0] += usize::from(d.hausdorff < model.hausdorff.tau);
        sight.below[1] += usize::from(d.correlation < model.correlation.tau);
        if n == 0 && !stranger.hard {
            sight.distances = Some([d.hausdorff, d.correlation]);
        }
    }
    Some(sight)
}

/// H^r and C^r of many views of the first landmark to itself.
fn own_distances(class: &Class, common: &Common, p: &Params) -> Vec<[f64; 2]> {
    let Some((id, picture)) = class.active().next() else { return vec![] };
    let numbers: Vec<u64> = (0..HUMP_VIEWS).collect();
    let look = |n: u64| {
        let (seen, corners) = view(class, &picture.texture, mixed(&[common.seed, 4, n]), common)?;
        let model = class.models.get(id)?;
        let corners = corners.or_else(|| detected(&seen, p).first().map(|q| q.corners_px))?;
        let icon = vision::icon::icon(&seen.image, &corners, &p.icon).ok()?;
        let d = model.distances(&vision::recognise::features(icon, &p.recognise), &p.recognise);
        Some([d.hausdorff, d.correlation])
    };
    of_each(&numbers, "one landmark", |_, n| look(*n)).into_iter().flatten().collect()
}

/// Views of landmarks: the decision, and how many the paper's distances miss.
fn mated(class: &Class, args: &Args, p: &Params) -> (Mated, [usize; 2]) {
    let landmarks: Vec<_> = class.active().collect();
    let looks = of_each(&landmarks, "landmarks", |_, (id, picture)| {
        let one = |v: u32| {
            let draw = mixed(&[args.common.seed, 5, id.0, u64::from(v)]);
            let (seen, corners) = view(class, &picture.texture, draw, &args.common)?;
            Some(look(class, *id, &seen, corners.as_ref(), p))
        };
        (0..args.own_views).filter_map(one).collect::<Vec<_>>()
    });
    let looks: Vec<_> = looks.into_iter().flatten().collect();
    let count = |outcome: Outcome| looks.iter().filter(|l| l.outcome == outcome).count();
    let (right, wrong) = (count(Outcome::Right), count(Outcome::Wrong));
    let missed = [0, 1].map(|d: usize| looks.iter().filter(|l| l.ratios[d] >= 1.0).count());
    let mated = Mated {
        quads: looks.len(),
        right,
        right_interval: wilson(right, looks.len()),
        wrong,
        wrong_bound: upper_bound(wrong, looks.len()),
        ambiguous: [Outcome::Doubtful, Outcome::Corners, Outcome::Plain, Outcome::Ambiguous]
            .map(count)
            .iter()
            .sum(),
    };
    (mated, missed)
}

/// Counts by stratum, before them those of all, and of all that is not hard on purpose.
fn strata(strangers: &[Stranger], seen: &[Vec<Sight>]) -> Vec<Stratum> {
    let of = |name: &str, hard: bool, is: &dyn Fn(&Stranger) -> bool| {
        let mut s = Stratum { name: name.to_owned(), hard, ..Stratum::default() };
        for (_, sights) in strangers.iter().zip(seen).filter(|(stranger, _)| is(stranger)) {
            let accepted = sights.iter().filter(|s| matches!(s.recognition, Verdict::Unique(_))).count();
            s.textures += 1;
            s.quads += sights.len();
            s.accepted += accepted;
            s.accepted_textures += usize::from(accepted > 0);
            s.ambiguous += sights.iter().filter(|s| matches!(s.recognition, Verdict::Ambiguous(_))).count();
        }
        (s.bound, s.texture_bound) =
            (upper_bound(s.accepted, s.quads), upper_bound(s.accepted_textures, s.textures));
        s
    };
    let mut names: Vec<(&str, bool)> = Vec::new();
    for s in strangers {
        if !names.contains(&(s.stratum, s.hard)) {
            names.push((s.stratum, s.hard));
        }
    }
    let mut all = vec![
        of("all but look-alikes", false, &|s| !s.hard),
        of("look-alikes of landmarks", true, &|s| s.hard),
    ];
    all.extend(names.into_iter().map(|(name, hard)| of(name, hard, &|s| s.stratum == name)));
    all
}

/// Strangers that were taken for a landmark though nobody made them like it, by what they were taken for.
fn taken(strangers: &[Stranger], seen: &[Vec<Sight>], name: impl Fn(LandmarkId) -> String) -> Vec<Taken> {
    let mut all = Vec::new();
    for (number, (stranger, sights)) in strangers.iter().zip(seen).enumerate().filter(|(_, (s, _))| !s.hard) {
        let mut views = BTreeMap::new();
        for sight in sights {
            if let Verdict::Unique(id) = sight.recognition {
                *views.entry(id).or_insert(0) += 1;
            }
        }
        let of = sights.len();
        let stratum = stranger.stratum;
        all.extend(views.into_iter().map(|(id, views)| Taken {
            stratum,
            number,
            landmark: name(id),
            views,
            of,
        }));
    }
    all
}

fn table(r: &Report) -> Vec<String> {
    let mut lines = r.setting.lines();
    let m = &r.mated;
    lines.push(format!(
        "  landmarks: {} of {} views right, {:.4} ({:.4}-{:.4}); {} wrong (at most {:.2e}); {} ambiguous",
        m.right,
        m.quads,
        m.right as f64 / m.quads.max(1) as f64,
        m.right_interval.0,
        m.right_interval.1,
        m.wrong,
        m.wrong_bound,
        m.ambiguous
    ));
    lines.push(format!(
        "  {:<28} {:>8} {:>7} {:>9} {:>12} {:>10} {:>20}",
        "unknown quads", "textures", "quads", "accepted", "at most", "ambiguous", "textures, at most"
    ));
    for s in &r.unknown {
        let name = if s.hard { format!("  {}", s.name) } else { s.name.clone() };
        lines.push(format!(
            "  {name:<28} {:>8} {:>7} {:>9} {:>12.2e} {:>10} {:>9} {:>10.2e}",
            s.textures, s.quads, s.accepted, s.bound, s.ambiguous, s.accepted_textures, s.texture_bound
        ));
    }
    for t in &r.taken {
        lines.push(format!(
            "  stranger {} ({}) was taken for {} in {} of {} views",
            t.number, t.stratum, t.landmark, t.views, t.of
        ));
    }
    for (name, pairs) in ["H^r", "C^r"].iter().zip(&r.pairs) {
        lines.push(format!("  {name} alone, {}", pairs.line()));
    }
    lines.extend(r.humps.iter().map(|h| format!("  first landmark, {}", h.line())));
    lines.push(
        "  At most: exact upper bound of the share at 95 % (Clopper-Pearson), by quads and by textures"
            .into(),
    );
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn strata_count_quads_and_textures() {
        let texture = Arc::new(sim::posters::poster_of_size(1, 8, 1.0));
        let stranger = |stratum, hard| Stranger { stratum, hard, texture: texture.clone() };
        let strangers = [stranger("posters", false), stranger("posters", false), stranger("tones", true)];
        let sight = |recognition| Sight { recognition, distances: None, below: [0; 2], pairs: 0 };
        let unique = || sight(Verdict::Unique(LandmarkId(1)));
        let unknown = || sight(Verdict::Unknown);
        let seen = vec![
            vec![unique(), unique(), unknown()],
            vec![unknown(), unknown(), sight(Verdict::Ambiguous(LandmarkId(1)))],
            vec![unknown()],
        ];
        let all = strata(&strangers, &seen);
        let names: Vec<&str> = all.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["all but look-alikes", "look-alikes of landmarks", "posters", "tones"]);
        let posters = &all[2];
        assert_eq!(
            (posters.quads, posters.accepted, posters.accepted_textures, posters.ambiguous),
            (6, 2, 1, 1)
        );
        let taken = taken(&strangers, &seen, |id| format!("landmark {}", id.0));
        let expected =
            Taken { stratum: "posters", number: 0, landmark: "landmark 1".into(), views: 2, of: 3 };
        assert_eq!(taken, [expected]);
        assert!((posters.bound - upper_bound(2, 6)).abs() < 1e-12 && (all[3].bound - 0.95).abs() < 1e-9);
    }
}
