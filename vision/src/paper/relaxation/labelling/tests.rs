use super::*;
use proptest::prelude::*;

fn label(item: usize, start: f64, bias: f64) -> Label {
    Label { item, start, bias }
}

/// Symmetric matching among `n` items with given scores, reciprocal +1 and sharing -1, as both
/// passes build it.
fn matching(n: usize, scores: &[(usize, usize, f64)]) -> Problem {
    let mut rows = vec![Vec::new(); n];
    for &(k, l, s) in scores {
        rows[k].push(label(l, s, 2.0 * (s - 0.6)));
        rows[l].push(label(k, s, 2.0 * (s - 0.6)));
    }
    let mut problem = Problem::new(&rows);
    let both = |p: &Problem, &(k, l, _): &(usize, usize, f64)| {
        [p.variable(k, l).unwrap(), p.variable(l, k).unwrap()]
    };
    for (a, m) in scores.iter().enumerate() {
        let [x, y] = both(&problem, m);
        problem.link(x, y, 1.0);
        for other in &scores[a + 1..] {
            if m.0 == other.0 || m.0 == other.1 || m.1 == other.0 || m.1 == other.1 {
                for (i, j) in [(x, 0), (x, 1), (y, 0), (y, 1)] {
                    let target = both(&problem, other)[j];
                    problem.link(i, target, -1.0);
                }
            }
        }
    }
    problem
}

