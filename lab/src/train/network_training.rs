//! Trains the detector's small networks: labelled measurements in, a `Network` out. Same data, same
//! seed: same weights. The caller decides which measurements go in.
//!
//! Two tasks: the right one of several candidates (conditional logit), and whether an example is
//! one (logistic). Full batches, Adam, weights kept small by a ridge.

use vision::{
    detect::border_model::{
        feature_constants::FeatureDigest,
        network::{MAX_HIDDEN, Network},
    },
    random::Random,
};

/// Scaled measurements are clipped at this many deviations, as in [`Network::output`].
const CLIP: f64 = 4.0;
/// Adam: decay of the means of the gradient and of its square, and the term that keeps the quotient
/// finite.
const ADAM: [f64; 3] = [0.9, 0.99, 1e-8];
/// Standard deviations of the initial weights into and out of the hidden units, the former over the
/// root of their number.
const FIRST: [f64; 2] = [0.6, 0.3];
/// A measurement that varies less is scaled by 1.
const MIN_DEVIATION: f64 = 1e-9;
/// Most steps of a training.
pub(crate) const MAX_STEPS: usize = 100_000;

/// Candidates of which at least one is right.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ChoiceExample {
    /// Part of the data, for holding parts out.
    pub(crate) group: usize,
    /// Weight of these candidates, above 0.
    pub(crate) weight: f64,
    /// Each candidate's measurements.
    pub(crate) features: Vec<Vec<f64>>,
    /// Distance of each candidate from the truth.
    pub(crate) off: Vec<f64>,
}

/// One labelled candidate.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LabelledExample {
    /// As for [`ChoiceExample`].
    pub(crate) group: usize,
    /// Weight, above 0.
    pub(crate) weight: f64,
    pub(crate) features: Vec<f64>,
    /// Whether it is one.
    pub(crate) is_one: bool,
}

/// Settings of a training.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TrainParams {
    /// Hidden units, at most [`MAX_HIDDEN`]; 0 for a linear model.
    pub(crate) hidden: usize,
    /// Steps, at most [`MAX_STEPS`].
    pub(crate) steps: usize,
    /// Length of a step.
    pub(crate) rate: f64,
    /// Half of it weighs the squares of all weights but biases, against the sum of the losses.
    pub(crate) ridge: f64,
    /// Additional distance at which a candidate's target probability is 1/e of the best one's.
    /// Above 0.
    pub(crate) reach: f64,
    /// Seed of the hidden units' initial weights.
    pub(crate) seed: u64,
}

impl Default for TrainParams {
    fn default() -> Self {
        Self { hidden: 16, steps: 500, rate: 0.02, ridge: 5.0, reach: 1.0, seed: 1 }
    }
}

/// Why there is no network.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum TrainError {
    /// No set of candidates has a right and a wrong one, or all examples have one label.
    #[error("nothing to learn from: right ones and wrong ones are needed")]
    NothingToLearn,
    /// Numbers of measurements differ, or one is not finite.
    #[error("item {0}: its measurements do not fit the others or are not finite")]
    Malformed(usize),
    /// A parameter is out of its range.
    #[error("{0} is out of range")]
    Range(&'static str),
}

/// A network that gives the right one of several candidates the greatest output.
pub(crate) fn train_choice(rivals: &[ChoiceExample], p: &TrainParams) -> Result<Network, TrainError> {
    if p.reach.is_nan() || p.reach <= 0.0 {
        return Err(TrainError::Range("reach"));
    }
    train(rivals.iter().map(|r| Task::choice(r, p.reach)).collect(), p)
}

/// A network whose output is the logarithm of the odds that an example is one.
pub(crate) fn train_classifier(examples: &[LabelledExample], p: &TrainParams) -> Result<Network, TrainError> {
    let both = examples.iter().any(|e| e.is_one) && examples.iter().any(|e| !e.is_one);
    if !both {
        return Err(TrainError::NothingToLearn);
    }
    train(examples.iter().map(Task::labelled).collect(), p)
}

/// Measurements with their target probabilities; a single one is compared with an output of 0.
struct Task<'a> {
    weight: f64,
    features: Vec<&'a [f64]>,
    wanted: Vec<f64>,
    alone: bool,
}

