use super::*;
use nalgebra::{DMatrix, DVector};
use vision::random::Random;

fn poses(n: usize, random: &mut Random) -> Vec<Pose2> {
    let mut at = Pose2::default();
    (0..n)
        .map(|_| {
            let here = at;
            at = at.compose(&Pose2::new(1.0, 0.1 * random.normal(), 0.4 + 0.1 * random.normal()));
            here
        })
        .collect()
}

/// A chain with a few chords; measurements off by `sigma`.
fn graph(truth: &[Pose2], sigma: f64, random: &mut Random) -> Vec<PoseConstraint> {
    let n = truth.len();
    let chords = (0..n).filter(|i| i % 5 == 0 && i + 8 < n).map(|i| (i, i + 8));
    let pairs = (1..n).map(|i| (i - 1, i)).chain(chords);
    let edge = |(from, to): (usize, usize)| {
        let e = Vector3::new(random.normal(), random.normal(), 0.3 * random.normal()) * sigma;
        let m = Matrix3::new(4.0, 0.5, 0.2, 0.5, 3.0, 0.1, 0.2, 0.1, 30.0) / sigma.max(0.01).powi(2);
        let measured = truth[from].between(&truth[to]).plus(&e);
        PoseConstraint { from, to, measured, information: m, doubt_chi2: None }
    };
    pairs.map(edge).collect()
}

#[test]
fn jacobians_are_the_finite_differences() {
    let (a, b) = (Pose2::new(1.0, -2.0, 0.7), Pose2::new(-0.4, 3.0, 2.9));
    let edge = PoseConstraint {
        from: 0,
        to: 1,
        measured: Pose2::new(0.3, 0.2, 0.1),
        information: Matrix3::identity(),
        doubt_chi2: None,
    };
    let (ja, jb) = jacobians(&a, &b);
    let h = 1e-6;
    for k in 0..3 {
        let mut d = Vector3::zeros();
        d[k] = h;
        let na = (error(&edge, &a.plus(&d), &b) - error(&edge, &a.plus(&-d), &b)) / (2.0 * h);
        let nb = (error(&edge, &a, &b.plus(&d)) - error(&edge, &a, &b.plus(&-d))) / (2.0 * h);
        assert!((na - ja.column(k)).norm() < 1e-8 && (nb - jb.column(k)).norm() < 1e-8);
    }
}

/// The same problem by dense Gauss-Newton with numeric derivatives. Gives poses and the inverse of
/// its matrix.
fn dense(poses: &[Pose2], edges: &[PoseConstraint]) -> (Vec<Pose2>, DMatrix<f64>) {
    let mut at = poses.to_vec();
    let n = 3 * (at.len() - 1);
    let whitened = |at: &[Pose2]| {
        let rows = edges.iter().flat_map(|e| {
            let l = e.information.cholesky().unwrap().l();
            let r = l.transpose() * error(e, &at[e.from], &at[e.to]);
            [r.x, r.y, r.z]
        });
        DVector::from_iterator(3 * edges.len(), rows)
    };
    let mut inverse = DMatrix::zeros(n, n);
    for _ in 0..30 {
        let r = whitened(&at);
        let mut j = DMatrix::zeros(r.len(), n);
        for k in 0..n {
            let mut moved = at.clone();
            let mut d = Vector3::zeros();
            d[k % 3] = 1e-6;
            moved[k / 3 + 1] = at[k / 3 + 1].plus(&d);
            let up = whitened(&moved);
            moved[k / 3 + 1] = at[k / 3 + 1].plus(&-d);
            j.set_column(k, &((up - whitened(&moved)) / 2e-6));
        }
        inverse = (j.transpose() * &j).try_inverse().unwrap();
        let step = &inverse * (j.transpose() * r) * -1.0;
        for k in 0..at.len() - 1 {
            at[k + 1] = at[k + 1].plus(&Vector3::new(step[3 * k], step[3 * k + 1], step[3 * k + 2]));
        }
    }
    (at, inverse)
}