/// Largest G over all ways to give each row one label, by counting through them.
fn best_by_enumeration(problem: &Problem) -> f64 {
    let rows: Vec<Vec<usize>> = (0..problem.rows()).map(|r| problem.row(r).collect()).collect();
    let total: usize = rows.iter().map(Vec::len).product();
    (0..total)
        .map(|mut code| {
            let mut x = vec![0.0; problem.start().len()];
            for row in &rows {
                x[row[code % row.len()]] = 1.0;
                code /= row.len();
            }
            problem.value(&x)
        })
        .fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn projection_of_known_vectors() {
    let mut v = [0.5, 0.5];
    project_to_simplex(&mut v);
    assert!((v[0] - 0.5).abs() < 1e-12);
    let mut v = [2.0, 0.0, 0.0];
    project_to_simplex(&mut v);
    assert!((v[0] - 1.0).abs() < 1e-12 && v[1].abs() < 1e-12);
    let mut v = [0.6, 0.8, -1.0];
    project_to_simplex(&mut v);
    assert!((v[0] - 0.4).abs() < 1e-12 && (v[1] - 0.6).abs() < 1e-12 && v[2].abs() < 1e-12);
}

#[test]
fn start_is_equation_one() {
    let problem = Problem::new(&[vec![label(1, 0.9, 0.0), label(2, 0.6, 0.0)], vec![]]);
    assert_eq!(problem.start().len(), 4);
    for (got, wanted) in problem.start().iter().zip([0.6, 0.4, 0.0, 1.0]) {
        assert!((got - wanted).abs() < 1e-12);
    }
}

#[test]
fn a_row_keeps_its_first_candidates_only() {
    let labels: Vec<_> = (0..MAX_ROW_CANDIDATES + 5).map(|i| label(i + 1, 0.7, 0.0)).collect();
    let problem = Problem::new(&[labels]);
    assert_eq!(problem.start().len(), MAX_ROW_CANDIDATES + 1);
    assert!(problem.variable(0, MAX_ROW_CANDIDATES).is_some());
    assert!(problem.variable(0, MAX_ROW_CANDIDATES + 1).is_none());
}

#[test]
fn two_clear_pairs_are_matched_and_the_odd_one_is_not() {
    let problem = matching(5, &[(0, 1, 0.9), (2, 3, 0.85), (1, 2, 0.7), (1, 4, 0.65), (3, 4, 0.62)]);
    let solution = relax(&problem, problem.start().to_vec(), &RelaxationParams::default());
    assert_eq!(mutual(&solution.chosen), vec![(0, 1), (2, 3)]);
    assert_eq!(solution.chosen[4], None);
}

#[test]
fn nothing_to_match_is_no_error() {
    let problem = Problem::new(&[]);
    let solution = relax(&problem, Vec::new(), &RelaxationParams::default());
    assert!(solution.chosen.is_empty());
    let alone = Problem::new(&[vec![], vec![]]);
    assert_eq!(relax(&alone, alone.start().to_vec(), &RelaxationParams::default()).chosen, vec![None, None]);
}

#[test]
fn rounding_reaches_the_exhaustive_maximum_from_most_starts() {
    let scenes: [&[(usize, usize, f64)]; 3] = [
        &[(0, 1, 0.9), (2, 3, 0.85), (1, 2, 0.7), (0, 3, 0.65)],
        &[(0, 1, 0.9), (1, 2, 0.75), (2, 3, 0.9), (4, 5, 0.7), (0, 5, 0.65)],
        &[(0, 2, 0.95), (1, 3, 0.95), (0, 3, 0.7), (1, 2, 0.7), (4, 5, 0.65)],
    ];
    let (mut reached, mut starts) = (0, 0);
    let mut seed = 1_u64;
    for scene in scenes {
        let problem = matching(6, scene);
        let best = best_by_enumeration(&problem);
        for _ in 0..100 {
            // Near the start of Eq. (1), as in use: a seeded disturbance projected back.
            let mut x: Vec<f64> = problem
                .start()
                .iter()
                .map(|s| {
                    seed =
                        seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    s + (seed >> 40) as f64 / f64::from(1 << 24) * 0.2 - 0.1
                })
                .collect();
            (0..problem.rows()).for_each(|r| project_to_simplex(&mut x[problem.row(r)]));
            let solution = relax(&problem, x, &RelaxationParams::default());
            assert!(solution.rounded_value <= best + 1e-9);
            starts += 1;
            reached += usize::from(solution.rounded_value > best - 1e-9);
        }
    }
    assert!(reached * 100 >= starts * 95, "{reached} of {starts}");
}

fn random_problem() -> impl Strategy<Value = (Problem, Vec<f64>)> {
    let rows = prop::collection::vec(prop::collection::vec((0.61..1.0_f64, -0.5..0.8_f64), 0..5), 2..7);
    (rows, prop::collection::vec((0..1000_usize, 0..1000_usize, -1.0..1.0_f64), 0..30)).prop_map(
        |(rows, links)| {
            let rows: Vec<Vec<Label>> = rows
                .iter()
                .map(|r| r.iter().enumerate().map(|(i, (s, b))| label(i, *s, *b)).collect())
                .collect();
            let mut problem = Problem::new(&rows);
            let n = problem.start().len();
            let mut done = std::collections::BTreeSet::new();
            for (a, b, w) in links {
                let (a, b) = ((a % n).min(b % n), (a % n).max(b % n));
                if done.insert((a, b)) {
                    problem.link(a, b, w);
                }
            }
            let start = problem.start().to_vec();
            (problem, start)
        },
    )
}

proptest! {
    #[test]
    fn gradient_agrees_with_differences((problem, x) in random_problem()) {
        let g = problem.gradient(&x);
        for i in 0..x.len() {
            let step = 1e-6;
            let (mut high, mut low) = (x.clone(), x.clone());
            high[i] += step;
            low[i] -= step;
            let slope = (problem.value(&high) - problem.value(&low)) / (2.0 * step);
            prop_assert!((slope - g[i]).abs() < 1e-6);
        }
    }

    #[test]
    fn the_value_never_falls((problem, x) in random_problem()) {
        let solution = relax(&problem, x, &RelaxationParams::default());
        prop_assert!(solution.history.windows(2).all(|w| w[1] >= w[0] - 1e-12));
        let best = best_by_enumeration(&problem);
        prop_assert!(solution.rounded_value <= best + 1e-9);
        // With Q zero inside a row, G is linear in every row: no inner point beats the best vertex.
        prop_assert!(solution.history.last().unwrap() <= &(best + 1e-9));
    }

    #[test]
    fn projection_is_nearest_by_bisection(v in prop::collection::vec(-3.0..3.0_f64, 1..8)) {
        // Oracle: the threshold t with sum max(v - t, 0) = 1, found by bisection.
        let (mut low, mut high) = (-5.0, 4.0);
        for _ in 0..100 {
            let t = f64::midpoint(low, high);
            let sum: f64 = v.iter().map(|x| (x - t).max(0.0)).sum();
            if sum > 1.0 { low = t } else { high = t }
        }
        let mut projected = v.clone();
        project_to_simplex(&mut projected);
        for (x, p) in v.iter().zip(&projected) {
            prop_assert!(((x - low).max(0.0) - p).abs() < 1e-9);
        }
    }
}