impl<'a> Task<'a> {
    fn choice(r: &'a ChoiceExample, reach: f64) -> Self {
        let best = r.off.iter().copied().fold(f64::INFINITY, f64::min);
        let share: Vec<f64> = r.off.iter().map(|off| ((best - off) / reach).exp()).collect();
        let sum: f64 = share.iter().sum();
        let wanted = share.into_iter().map(|x| x / sum).collect();
        let features = r.features.iter().map(Vec::as_slice).collect();
        Self { weight: r.weight, features, wanted, alone: false }
    }

    fn labelled(e: &'a LabelledExample) -> Self {
        let wanted = vec![f64::from(e.is_one)];
        Self { weight: e.weight, features: vec![&e.features], wanted, alone: true }
    }

    /// Whether it has a right and a wrong answer.
    fn has_both_kinds(&self) -> bool {
        self.alone || self.wanted.len() > 1
    }
}

fn train(tasks: Vec<Task>, p: &TrainParams) -> Result<Network, TrainError> {
    check(&tasks, p)?;
    let tasks: Vec<Task> = tasks.into_iter().filter(Task::has_both_kinds).collect();
    let Some(width) = tasks.first().and_then(|t| t.features.first()).map(|f| f.len()) else {
        return Err(TrainError::NothingToLearn);
    };
    let (mean, deviation) = spread(&tasks, width);
    let scaled: Vec<Vec<Vec<f64>>> = tasks
        .iter()
        .map(|t| {
            let scale = |f: &&[f64]| {
                let x = f.iter().zip(mean.iter().zip(&deviation));
                x.map(|(x, (m, d))| ((x - m) / d).clamp(-CLIP, CLIP)).collect()
            };
            t.features.iter().map(scale).collect()
        })
        .collect();
    let mut net = Weights::new(width, p);
    let mut moments = vec![[0.0; 2]; net.values.len()];
    for step in 1..=p.steps {
        let mut slope = net.ridge_slope(p.ridge);
        for (task, features) in tasks.iter().zip(&scaled) {
            net.add_slope(task, features, &mut slope);
        }
        // Steps shrink over the last third.
        let left = (3.0 * (p.steps - step + 1) as f64 / p.steps as f64).min(1.0);
        let fade = |decay: f64| 1.0 - decay.powi(step.min(100_000) as i32);
        for ((weight, moment), slope) in net.values.iter_mut().zip(&mut moments).zip(&slope) {
            moment[0] += (1.0 - ADAM[0]) * (slope - moment[0]);
            moment[1] += (1.0 - ADAM[1]) * (slope * slope - moment[1]);
            let size = (moment[1] / fade(ADAM[1])).sqrt() + ADAM[2];
            *weight -= p.rate * left * moment[0] / fade(ADAM[0]) / size;
        }
    }
    Ok(net.into_network(mean, deviation))
}

fn check(tasks: &[Task], p: &TrainParams) -> Result<(), TrainError> {
    let within = |name, sound: bool| if sound { Ok(()) } else { Err(TrainError::Range(name)) };
    within("hidden", p.hidden <= MAX_HIDDEN)?;
    within("steps", (1..=MAX_STEPS).contains(&p.steps))?;
    within("rate", p.rate > 0.0 && p.rate.is_finite())?;
    within("ridge", p.ridge >= 0.0 && p.ridge.is_finite())?;
    let width = tasks.iter().flat_map(|t| &t.features).map(|f| f.len()).next().unwrap_or(0);
    for (i, t) in tasks.iter().enumerate() {
        let sound = t.features.len() == t.wanted.len()
            && t.weight > 0.0
            && t.weight.is_finite()
            && t.wanted.iter().all(|w| w.is_finite())
            && t.features.iter().all(|f| f.len() == width && f.iter().all(|x| x.is_finite()));
        if !sound {
            return Err(TrainError::Malformed(i));
        }
    }
    if tasks.iter().any(Task::has_both_kinds) { Ok(()) } else { Err(TrainError::NothingToLearn) }
}

/// Mean and standard deviation of every measurement over all candidates.
fn spread(tasks: &[Task], width: usize) -> (Vec<f64>, Vec<f64>) {
    let all: Vec<&[f64]> = tasks.iter().flat_map(|t| t.features.iter().copied()).collect();
    let n = all.len().max(1) as f64;
    let mean: Vec<f64> = (0..width).map(|i| all.iter().map(|f| f[i]).sum::<f64>() / n).collect();
    let deviation = |i: usize| {
        let d = (all.iter().map(|f| (f[i] - mean[i]).powi(2)).sum::<f64>() / n).sqrt();
        if d < MIN_DEVIATION { 1.0 } else { d }
    };
    let deviation = (0..width).map(deviation).collect();
    (mean, deviation)
}

