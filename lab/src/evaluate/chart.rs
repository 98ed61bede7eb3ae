//! Axes, curves and bars of the evaluations' plots, as SVG.

use std::fmt::Write as _;

pub(crate) const COLOURS: [&str; 6] = ["#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf"];
/// Size of a panel's axes and the distance from one panel to the next.
pub(crate) const PANEL: [f64; 2] = [300.0, 240.0];
pub(crate) const STEP: f64 = 400.0;
pub(crate) const LEFT: f64 = 60.0;
pub(crate) const TOP: f64 = 40.0;

/// One panel: its place and its two scales.
pub(crate) struct Panel {
    pub(crate) x0: f64,
    pub(crate) title: String,
    pub(crate) x_name: String,
    pub(crate) x: [f64; 2],
    pub(crate) log: bool,
    pub(crate) y: [f64; 2],
}

impl Panel {
    /// Panel `i` of a row, with shares (0 to 1) upwards.
    pub(crate) fn of_shares(i: usize, title: &str, x_name: &str, x: [f64; 2], log: bool) -> Self {
        let (title, x_name) = (title.to_owned(), x_name.to_owned());
        Self { x0: LEFT + STEP * i as f64, title, x_name, x, log, y: [0.0, 1.0] }
    }

    /// Position of a point, SVG px; clamped to the axes.
    pub(crate) fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let f = |x: f64| if self.log { x.max(1e-9).log10() } else { x };
        let share = ((f(x) - f(self.x[0])) / (f(self.x[1]) - f(self.x[0]))).clamp(0.0, 1.0);
        let up = ((y - self.y[0]) / (self.y[1] - self.y[0])).clamp(0.0, 1.0);
        (self.x0 + share * PANEL[0], TOP + (1.0 - up) * PANEL[1])
    }

    pub(crate) fn axes(&self, svg: &mut String, ticks: &[f64]) {
        let (right, bottom) = (self.x0 + PANEL[0], TOP + PANEL[1]);
        for i in 0..=5 {
            let y = self.y[0] + 0.2 * f64::from(i) * (self.y[1] - self.y[0]);
            let (_, v) = self.at(self.x[0], y);
            put(svg, &format!(r##"<path d="M{:.1} {v:.1}H{right:.1}" stroke="#ddd"/>"##, self.x0));
            text(svg, (self.x0 - 6.0, v + 4.0), "end", &format!("{y:.1}"));
        }
        for x in ticks {
            let (u, _) = self.at(*x, self.y[0]);
            put(svg, &format!(r##"<path d="M{u:.1} {TOP}V{bottom:.1}" stroke="#eee"/>"##));
            text(svg, (u, bottom + 16.0), "middle", &format!("{x}"));
        }
        put(
            svg,
            &format!(
                r##"<rect x="{:.1}" y="{TOP}" width="{}" height="{}" fill="none" stroke="#333"/>"##,
                self.x0, PANEL[0], PANEL[1]
            ),
        );
        text(svg, (self.x0 + 0.5 * PANEL[0], TOP - 12.0), "middle", &self.title);
        text(svg, (self.x0 + 0.5 * PANEL[0], bottom + 34.0), "middle", &self.x_name);
    }

    pub(crate) fn curve(&self, svg: &mut String, points: &[(f64, f64)], colour: &str) {
        let path: Vec<String> = points
            .iter()
            .map(|(x, y)| {
                let (u, v) = self.at(*x, *y);
                format!("{u:.1},{v:.1}")
            })
            .collect();
        put(
            svg,
            &format!(
                r#"<polyline points="{}" fill="none" stroke="{colour}" stroke-width="1.8"/>"#,
                path.join(" ")
            ),
        );
    }

    /// A vertical bar of an interval.
    pub(crate) fn interval(&self, svg: &mut String, x: f64, [low, high]: [f64; 2], colour: &str) {
        let ((u, low), (_, high)) = (self.at(x, low), self.at(x, high));
        put(
            svg,
            &format!(r#"<path d="M{u:.1} {low:.1}V{high:.1}" stroke="{colour}" stroke-opacity="0.5"/>"#),
        );
    }

    /// A filled bar of a histogram from `x[0]` to `x[1]`.
    pub(crate) fn bar(&self, svg: &mut String, x: [f64; 2], y: f64, colour: &str) {
        let ((left, top), (right, bottom)) = (self.at(x[0], y), self.at(x[1], self.y[0]));
        put(
            svg,
            &format!(
                r#"<rect x="{left:.1}" y="{top:.1}" width="{:.1}" height="{:.1}" fill="{colour}" fill-opacity="0.35"/>"#,
                (right - left).max(0.0),
                (bottom - top).max(0.0)
            ),
        );
    }

    /// A dashed line across at `y`.
    pub(crate) fn level(&self, svg: &mut String, y: f64) {
        let (_, v) = self.at(self.x[0], y);
        let right = self.x0 + PANEL[0];
        put(
            svg,
            &format!(
                r##"<path d="M{:.1} {v:.1}H{right:.1}" stroke="#333" stroke-dasharray="4 3"/>"##,
                self.x0
            ),
        );
    }
}

/// A picture of `panels` side by side and as many lines of words below, drawn by `draw`.
pub(crate) fn picture(panels: usize, words: &[(&str, String)], draw: impl FnOnce(&mut String)) -> String {
    let (width, height) = (panels as f64 * STEP, TOP + PANEL[1] + 60.0 + 18.0 * words.len() as f64);
    let mut svg = String::new();
    put(
        &mut svg,
        &format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12">"#
        ),
    );
    put(&mut svg, r#"<rect width="100%" height="100%" fill="white"/>"#);
    draw(&mut svg);
    for (i, (colour, words)) in words.iter().enumerate() {
        let y = TOP + PANEL[1] + 56.0 + 18.0 * i as f64;
        put(
            &mut svg,
            &format!(r#"<rect x="{LEFT}" y="{:.1}" width="24" height="4" fill="{colour}"/>"#, y - 6.0),
        );
        text(&mut svg, (LEFT + 32.0, y), "start", words);
    }
    put(&mut svg, "</svg>");
    svg
}

pub(crate) fn put(svg: &mut String, element: &str) {
    // Writing to a String cannot fail.
    writeln!(svg, "{element}").ok();
}

pub(crate) fn text(svg: &mut String, (x, y): (f64, f64), anchor: &str, words: &str) {
    let words = words.replace('&', "&amp;").replace('<', "&lt;");
    put(svg, &format!(r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{words}</text>"#));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_lie_between_the_axes() {
        let panel = Panel { y: [0.0, 2.0], ..Panel::of_shares(1, "a < b", "x", [0.0, 10.0], false) };
        assert_eq!(panel.at(5.0, 1.0), (LEFT + STEP + 150.0, TOP + 120.0));
        assert_eq!(panel.at(99.0, f64::INFINITY), (LEFT + STEP + 300.0, TOP));
        let svg = picture(2, &[("red", "one & two".into())], |svg| {
            panel.axes(svg, &[0.0, 5.0]);
            panel.bar(svg, [0.0, 2.0], 1.0, "blue");
        });
        assert!(
            svg.contains("a &lt; b") && svg.contains("one &amp; two") && svg.trim_end().ends_with("</svg>")
        );
        assert!(svg.contains(r#"width="60.0" height="120.0" fill="blue""#), "{svg}");
    }
}
