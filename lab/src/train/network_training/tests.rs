use super::*;

fn quick() -> TrainParams {
    TrainParams { hidden: 6, steps: 600, ridge: 0.1, reach: 0.05, ..TrainParams::default() }
}

/// Of six candidates the one nearest to the middle is right, which no linear model can express.
fn rivals(count: usize, seed: u64) -> Vec<ChoiceExample> {
    let mut random = Random::new(seed);
    (0..count)
        .map(|group| {
            let features: Vec<Vec<f64>> =
                (0..6).map(|_| vec![random.range(-2.0, 2.0), random.range(-2.0, 2.0)]).collect();
            let off = features.iter().map(|f| f[0].hypot(f[1])).collect();
            ChoiceExample { group, weight: 1.0, features, off }
        })
        .collect()
}

fn examples(count: usize, seed: u64, turned: impl Fn(usize) -> bool) -> Vec<LabelledExample> {
    let mut random = Random::new(seed);
    (0..count)
        .map(|group| {
            let features = vec![random.range(-1.0, 1.0), random.range(-1.0, 1.0)];
            let is_one = (features[0] > 0.2) != turned(group);
            LabelledExample { group, weight: 1.0, features, is_one }
        })
        .collect()
}

fn chosen(net: &Network, r: &ChoiceExample) -> bool {
    let best = |v: Vec<f64>| (0..v.len()).reduce(|a, b| if v[b] > v[a] { b } else { a });
    best(r.features.iter().map(|f| net.output(f)).collect()) == best(r.off.iter().map(|x| -x).collect())
}

fn right_share(net: &Network, examples: &[LabelledExample]) -> f64 {
    examples.iter().filter(|e| (net.output(&e.features) > 0.0) == e.is_one).count() as f64
        / examples.len() as f64
}

#[test]
fn hidden_units_learn_what_a_linear_model_cannot() {
    let (train_set, new) = (rivals(300, 1), rivals(200, 2));
    let share = |hidden| {
        let net = train_choice(&train_set, &TrainParams { hidden, ..quick() }).unwrap();
        assert_eq!(net.check(2), Ok(()));
        new.iter().filter(|r| chosen(&net, r)).count()
    };
    assert!(share(0) < 80, "{}", share(0));
    assert!(share(6) > 150, "{}", share(6));
}

#[test]
fn slopes_are_those_of_the_loss() {
    let data = rivals(3, 7);
    let one = LabelledExample { group: 0, weight: 1.0, features: vec![0.3, -0.8], is_one: true };
    let tasks = [Task::choice(&data[0], 1.0), Task::labelled(&one)];
    let mut net = Weights::new(2, &TrainParams { hidden: 3, ..quick() });
    let loss = |net: &Weights, t: &Task| {
        let outputs: Vec<f64> = t.features.iter().map(|x| net.output(x, &net.activity(x))).collect();
        if t.alone {
            return (1.0 + (-outputs[0]).exp()).ln();
        }
        let sum: f64 = outputs.iter().map(|o| o.exp()).sum();
        t.wanted.iter().zip(&outputs).map(|(w, o)| w * (sum.ln() - o)).sum()
    };
    for task in &tasks {
        let features: Vec<Vec<f64>> = task.features.iter().map(|f| f.to_vec()).collect();
        let mut slope = vec![0.0; net.values.len()];
        net.add_slope(task, &features, &mut slope);
        for (i, slope) in slope.iter().enumerate() {
            let value = net.values[i];
            let mut at = |x: f64| {
                net.values[i] = x;
                loss(&net, task)
            };
            let difference = (at(value + 1e-5) - at(value - 1e-5)) / 2e-5;
            net.values[i] = value;
            assert!((difference - slope).abs() < 1e-6, "{i}: {difference} {slope}");
        }
    }
}

#[test]
fn the_network_computes_the_trained_function() {
    let net = Weights::new(3, &TrainParams { hidden: 4, ..quick() });
    let x = [0.5, -1.5, 3.0];
    let wanted = net.output(&x, &net.activity(&x));
    let network = net.into_network(vec![0.0; 3], vec![1.0; 3]);
    assert!((network.output(&x) - wanted).abs() < 1e-12);
}