#[test]
fn the_sparse_fit_is_the_dense_one() {
    let mut random = Random::new(3);
    let truth = poses(20, &mut random);
    let edges = graph(&truth, 0.05, &mut random);
    let start: Vec<Pose2> = truth
        .iter()
        .enumerate()
        .map(|(i, p)| if i == 0 { *p } else { p.plus(&Vector3::new(0.2, -0.1, 0.1 * random.normal())) })
        .collect();
    let mut found = start.clone();
    optimise(&mut found, &edges).unwrap();
    let (expected, inverse) = dense(&start, &edges);
    for (f, e) in found.iter().zip(&expected) {
        assert!(f.minus(e).norm() < 1e-5, "{f:?} {e:?}");
    }
    let all: Vec<usize> = (0..20).collect();
    for (i, c) in covariances(&found, &edges, &all).unwrap().iter().enumerate().skip(1) {
        let block = inverse.view((3 * i - 3, 3 * i - 3), (3, 3));
        assert!((c - block).norm() < 1e-4 * block.norm(), "{c} {block}");
    }
}

#[test]
fn the_covariance_is_that_of_many_draws() {
    let truth = poses(12, &mut Random::new(9));
    let (mut sum, draws) = (0.0, 300);
    for seed in 0..draws {
        let mut random = Random::new(100 + seed);
        let mut edges = graph(&truth, 0.02, &mut random);
        for e in &mut edges {
            e.information = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 1.0 / 0.09)) / 0.02_f64.powi(2);
        }
        let mut found = truth.clone();
        optimise(&mut found, &edges).unwrap();
        let c = covariances(&found, &edges, &[11]).unwrap()[0];
        let e = found[11].minus(&truth[11]);
        sum += e.dot(&c.cholesky().unwrap().solve(&e));
    }
    // 3 degrees of freedom; the mean of 300 has a standard deviation of 0.14.
    let mean = sum / draws as f64;
    assert!((2.5..3.5).contains(&mean), "{mean}");
}

#[test]
fn a_false_loop_loses_its_weight() {
    let mut random = Random::new(5);
    let truth = poses(30, &mut random);
    let mut edges = graph(&truth, 0.02, &mut random);
    for e in edges.iter_mut().filter(|e| e.to != e.from + 1) {
        e.doubt_chi2 = Some(5.0);
    }
    let wrong = PoseConstraint {
        from: 2,
        to: 27,
        measured: Pose2::new(0.5, 0.5, 0.0),
        information: Matrix3::identity() * 1e4,
        doubt_chi2: Some(5.0),
    };
    edges.push(wrong);
    let mut found = truth.clone();
    optimise(&mut found, &edges).unwrap();
    assert!(weight(&wrong, chi2(&wrong, &found)) < 0.01);
    edges.pop();
    let mut without = truth.clone();
    optimise(&mut without, &edges).unwrap();
    let worst = found.iter().zip(&without).map(|(f, t)| f.minus(t).xy().norm()).fold(0.0, f64::max);
    assert!(worst < 0.02, "{worst}");
}

#[test]
fn unsolvable_graphs_are_refused() {
    let edge = |from, to| PoseConstraint {
        from,
        to,
        measured: Pose2::default(),
        information: Matrix3::identity(),
        doubt_chi2: None,
    };
    let mut two = vec![Pose2::default(); 2];
    assert_eq!(optimise(&mut two, &[edge(0, 2)]), Err(GraphError::Constraint(0)));
    assert_eq!(optimise(&mut two, &[edge(0, 1), edge(1, 1)]), Err(GraphError::Constraint(1)));
    let nan = PoseConstraint { information: Matrix3::repeat(f64::NAN), ..edge(0, 1) };
    assert_eq!(optimise(&mut two, &[nan]), Err(GraphError::Constraint(0)));
    assert!(optimise(&mut [], &[]).is_ok());
    let mut many = vec![Pose2::default(); MAX_POSES + 1];
    assert_eq!(optimise(&mut many, &[]), Err(GraphError::TooLarge(MAX_POSES + 1, 0)));
}
