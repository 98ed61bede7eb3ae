//! Claim: the demo runs without preparation: no landmark is named wrongly, and its robot is localised better than
//! by odometry alone.

use serde_json::Value;
use std::time::Duration;
use tests::command::waymark;

const LONGEST: Duration = Duration::from_mins(4);

fn number(summary: &Value, pointer: &str) -> f64 {
    summary.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} of {summary}"))
}

#[test]
fn a_robot_of_the_demo_is_localised() {
    let args = "demo --robots 1 --legs 1 --rate-hz 1 --seed 2 --json --http 127.0.0.1:0";
    let run = waymark(args.split(' '), LONGEST);
    assert_eq!(run.status, 0, "{run:?}");
    assert_eq!(run.stdout.lines().count(), 1, "results only: {run:?}");
    let summary = run.last_json();
    let of = |pointer| number(&summary, pointer);
    assert!(of("/frames") >= 30.0 && of("/answers") <= of("/frames"), "{summary}");
    assert!(of("/landmarks_active") >= 4.0, "{summary}");
    assert_eq!((&summary["false_matches"], &summary["false_guided"]), (&0.into(), &0.into()), "{summary}");
    assert!(of("/guided") >= 0.0, "{summary}");
    assert!(of("/recognitions") > 0.0 && of("/corrections") > 0.0, "{summary}");
    let (with, without) = (of("/position_error_m/median"), of("/odometry_error_m/median"));
    assert!(with < 0.2 && with < without, "{with} m with landmarks, {without} m without: {summary}");
}
