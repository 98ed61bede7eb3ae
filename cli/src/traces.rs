//! Traces of requests and frames for a collector of OpenTelemetry, by OTLP over HTTP. Off unless
//! the standard variables name an endpoint. In: the spans of the server. Out: batches, sent by a
//! thread of their own; what does not fit into its queue is dropped.

use crate::failure::{Class, Failure};
use opentelemetry::trace::TracerProvider as _;
use opentelemetry_otlp::SpanExporter;
use opentelemetry_sdk::{
    Resource,
    trace::{SdkTracer, SdkTracerProvider},
};
use std::time::Duration;
use tracing::{Level, Subscriber, level_filters::LevelFilter};
use tracing_opentelemetry::OpenTelemetryLayer;
use tracing_subscriber::{Layer, filter::Targets, registry::LookupSpan};

/// Either switches traces on; the first goes before. Those for protocol, headers, time, sampling
/// and service are read, too.
const ENDPOINTS: [&str; 2] = ["OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT"];
/// The protocols that are spoken; the rest of the standard is gRPC and JSON.
const PROTOCOLS: [&str; 2] = ["OTEL_EXPORTER_OTLP_TRACES_PROTOCOL", "OTEL_EXPORTER_OTLP_PROTOCOL"];
const PROTOCOL: &str = "http/protobuf";
/// Time for what is not yet sent at the end of the program.
const LAST: Duration = Duration::from_secs(3);

/// Sends spans until it is dropped; then the rest.
#[derive(Debug)]
pub(crate) struct Traces {
    provider: SdkTracerProvider,
}

impl Traces {
    /// As the variables say; `None` where none names an endpoint.
    pub(crate) fn from_environment() -> Result<Option<Self>, Failure> {
        let text = |name: &&str| std::env::var(name).ok().filter(|text| !text.is_empty());
        let Some(endpoint) = ENDPOINTS.iter().find_map(text) else { return Ok(None) };
        if let Some(protocol) = PROTOCOLS.iter().find_map(text)
            && protocol != PROTOCOL
        {
            let sentence = format!("traces cannot be sent by `{protocol}`");
            let advice = format!(
                "Set OTEL_EXPORTER_OTLP_PROTOCOL={PROTOCOL}, and the port of the collector for it (4318)."
            );
            return Err(Failure::new(Class::Usage, "traces", sentence).advise(advice));
        }
        // Here for collectors behind https.
        drop(rustls::crypto::ring::default_provider().install_default());
        let exporter = SpanExporter::builder().with_http().build().map_err(|error| {
            let sentence = format!("traces cannot be sent to {endpoint}: {error}");
            Failure::new(Class::Usage, "traces", sentence).advise(
                "Give an address such as OTEL_EXPORTER_OTLP_ENDPOINT=http://127.0.0.1:4318, or unset it.",
            )
        })?;
        Ok(Some(Self::by(exporter)))
    }

    fn by(exporter: SpanExporter) -> Self {
        // A name of the operator's, by OTEL_SERVICE_NAME, goes before.
        let named = std::env::var_os("OTEL_SERVICE_NAME").is_some();
        let resource = Resource::builder();
        let resource = if named { resource } else { resource.with_service_name("waymark") };
        let provider = SdkTracerProvider::builder()
            .with_batch_exporter(exporter)
            .with_resource(resource.build())
            .build();
        Self { provider }
    }

    /// What takes the spans of the server's own crates, with what is logged in them.
    pub(crate) fn layer<S>(&self) -> impl Layer<S> + use<S>
    where
        S: Subscriber + for<'a> LookupSpan<'a>,
    {
        let tracer: SdkTracer = self.provider.tracer("waymark");
        let ours = Targets::new()
            .with_default(LevelFilter::OFF)
            .with_target("cli", Level::INFO)
            .with_target("engine", Level::TRACE)
            .with_target("server", Level::DEBUG);
        OpenTelemetryLayer::new(tracer).with_location(false).with_threads(false).with_filter(ours)
    }
}

impl Drop for Traces {
    fn drop(&mut self) {
        if let Err(error) = self.provider.shutdown_with_timeout(LAST) {
            tracing::warn!(%error, "traces_not_sent");
        }
    }
}