#[test]
fn odds_are_learnt_and_repeat() {
    let data = examples(300, 3, |_| false);
    let net = train_classifier(&data, &quick()).unwrap();
    assert!(right_share(&net, &examples(300, 4, |_| false)) > 0.95);
    assert_eq!(net, train_classifier(&data, &quick()).unwrap());
    assert_ne!(net, train_classifier(&data, &TrainParams { seed: 2, ..quick() }).unwrap());
}

#[test]
fn a_farther_candidate_is_less_probable() {
    let r = |off: &[f64]| ChoiceExample {
        group: 0,
        weight: 1.0,
        features: vec![vec![0.0]; off.len()],
        off: off.into(),
    };
    let data = r(&[3.0, 1.0, 2.0]);
    let wanted = Task::choice(&data, 1.0).wanted;
    let e = std::f64::consts::E;
    assert!((wanted[1] / wanted[2] - e).abs() < 1e-12 && (wanted[1] / wanted[0] - e * e).abs() < 1e-12);
    assert!((wanted.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    assert_eq!(train_choice(&[r(&[1.0])], &quick()), Err(TrainError::NothingToLearn));
}

#[test]
fn a_weight_of_two_counts_twice() {
    let mut data = examples(40, 8, |_| false);
    let doubled: Vec<LabelledExample> = data.iter().chain(&data[..10]).cloned().collect();
    data[..10].iter_mut().for_each(|e| e.weight = 2.0);
    let p = TrainParams { hidden: 0, ..quick() };
    let scale = |n: &Network| [n.linear[0] / n.deviation[0], n.linear[1] / n.deviation[1]];
    let (a, b) =
        (scale(&train_classifier(&data, &p).unwrap()), scale(&train_classifier(&doubled, &p).unwrap()));
    // Only the scaling of the measurements, and with it the ridge, differs a little.
    assert!((a[0] - b[0]).abs() < 0.05 * a[0].abs(), "{a:?} {b:?}");
}

#[test]
fn invalid_examples_and_parameters_are_refused() {
    let good = examples(10, 6, |_| false);
    let with = |p: TrainParams| train_classifier(&good, &p).unwrap_err();
    assert_eq!(with(TrainParams { hidden: MAX_HIDDEN + 1, ..quick() }), TrainError::Range("hidden"));
    assert_eq!(with(TrainParams { steps: MAX_STEPS + 1, ..quick() }), TrainError::Range("steps"));
    assert_eq!(with(TrainParams { rate: f64::NAN, ..quick() }), TrainError::Range("rate"));
    assert_eq!(with(TrainParams { ridge: -1.0, ..quick() }), TrainError::Range("ridge"));
    assert!(train_classifier(&good, &TrainParams { hidden: MAX_HIDDEN, steps: 1, ..quick() }).is_ok());
    let reach = TrainParams { reach: 0.0, ..quick() };
    assert_eq!(train_choice(&rivals(2, 1), &reach), Err(TrainError::Range("reach")));
    let mut bad = good.clone();
    bad[4].weight = 0.0;
    assert_eq!(train_classifier(&bad, &quick()), Err(TrainError::Malformed(4)));
    bad = good.clone();
    bad[3].features.push(1.0);
    assert_eq!(train_classifier(&bad, &quick()), Err(TrainError::Malformed(3)));
    bad = good.clone();
    bad[2].features[0] = f64::INFINITY;
    assert_eq!(train_classifier(&bad, &quick()), Err(TrainError::Malformed(2)));
    let mut torn = rivals(2, 1);
    torn[1].off.pop();
    assert_eq!(train_choice(&torn, &quick()), Err(TrainError::Malformed(1)));
    let ones: Vec<LabelledExample> = good.iter().filter(|e| e.is_one).cloned().collect();
    assert_eq!(train_classifier(&ones, &quick()), Err(TrainError::NothingToLearn));
}
