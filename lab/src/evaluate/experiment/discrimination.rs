//! `waymark-lab evaluate discrimination` (E3, E4, the paper's Fig. 11; E11, E14): share of
//! distractors accepted, by pair and by quad, and landmarks missed at the same thresholds.

use super::{
    Common, Setting,
    distance_histograms::{DistanceHistograms, Pairs},
    distractors::{Distractor, distractors},
    lesson::{Class, noisy},
    mixed, of_each, pictures, say,
    view_outcome::{Outcome, detected, quad, score_view},
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
    recognise::{Verdict, recognise},
};

/// `waymark-lab evaluate discrimination`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Landmarks in the map; several numbers, several maps.
    #[arg(long, value_delimiter = ',', default_value = "50", value_parser = clap::value_parser!(u32).range(2..=1000))]
    landmarks: Vec<u32>,
    /// Posters that are distractors; as many tenths of doors, windows, tiles and the like.
    #[arg(long, default_value_t = 250, value_parser = clap::value_parser!(u32).range(2..=2000))]
    distractors: u32,
    /// Views of each distractor.
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

/// A distractor, no look-alike, that was accepted as a landmark.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
struct FalseAcceptance {
    /// Its stratum, and its index among all distractors.
    stratum: &'static str,
    number: usize,
    /// The landmark, and in how many of its views.
    landmark: String,
    views: usize,
    of: usize,
}

#[derive(Debug, Serialize)]
struct Report {
    #[serde(flatten)]
    setting: Setting,
    mated: Mated,
    /// All but look-alikes, all look-alikes, then each stratum.
    unknown: Vec<Stratum>,
    taken: Vec<FalseAcceptance>,
    /// By the paper's distances alone: H^r, C^r.
    pairs: [Pairs; 2],
    histograms: [DistanceHistograms; 2],
}

/// Result of one view of a distractor.
struct DistractorView {
    recognition: Verdict,
    /// H^r and C^r to the first landmark, and pairs below tau of those compared.
    distances: Option<[f64; 2]>,
    below: [usize; 2],
    pairs: usize,
}

/// Landmarks that each distractor is compared with by the paper's distances alone.
const COMPARED: usize = 12;
/// Views of the first landmark for its histogram.
const HISTOGRAM_VIEWS: u64 = 200;

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let p = args.common.preset.params();
    let photographs = pictures::photographs(&args.common.photographs, args.common.part)?;
    // Every other picture is taught, the rest are distractors.
    let deal = |odd: usize| photographs.iter().skip(odd).step_by(2).cloned().collect::<Vec<_>>();
    let (to_teach, unknown) = (deal(0), deal(1));
    let mut reports = Vec::new();
    for landmarks in &args.landmarks {
        let pictures = pictures::mixed(&to_teach, 0.5, *landmarks as usize, |i| {
            pictures::generated(args.common.part, args.common.seed, i)
        });
        let class = Class::new(pictures, args.common.taught, args.common.seed, &p)?;
        let class = class.deciding_by(args.common.preset);
        anyhow::ensure!(!class.models.is_empty(), "no landmark passed its gates");
        let report = measure(&class, &unknown, args, &p);
        say(args.common.json, &report, || table(&report))?;
        reports.push(report);
    }
    write_plot(args.common.plot.as_deref(), || {
        let histograms: Vec<_> = reports.iter().take(1).flat_map(|r| &r.histograms).collect();
        super::distance_histograms::svg(&histograms)
    })
}

fn measure(class: &Class, unknown: &[pictures::Picture], args: &Args, p: &Params) -> Report {
    let distractors = distractors(class, unknown, args.distractors, &args.common);
    let views = of_each(&distractors, "distractors", |i, distractor| {
        (0..args.views)
            .filter_map(|v| distractor_view(class, distractor, (i, v), &args.common, p))
            .collect::<Vec<_>>()
    });
    let all_views = || views.iter().flatten();
    let own = own_distances(class, &args.common, p);
    let histograms = [0, 1].map(|d| {
        let others: Vec<f64> = all_views().filter_map(|s| s.distances.map(|x| x[d])).collect();
        let own: Vec<f64> = own.iter().map(|x| x[d]).collect();
        DistanceHistograms::new(
            ["H^r", "C^r"][d],
            own,
            others,
            class.models.iter().next().map_or(0.0, |m| [m.hausdorff.tau, m.correlation.tau][d]),
        )
    });
    let (mated, missed) = mated(class, args, p);
    let pairs = [0, 1].map(|d| {
        let tried = all_views().map(|s| s.pairs).sum();
        Pairs::new(all_views().map(|s| s.below[d]).sum(), tried, missed[d], mated.quads)
    });
    Report {
        setting: Setting::new("discrimination", &args.common, class, p),
        mated,
        unknown: strata(&distractors, &views),
        taken: taken(&distractors, &views, |id| class.landmarks[id.0 as usize].name.clone()),
        pairs,
        histograms,
    }
}

