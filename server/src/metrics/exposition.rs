//! The text of metrics: families with help, type and series. In: values. Out: the text format of Prometheus, or that of
//! `OpenMetrics` 1.0 for who asks for it.

use engine::histogram::{BOUNDS_S, HistogramCopy};
use std::fmt::{Display, Write as _};

/// How the text is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    /// Prometheus 0.0.4.
    Prometheus,
    /// `OpenMetrics` 1.0: counters are named without `_total` in their heads, and the end is marked.
    OpenMetrics,
}

impl Format {
    /// What a scraper asks for by `Accept`.
    pub(crate) fn of(accept: Option<&str>) -> Self {
        let is_asked = accept.is_some_and(|accept| accept.contains("application/openmetrics-text"));
        if is_asked { Self::OpenMetrics } else { Self::Prometheus }
    }

    /// The media type.
    pub(crate) fn content_type(self) -> &'static str {
        match self {
            Self::Prometheus => "text/plain; version=0.0.4; charset=utf-8",
            Self::OpenMetrics => "application/openmetrics-text; version=1.0.0; charset=utf-8",
        }
    }
}

/// What a family is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Counter,
    Gauge,
    Histogram,
}

/// Labels of a series.
pub(crate) type Labels<'a> = &'a [(&'a str, &'a str)];

/// The text so far. Writing to a `String` cannot fail.
#[derive(Debug)]
pub(crate) struct Exposition {
    format: Format,
    text: String,
}

impl Exposition {
    pub(crate) fn new(format: Format) -> Self {
        Self { format, text: String::new() }
    }

    /// A counter; `name` ends in `_total`.
    pub(crate) fn counter(&mut self, name: &str, help: &str) -> Series<'_> {
        self.family(name, help, Kind::Counter)
    }

    /// A gauge.
    pub(crate) fn gauge(&mut self, name: &str, help: &str) -> Series<'_> {
        self.family(name, help, Kind::Gauge)
    }

    /// A histogram; `name` ends in `_seconds`.
    pub(crate) fn histogram(&mut self, name: &str, help: &str) -> Series<'_> {
        self.family(name, help, Kind::Histogram)
    }

    fn family(&mut self, name: &str, help: &str, kind: Kind) -> Series<'_> {
        let head = match (self.format, kind) {
            (Format::OpenMetrics, Kind::Counter) => name.strip_suffix("_total").unwrap_or(name),
            _ => name,
        };
        let word = match kind {
            Kind::Counter => "counter",
            Kind::Gauge => "gauge",
            Kind::Histogram => "histogram",
        };
        write!(self.text, "# HELP {head} {help}\n# TYPE {head} {word}\n").ok();
        Series { name: name.to_owned(), text: &mut self.text }
    }

    /// The whole.
    pub(crate) fn finish(mut self) -> String {
        if self.format == Format::OpenMetrics {
            self.text.push_str("# EOF\n");
        }
        self.text
    }
}

/// The series of one family.
#[derive(Debug)]
pub(crate) struct Series<'a> {
    name: String,
    text: &'a mut String,
}

impl Series<'_> {
    /// A value.
    pub(crate) fn value(&mut self, labels: Labels<'_>, value: impl Display) -> &mut Self {
        self.sample("", labels, None, value)
    }

    /// A value, if there is one.
    pub(crate) fn known(&mut self, labels: Labels<'_>, value: Option<impl Display>) -> &mut Self {
        if let Some(value) = value {
            self.value(labels, value);
        }
        self
    }

    /// The buckets of a histogram.
    pub(crate) fn times(&mut self, labels: Labels<'_>, times: &HistogramCopy) -> &mut Self {
        for (bound, count) in BOUNDS_S.iter().zip(times.cumulative) {
            self.sample("_bucket", labels, Some(&bound.to_string()), count);
        }
        self.sample("_bucket", labels, Some("+Inf"), times.count);
        self.sample("_sum", labels, None, times.sum_s).sample("_count", labels, None, times.count)
    }

    fn sample(
        &mut self,
        suffix: &str,
        labels: Labels<'_>,
        bound: Option<&str>,
        value: impl Display,
    ) -> &mut Self {
        write!(self.text, "{}{suffix}", self.name).ok();
        let mut sign = '{';
        for (label, text) in labels.iter().copied().chain(bound.map(|bound| ("le", bound))) {
            write!(self.text, "{sign}{label}=\"{}\"", escaped(text)).ok();
            sign = ',';
        }
        let end = if sign == ',' { "}" } else { "" };
        writeln!(self.text, "{end} {value}").ok();
        self
    }
}

fn escaped(text: &str) -> String {
    text.replace('\\', r"\\").replace('"', "\\\"").replace('\n', r"\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::histogram::Histogram;
    use std::time::Duration;

    fn written(format: Format) -> String {
        let mut all = Exposition::new(format);
        all.counter("a_total", "Help.").value(&[("k", "a\"b\\c\nd")], 3);
        all.gauge("b_bytes", "Help.").known(&[], None::<u64>).known(&[], Some(0.5));
        let histogram = Histogram::default();
        histogram.add(Duration::from_millis(30));
        all.histogram("c_seconds", "Help.").times(&[("s", "x")], &histogram.copy());
        all.finish()
    }

    #[test]
    fn each_format_has_its_heads_and_end() {
        let plain = written(Format::of(Some("text/plain;version=0.0.4")));
        let begins = "# HELP a_total Help.\n# TYPE a_total counter\na_total{k=\"a\\\"b\\\\c\\nd\"} 3\n# HELP b_bytes Help.\n\
                      # TYPE b_bytes gauge\nb_bytes 0.5\n";
        assert!(plain.starts_with(begins), "{plain}");
        assert!(
            plain.contains(
                "c_seconds_bucket{s=\"x\",le=\"0.025\"} 0\nc_seconds_bucket{s=\"x\",le=\"0.05\"} 1\n"
            )
        );
        assert!(
            plain.ends_with("le=\"+Inf\"} 1\nc_seconds_sum{s=\"x\"} 0.03\nc_seconds_count{s=\"x\"} 1\n"),
            "{plain}"
        );
        let open =
            written(Format::of(Some("application/openmetrics-text;version=1.0.0;q=0.5,text/plain;q=0.2")));
        let heads = |text: &str| text.replace("HELP a_total", "HELP a").replace("TYPE a_total", "TYPE a");
        assert_eq!(open, heads(&plain) + "# EOF\n");
        assert_eq!(Format::of(None), Format::Prometheus);
    }
}
