//! Errors that landmarks have in common against the dense covariance of all of them.

use super::*;
use crate::{
    check,
    joint::{
        datum::DriveFrame,
        shared_errors::{Placed, shared_errors},
    },
};

/// Parameters of a landmark that are of its place.
const OF_PLACE: [usize; 6] = [0, 1, 2, 3, 6, 7];

/// The covariance of all places, relative to the first pose or to the drive as a whole.
fn covariance(problem: &JointProblem, frame: Option<&DriveFrame>, landmarks: &[usize]) -> DMatrix<f64> {
    let variables: Vec<Variable> = landmarks.iter().map(|l| Variable::Landmark(*l)).collect();
    let all = Marginals::of(problem, &variables).unwrap().into_covariance();
    let one = DMatrix::identity(all.nrows(), all.nrows());
    let all = frame.map_or(all.clone(), |f| f.relative_product(&problem.state, &variables, &one, &all));
    let row = |i: usize| 8 * (i / 6) + OF_PLACE[i % 6];
    DMatrix::from_fn(6 * landmarks.len(), 6 * landmarks.len(), |r, c| all[(row(r), row(c))])
}

#[test]
fn six_errors_are_most_of_what_places_have_in_common_and_leave_covariances() {
    let made = solved(&Golden::read());
    let problem = &made.problem;
    let landmarks: Vec<usize> = (0..problem.state.landmarks.len()).collect();
    let frame = DriveFrame::of(problem).unwrap();
    for frame in [None, Some(&frame)] {
        let all = covariance(problem, frame, &landmarks);
        let sigma_m = |l: usize| (0.5 * all.view((6 * l, 6 * l), (2, 2)).trace()).sqrt();
        let placed: Vec<Placed> = landmarks.iter().map(|l| (*l, sigma_m(*l))).collect();
        let by = shared_errors(problem, frame, &placed, &OF_PLACE).unwrap().unwrap();
        let by = DMatrix::from_fn(all.nrows(), 6, |r, c| by[r / 6][(r % 6, c)]);
        let left = &all - &by * by.transpose();
        let scale = DMatrix::from_diagonal(&all.diagonal().map(|v| 1.0 / v.sqrt()));
        let lowest = (&scale * &left * &scale).symmetric_eigenvalues().min();
        assert!(lowest > -1e-6, "{lowest}");
        let centres = |m: &DMatrix<f64>, between: bool| {
            let is_of = |r: usize, c: usize| r % 6 < 2 && c % 6 < 2 && (r / 6 != c / 6 || !between);
            DMatrix::from_fn(m.nrows(), m.nrows(), |r, c| if is_of(r, c) { m[(r, c)] } else { 0.0 }).norm()
        };
        let common = centres(&all, true);
        assert!(centres(&left, true) < 0.2 * common, "{} {common}", centres(&left, true));
        assert!(common > 0.1 * centres(&all, false), "{common} {}", centres(&all, false));
        // Two have no more errors than are taken to be in common.
        let few = shared_errors(problem, frame, &placed[..2], &OF_PLACE).unwrap().unwrap();
        for (i, by) in few.iter().enumerate() {
            let own = all.fixed_view::<6, 6>(6 * i, 6 * i) - by * by.transpose();
            assert_eq!(check::covariance("own", &own), Ok(()), "{own}");
        }
    }
    assert_eq!(shared_errors(problem, None, &[(0, 0.1)], &OF_PLACE).unwrap(), None);
}
