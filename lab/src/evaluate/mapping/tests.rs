use super::*;

fn records(truth: &[Pose2]) -> Vec<LogEntry> {
    let scan = map::laser::Scan::new(Pose2::default(), 0.0, 0.1, 9.0, vec![1.0]).unwrap();
    let one = |t: &Pose2| LogEntry { odom: *t, truth: Some(*t), time_s: None, scan: scan.clone() };
    truth.iter().map(one).collect()
}

#[test]
fn relations_are_neighbours_and_revisited_places() {
    // Out 12 m and back: scans 0 and 24 are at the same place.
    let out = (0..=12).map(|i| Pose2::new(f64::from(i), 0.0, 0.0));
    let back = (0..12).rev().map(|i| Pose2::new(f64::from(i), 0.5, std::f64::consts::PI));
    let truth: Vec<Pose2> = out.chain(back).collect();
    let records = records(&truth);
    let relations = Relations::of(&records);
    assert!(relations.len() > 24);
    // The coordinate frame of the path does not matter, only its shape.
    let moved: Vec<Pose2> = truth.iter().map(|t| Pose2::new(5.0, -3.0, 2.0).compose(t)).collect();
    assert!(relations.errors(&records, &moved).translation_m()[0] < 1e-9);
    let mut bent = truth.clone();
    for p in &mut bent[13..] {
        p.y_m += 1.0;
    }
    let [mean, std] = relations.errors(&records, &bent).translation_m();
    // One of 24 neighbours and every revisit is 1 m off.
    let off = (relations.len() - 24 + 1) as f64 / relations.len() as f64;
    assert!((mean - off).abs() < 1e-9 && (std - (off * (1.0 - off)).sqrt()).abs() < 1e-9, "{mean} {std}");
}

#[test]
fn made_odometry_is_the_truth_with_the_stated_noise() {
    let truth: Vec<Pose2> = (0..4000).map(|i| Pose2::new(0.5 * f64::from(i % 2000), 0.0, 0.0)).collect();
    let mut still = records(&truth[..2000]);
    odometry::make(&mut still, Noise::times(0.0), 1);
    assert!(still.iter().zip(&truth).all(|(r, t)| r.odom.minus(t).norm() < 1e-9));
    let mut noisy = records(&truth[..2000]);
    odometry::make(&mut noisy, Noise::times(1.0), 1);
    let turns: Vec<f64> = noisy.windows(2).map(|w| w[0].odom.between(&w[1].odom).theta_rad).collect();
    let [mean, std] = {
        let n = turns.len() as f64;
        let mean = turns.iter().sum::<f64>() / n;
        [mean, (turns.iter().map(|t| (t - mean).powi(2)).sum::<f64>() / n).sqrt()]
    };
    assert!((mean - 0.002).abs() < 0.001, "{mean}");
    assert!((std / (0.02 * 0.5_f64.sqrt()) - 1.0).abs() < 0.06, "{std}");
}

#[test]
fn published_figures_are_found_by_name() {
    assert_eq!(name(Path::new("x/intel-corrected.log.gz")), "intel");
    assert_eq!(name(Path::new("x/intel-scans.txt.gz")), "intel, raw odometry");
    assert_eq!(name(Path::new("my.jsonl")), "my");
}

#[test]
fn the_simulated_corridor_is_mapped_to_its_own_length() {
    let recording = simulated(3);
    let relations = Relations::of(&recording.records);
    let records = &recording.records;
    let built = build::build(records, |i| records[i].odom, map::slam::SlamParams::default()).unwrap();
    let [found, _] = relations.errors(records, &built.map.path).translation_m();
    let odometry: Vec<Pose2> = records.iter().map(|r| r.odom).collect();
    let [alone, _] = relations.errors(records, &odometry).translation_m();
    assert!(found < 0.5 * alone, "{found} {alone}");
}