/// All weights in one list: linear, then of every hidden unit its row, bias and output, then the
/// bias.
struct Weights {
    width: usize,
    hidden: usize,
    values: Vec<f64>,
}

impl Weights {
    fn new(width: usize, p: &TrainParams) -> Self {
        let mut random = Random::new(p.seed);
        let mut values = vec![0.0; width];
        for _ in 0..p.hidden {
            let scale = FIRST[0] / (width.max(1) as f64).sqrt();
            values.extend((0..width).map(|_| scale * random.normal()));
            values.extend([0.0, FIRST[1] * random.normal()]);
        }
        values.push(0.0);
        Self { width, hidden: p.hidden, values }
    }

    /// Index of the first weight of a hidden unit's row.
    fn unit(&self, k: usize) -> usize {
        self.width + k * (self.width + 2)
    }

    /// Output of the hidden units.
    fn activity(&self, x: &[f64]) -> Vec<f64> {
        let unit = |k: usize| {
            let row = &self.values[self.unit(k)..][..=self.width];
            (row[self.width] + dot(row, x)).tanh()
        };
        (0..self.hidden).map(unit).collect()
    }

    fn output(&self, x: &[f64], activity: &[f64]) -> f64 {
        let out = |k: usize| self.values[self.unit(k) + self.width + 1];
        let hidden: f64 = activity.iter().enumerate().map(|(k, a)| out(k) * a).sum();
        self.values[self.values.len() - 1] + dot(&self.values[..self.width], x) + hidden
    }

    /// Slope of the ridge: none for biases.
    fn ridge_slope(&self, ridge: f64) -> Vec<f64> {
        let mut slope: Vec<f64> = self.values.iter().map(|w| ridge * w).collect();
        (0..self.hidden).for_each(|k| slope[self.unit(k) + self.width] = 0.0);
        slope[self.values.len() - 1] = 0.0;
        slope
    }

    /// Adds the slope of a task's loss.
    fn add_slope(&self, task: &Task, features: &[Vec<f64>], slope: &mut [f64]) {
        let activities: Vec<Vec<f64>> = features.iter().map(|x| self.activity(x)).collect();
        let outputs: Vec<f64> = features.iter().zip(&activities).map(|(x, a)| self.output(x, a)).collect();
        let top = outputs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = outputs.iter().map(|o| (o - top).exp()).sum();
        for (i, x) in features.iter().enumerate() {
            let chance =
                if task.alone { 1.0 / (1.0 + (-outputs[i]).exp()) } else { (outputs[i] - top).exp() / sum };
            let error = task.weight * (chance - task.wanted[i]);
            add(&mut slope[..self.width], error, x);
            for (k, activity) in activities[i].iter().enumerate() {
                let at = self.unit(k);
                let inner = error * self.values[at + self.width + 1] * (1.0 - activity * activity);
                add(&mut slope[at..at + self.width], inner, x);
                slope[at + self.width] += inner;
                slope[at + self.width + 1] += error * activity;
            }
            slope[self.values.len() - 1] += error;
        }
    }

    fn into_network(self, mean: Vec<f64>, deviation: Vec<f64>) -> Network {
        let row = |k: usize| &self.values[self.unit(k)..][..self.width + 2];
        let units = || (0..self.hidden).map(row);
        Network {
            features: FeatureDigest::OF_THIS_PROGRAM,
            mean,
            deviation,
            linear: self.values[..self.width].to_vec(),
            hidden_in: units().flat_map(|u| u[..self.width].to_vec()).collect(),
            hidden_bias: units().map(|u| u[self.width]).collect(),
            hidden_out: units().map(|u| u[self.width + 1]).collect(),
            bias: self.values[self.values.len() - 1],
        }
    }
}

/// Over the shorter of both.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add(to: &mut [f64], factor: f64, x: &[f64]) {
    to.iter_mut().zip(x).for_each(|(t, x)| *t += factor * x);
}

#[cfg(test)]
mod tests;