/// A view under realistic conditions, and its given corners (`None`: the detector finds them).
fn rendered_view(
    class: &Class,
    texture: &sim::texture::Texture,
    draw: u64,
    common: &Common,
) -> Option<(Exhibit, Option<Corners>)> {
    let mut random = Random::new(draw);
    let conditions = Conditions { yaw_rad: random.range(-1.05, 1.05), ..Conditions::realistic(draw) };
    let extent = if common.detector { Extent::Whole } else { Extent::Around };
    let rendered = exhibit(texture, &class.wall, &conditions, extent, draw)?;
    let corners = noisy(&rendered.corners, common.corner_noise_px, &mut random)?;
    Some((rendered, (!common.detector).then_some(corners)))
}

fn distractor_view(
    class: &Class,
    distractor: &Distractor,
    (i, v): (usize, u32),
    common: &Common,
    p: &Params,
) -> Option<DistractorView> {
    let (rendered, corners) =
        rendered_view(class, &distractor.texture, mixed(&[common.seed, 3, i as u64, u64::from(v)]), common)?;
    let quads = corners.map_or_else(|| detected(&rendered, p), |c| vec![quad(c)]);
    let verdicts = quads.iter().map(|q| recognise(&rendered.image, q, &class.models, class.kind, p).verdict);
    let worst = verdicts.min_by_key(|r| match r {
        Verdict::Unique(_) => 0,
        Verdict::Ambiguous(_) => 1,
        Verdict::Unknown => 2,
    });
    let mut view = DistractorView { recognition: worst?, distances: None, below: [0; 2], pairs: 0 };
    let Ok(icon) = vision::icon::icon(&rendered.image, &quads.first()?.corners_px, &p.icon) else {
        return Some(view);
    };
    let icon = vision::recognise::features(icon, &p.recognise);
    let every = class.models.len().div_ceil(COMPARED).max(1);
    for (n, model) in class.models.iter().enumerate() {
        // The first for its histogram, the others in turn.
        if n > 0 && (n + i) % every != 0 {
            continue;
        }
        let d = model.distances(&icon, &p.recognise);
        view.pairs += 1;
        view.below[0] += usize::from(d.hausdorff < model.hausdorff.tau);
        view.below[1] += usize::from(d.correlation < model.correlation.tau);
        if n == 0 && !distractor.hard {
            view.distances = Some([d.hausdorff, d.correlation]);
        }
    }
    Some(view)
}

/// H^r and C^r of many views of the first landmark to itself.
fn own_distances(class: &Class, common: &Common, p: &Params) -> Vec<[f64; 2]> {
    let Some((id, picture)) = class.active().next() else { return vec![] };
    let numbers: Vec<u64> = (0..HISTOGRAM_VIEWS).collect();
    let distances = |n: u64| {
        let (rendered, corners) =
            rendered_view(class, &picture.texture, mixed(&[common.seed, 4, n]), common)?;
        let model = class.models.get(id)?;
        let corners = corners.or_else(|| detected(&rendered, p).first().map(|q| q.corners_px))?;
        let icon = vision::icon::icon(&rendered.image, &corners, &p.icon).ok()?;
        let d = model.distances(&vision::recognise::features(icon, &p.recognise), &p.recognise);
        Some([d.hausdorff, d.correlation])
    };
    of_each(&numbers, "one landmark", |_, n| distances(*n)).into_iter().flatten().collect()
}

