//! Answers whose truth is known in, the weights of the confidence out: logistic regression with a
//! small ridge, in which no measure may raise the confidence of an answer by being worse.

use nalgebra::{SMatrix, SVector};
use vision::recognise::decision::{confidence::chance, measures::MEASURES};

/// Newton's steps; a few are enough, as the loss is convex.
const STEPS: usize = 50;
/// Longest step of a weight: with few wrong answers the first steps would diverge.
const LONGEST: f64 = 4.0;
/// Penalty of a weight's square, in answers. Keeps weights finite if right and wrong are separable.
const RIDGE: f64 = 0.05;
/// One for each measure, and the bias, the last.
pub(crate) const WEIGHTS: usize = MEASURES + 1;

/// One answer: its measures, and whether it was right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Answer {
    /// See [`vision::recognise::decision::measures::measures`].
    pub(crate) measures: [f64; MEASURES],
    /// The identity was right.
    pub(crate) is_right: bool,
}

/// Why there is no fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(crate) enum ConfidenceError {
    /// All answers are right, or all wrong.
    #[error("{right} of {answers} answers are right: there must be both")]
    OneClass { right: usize, answers: usize },
    /// A measure is not finite.
    #[error("answer {0} is malformed")]
    Malformed(usize),
}

/// Maximum-likelihood weights, rounded to four digits after the point, as they are written.
pub(crate) fn fit(answers: &[Answer]) -> Result<[f64; WEIGHTS], ConfidenceError> {
    if let Some(i) = answers.iter().position(|a| a.measures.iter().any(|m| !m.is_finite())) {
        return Err(ConfidenceError::Malformed(i));
    }
    let right = answers.iter().filter(|a| a.is_right).count();
    if right == 0 || right == answers.len() {
        return Err(ConfidenceError::OneClass { right, answers: answers.len() });
    }
    // Measures with a weight of the wrong sign get 0, and the others are fitted again.
    let mut free = [true; WEIGHTS];
    loop {
        let weights = newton(answers, free);
        let against = (0..MEASURES).filter(|i| free[*i] && weights[*i] > 0.0);
        match against.max_by(|a, b| weights[*a].total_cmp(&weights[*b])) {
            Some(worst) => free[worst] = false,
            None => return Ok(weights.map(|w| (w * 1e4).round() / 1e4 + 0.0)),
        }
    }
}

fn newton(answers: &[Answer], free: [bool; WEIGHTS]) -> [f64; WEIGHTS] {
    let mut weights = [0.0; WEIGHTS];
    for _ in 0..STEPS {
        let mut slope = SVector::<f64, WEIGHTS>::zeros();
        let mut curve = SMatrix::<f64, WEIGHTS, WEIGHTS>::zeros();
        for answer in answers {
            let x = SVector::<f64, WEIGHTS>::from_fn(|i, _| answer.measures.get(i).copied().unwrap_or(1.0));
            let p = chance(&weights, &answer.measures);
            slope += x * (p - f64::from(u8::from(answer.is_right)));
            curve += x * x.transpose() * (p * (1.0 - p));
        }
        for i in 0..WEIGHTS {
            slope[i] += RIDGE * weights[i];
            curve[(i, i)] += RIDGE;
            if !free[i] {
                slope[i] = 0.0;
                curve.row_mut(i).fill(0.0);
                curve.column_mut(i).fill(0.0);
                curve[(i, i)] = 1.0;
            }
        }
        let Some(step) = curve.cholesky().map(|c| c.solve(&slope)) else { break };
        for (weight, step) in weights.iter_mut().zip(step.iter()) {
            *weight -= step.clamp(-LONGEST, LONGEST);
        }
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use vision::random::Random;

    /// Answers whose chance of being right is a logistic curve of the first and third measure; the
    /// fifth has the wrong sign.
    fn answers(count: usize) -> (Vec<Answer>, [f64; WEIGHTS]) {
        let mut weights = [0.0; WEIGHTS];
        (weights[0], weights[2], weights[4], weights[MEASURES]) = (-5.0, -3.0, 1.0, 4.0);
        let mut random = Random::new(7);
        let one = |_| {
            let measures = std::array::from_fn(|i| if [0, 2, 4].contains(&i) { random.unit() } else { 0.0 });
            Answer { measures, is_right: random.unit() < chance(&weights, &measures) }
        };
        ((0..count).map(one).collect(), weights)
    }

    #[test]
    fn the_true_logistic_curve_is_recovered() {
        let (answers, truth) = answers(40_000);
        let found = fit(&answers).unwrap();
        assert!((found[0] - truth[0]).abs() < 0.3 && (found[2] - truth[2]).abs() < 0.3, "{found:?}");
        assert!(found[4].abs() < 1e-12, "a measure of the wrong sign has weight 0");
        assert!(
            (found[MEASURES] - truth[MEASURES] - 0.5).abs() < 0.3,
            "the mean goes into the bias: {found:?}"
        );
        // Calibrated: the mean confidence is the share right.
        let mean = answers.iter().map(|a| chance(&found, &a.measures)).sum::<f64>() / answers.len() as f64;
        let share = answers.iter().filter(|a| a.is_right).count() as f64 / answers.len() as f64;
        assert!((mean - share).abs() < 1e-3, "{mean} {share}");
    }

    #[test]
    fn answers_of_one_kind_are_refused() {
        let answer = |is_right, m| Answer { measures: [m; MEASURES], is_right };
        assert_eq!(fit(&[]), Err(ConfidenceError::OneClass { right: 0, answers: 0 }));
        assert_eq!(fit(&[answer(true, 0.5)]), Err(ConfidenceError::OneClass { right: 1, answers: 1 }));
        assert_eq!(fit(&[answer(true, 0.5), answer(false, f64::NAN)]), Err(ConfidenceError::Malformed(1)));
        // Separable: weights stay finite.
        let apart: Vec<Answer> = (0..100).map(|i| answer(i < 50, if i < 50 { 0.0 } else { 1.0 })).collect();
        assert!(fit(&apart).unwrap().iter().all(|w| w.is_finite() && w.abs() < 100.0));
    }
}
