//! Files of reference trajectories: where a robot really was, by its own clock. In: text. Out: (ns,
//! x, y, theta) rows.

use anyhow::{Context as _, bail};

/// Poses of a file: metres, radians, nanoseconds.
pub(super) fn poses(text: &str) -> anyhow::Result<Vec<(i64, f64, f64, f64)>> {
    let lines =
        text.lines().enumerate().map(|(n, line)| (n + 1, line.split('#').next().unwrap_or_default().trim()));
    let mut poses = Vec::new();
    for (number, line) in lines.filter(|(_, line)| !line.is_empty()) {
        poses.push(pose(line).with_context(|| format!("line {number}"))?);
    }
    if poses.is_empty() {
        bail!("no poses in it");
    }
    Ok(poses)
}

fn pose(line: &str) -> anyhow::Result<(i64, f64, f64, f64)> {
    let mut words = line.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty());
    let at_ns = nanoseconds(words.next().unwrap_or_default())?;
    let numbers: Vec<f64> = words
        .map(|word| {
            word.parse::<f64>()
                .ok()
                .filter(|v| v.is_finite())
                .with_context(|| format!("`{word}` is no number"))
        })
        .collect::<Result<_, _>>()?;
    match numbers[..] {
        [x, y, theta] => Ok((at_ns, x, y, theta)),
        [x, y, _z, qx, qy, qz, qw] => {
            let theta = (2.0 * (qw * qz + qx * qy)).atan2(1.0 - 2.0 * (qy * qy + qz * qz));
            Ok((at_ns, x, y, theta))
        }
        _ => bail!("4 or 8 numbers a line, not {}", numbers.len() + 1),
    }
}

/// Seconds to nanoseconds without the rounding of a floating-point number.
fn nanoseconds(word: &str) -> anyhow::Result<i64> {
    let (whole, fraction) = word.split_once('.').unwrap_or((word, ""));
    let digits = fraction.bytes().all(|b| b.is_ascii_digit());
    let seconds: i64 = whole.parse().with_context(|| format!("`{word}` is no time in seconds"))?;
    let nanos = format!("{fraction:0<9}");
    let nanos: i64 =
        nanos.get(..9).filter(|_| digits).and_then(|n| n.parse().ok()).context("no time in seconds")?;
    let sign = if whole.starts_with('-') { -1 } else { 1 };
    seconds
        .checked_mul(1_000_000_000)
        .and_then(|s| s.checked_add(sign * nanos))
        .context("a time beyond all clocks")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_are_read_to_the_nanosecond() {
        let text = "# a path\n1700000000.123456789 1 2 0.5\n\n1700000000.2\t1.5,2.5,0,0,0,0.7071067811865476,0.7071067811865476 # turned\n-1.5 0 0 0\n";
        let read = poses(text).unwrap();
        assert_eq!(read[0], (1_700_000_000_123_456_789, 1.0, 2.0, 0.5));
        assert_eq!((read[1].0, read[1].1), (1_700_000_000_200_000_000, 1.5));
        assert!((read[1].3 - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert_eq!(read[2].0, -1_500_000_000);
    }

    #[test]
    fn what_is_wrong_is_named_by_its_line() {
        for (text, said) in [
            ("", "no poses"),
            ("1 2 3 4\n2 3 x 4\n", "line 2"),
            ("1 2 3\n", "line 1"),
            ("one 2 3 4\n", "seconds"),
            ("1.5e3 2 3 4\n", "seconds"),
            ("99999999999 2 3 4\n", "clocks"),
            ("1 nan 3 4\n", "`nan`"),
        ] {
            let error = format!("{:#}", poses(text).unwrap_err());
            assert!(error.contains(said), "{text:?}: {error}");
        }
    }
}