/// Views of landmarks: the decision, and how many the paper's distances miss.
fn mated(class: &Class, args: &Args, p: &Params) -> (Mated, [usize; 2]) {
    let landmarks: Vec<_> = class.active().collect();
    let views = of_each(&landmarks, "landmarks", |_, (id, picture)| {
        let one = |v: u32| {
            let draw = mixed(&[args.common.seed, 5, id.0, u64::from(v)]);
            let (rendered, corners) = rendered_view(class, &picture.texture, draw, &args.common)?;
            Some(score_view(class, *id, &rendered, corners.as_ref(), p))
        };
        (0..args.own_views).filter_map(one).collect::<Vec<_>>()
    });
    let views: Vec<_> = views.into_iter().flatten().collect();
    let count = |outcome: Outcome| views.iter().filter(|l| l.outcome == outcome).count();
    let (right, wrong) = (count(Outcome::Right), count(Outcome::Wrong));
    let missed = [0, 1].map(|d: usize| views.iter().filter(|l| l.ratios[d] >= 1.0).count());
    let mated = Mated {
        quads: views.len(),
        right,
        right_interval: wilson(right, views.len()),
        wrong,
        wrong_bound: upper_bound(wrong, views.len()),
        ambiguous: [Outcome::Doubtful, Outcome::Corners, Outcome::Plain, Outcome::Ambiguous]
            .map(count)
            .iter()
            .sum(),
    };
    (mated, missed)
}

/// Counts of all but look-alikes, of all look-alikes, and by stratum.
fn strata(distractors: &[Distractor], views: &[Vec<DistractorView>]) -> Vec<Stratum> {
    let of = |name: &str, hard: bool, is: &dyn Fn(&Distractor) -> bool| {
        let mut s = Stratum { name: name.to_owned(), hard, ..Stratum::default() };
        for (_, views) in distractors.iter().zip(views).filter(|(distractor, _)| is(distractor)) {
            let accepted = views.iter().filter(|s| matches!(s.recognition, Verdict::Unique(_))).count();
            s.textures += 1;
            s.quads += views.len();
            s.accepted += accepted;
            s.accepted_textures += usize::from(accepted > 0);
            s.ambiguous += views.iter().filter(|s| matches!(s.recognition, Verdict::Ambiguous(_))).count();
        }
        (s.bound, s.texture_bound) =
            (upper_bound(s.accepted, s.quads), upper_bound(s.accepted_textures, s.textures));
        s
    };
    let mut names: Vec<(&str, bool)> = Vec::new();
    for s in distractors {
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

/// Distractors, no look-alikes, that were accepted, by the landmark that they were accepted as.
fn taken(
    distractors: &[Distractor],
    views: &[Vec<DistractorView>],
    name: impl Fn(LandmarkId) -> String,
) -> Vec<FalseAcceptance> {
    let mut all = Vec::new();
    for (number, (distractor, of_one)) in
        distractors.iter().zip(views).enumerate().filter(|(_, (s, _))| !s.hard)
    {
        let mut views = BTreeMap::new();
        for view in of_one {
            if let Verdict::Unique(id) = view.recognition {
                *views.entry(id).or_insert(0) += 1;
            }
        }
        let of = of_one.len();
        let stratum = distractor.stratum;
        all.extend(views.into_iter().map(|(id, views)| FalseAcceptance {
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
            "  distractor {} ({}) was accepted as {} in {} of {} views",
            t.number, t.stratum, t.landmark, t.views, t.of
        ));
    }
    for (name, pairs) in ["H^r", "C^r"].iter().zip(&r.pairs) {
        lines.push(format!("  {name} alone, {}", pairs.line()));
    }
    lines.extend(r.histograms.iter().map(|h| format!("  first landmark, {}", h.line())));
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
        let distractor = |stratum, hard| Distractor { stratum, hard, texture: texture.clone() };
        let distractors =
            [distractor("posters", false), distractor("posters", false), distractor("tones", true)];
        let view = |recognition| DistractorView { recognition, distances: None, below: [0; 2], pairs: 0 };
        let unique = || view(Verdict::Unique(LandmarkId(1)));
        let unknown = || view(Verdict::Unknown);
        let views = vec![
            vec![unique(), unique(), unknown()],
            vec![unknown(), unknown(), view(Verdict::Ambiguous(LandmarkId(1)))],
            vec![unknown()],
        ];
        let all = strata(&distractors, &views);
        let names: Vec<&str> = all.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["all but look-alikes", "look-alikes of landmarks", "posters", "tones"]);
        let posters = &all[2];
        assert_eq!(
            (posters.quads, posters.accepted, posters.accepted_textures, posters.ambiguous),
            (6, 2, 1, 1)
        );
        let taken = taken(&distractors, &views, |id| format!("landmark {}", id.0));
        let expected =
            FalseAcceptance { stratum: "posters", number: 0, landmark: "landmark 1".into(), views: 2, of: 3 };
        assert_eq!(taken, [expected]);
        assert!((posters.bound - upper_bound(2, 6)).abs() < 1e-12 && (all[3].bound - 0.95).abs() < 1e-9);
    }
}
