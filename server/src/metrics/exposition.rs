//! Families of metrics: help, type and series. In: values. Out: what the encoder makes of them.

use engine::histogram::Times;
use prometheus_client::{
    encoding::{DescriptorEncoder, EncodeCounterValue, EncodeGaugeValue, EncodeMetric, MetricEncoder},
    metrics::{MetricType, counter::ConstCounter, gauge::ConstGauge},
};

/// Labels of a series.
pub(super) type Labels<'a> = &'a [(&'a str, &'a str)];

/// A value of a counter or gauge.
pub(super) trait Number: EncodeCounterValue + EncodeGaugeValue {}
impl<T: EncodeCounterValue + EncodeGaugeValue> Number for T {}

/// Where families go. Writing to a `String` cannot fail.
#[derive(Debug)]
pub(super) struct Exposition<'a>(pub(super) DescriptorEncoder<'a>);

impl Exposition<'_> {
    /// A counter; `name` ends in `_total`.
    pub(super) fn counter(&mut self, name: &'static str, help: &str) -> Series<'_> {
        self.family(name.trim_end_matches("_total"), help, MetricType::Counter)
    }

    /// A gauge.
    pub(super) fn gauge(&mut self, name: &'static str, help: &str) -> Series<'_> {
        self.family(name, help, MetricType::Gauge)
    }

    /// A histogram; `name` ends in `_seconds`.
    pub(super) fn histogram(&mut self, name: &'static str, help: &str) -> Series<'_> {
        self.family(name, help, MetricType::Histogram)
    }

    fn family(&mut self, name: &'static str, help: &str, kind: MetricType) -> Series<'_> {
        let encoder = self.0.encode_descriptor(name, help, None, kind).ok();
        Series { encoder, kind }
    }
}

/// The series of one family.
#[derive(Debug)]
pub(super) struct Series<'a> {
    encoder: Option<MetricEncoder<'a>>,
    kind: MetricType,
}

impl Series<'_> {
    /// A value.
    pub(super) fn value(&mut self, labels: Labels<'_>, value: impl Number) -> &mut Self {
        match self.kind {
            MetricType::Counter => self.series(labels, &ConstCounter::new(value)),
            _ => self.series(labels, &ConstGauge::new(value)),
        }
    }

    /// A value, if there is one.
    pub(super) fn known(&mut self, labels: Labels<'_>, value: Option<impl Number>) -> &mut Self {
        match value {
            Some(value) => self.value(labels, value),
            None => self,
        }
    }

    /// The buckets of a histogram.
    pub(super) fn times(&mut self, labels: Labels<'_>, times: &Times) -> &mut Self {
        self.series(labels, &times.0)
    }

    fn series(&mut self, labels: Labels<'_>, metric: &impl EncodeMetric) -> &mut Self {
        if let Some(encoder) = &mut self.encoder {
            encoder.encode_family(&labels).and_then(|series| metric.encode(series)).ok();
        }
        self
    }
}
