//! The accept loop: bounded connections, a deadline for the head of a request and for the reading of an answer, a graceful
//! end. axum's own `serve` installs no timer, so hyper's deadline would not work there.

use super::authorise::Peer;
use crate::config::Limits;
use axum::{Router, extract::Request};
use hyper::{body::Incoming, server::conn::http1, service::service_fn};
use hyper_util::{
    rt::{TokioIo, TokioTimer},
    server::graceful::GracefulShutdown,
};
use std::{net::SocketAddr, sync::Arc, time::Duration};
use tokio::{
    net::TcpListener,
    sync::{Semaphore, watch},
};
use tokio_io_timeout::TimeoutStream;
use tower::ServiceExt as _;

/// Largest head of a request, in bytes.
const HEAD_MAX: usize = 32 << 10;
/// Time that open requests have to end when the server stops.
const STOP_GRACE: Duration = Duration::from_secs(5);
/// Pause after a failed accept: usually too many open files.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Serves until `stopping` is true.
pub(crate) async fn serve(
    listener: TcpListener,
    router: Router,
    limits: Limits,
    mut stopping: watch::Receiver<bool>,
) {
    let places = Arc::new(Semaphore::new(limits.connections));
    let graceful = GracefulShutdown::new();
    let mut builder = http1::Builder::new();
    builder
        .timer(TokioTimer::new())
        .header_read_timeout(Duration::from_secs(limits.header_timeout_s))
        .max_buf_size(HEAD_MAX);
    loop {
        let accepted = tokio::select! {
            _ = stopping.wait_for(|stop| *stop) => break,
            accepted = accept(&listener, &places) => accepted,
        };
        let Some((stream, peer, place)) = accepted else { continue };
        let mut stream = TimeoutStream::new(stream);
        // Runs only while there is something to write, and starts again with every part that is taken.
        stream.set_write_timeout(Some(Duration::from_secs(limits.write_timeout_s)));
        let stream = TokioIo::new(Box::pin(stream));
        let router = router.clone();
        let answer = service_fn(move |mut request: Request<Incoming>| {
            request.extensions_mut().insert(Peer(peer));
            router.clone().oneshot(request)
        });
        let connection = builder.serve_connection(stream, answer);
        let connection = graceful.watch(connection);
        tokio::spawn(async move {
            if let Err(error) = connection.await {
                tracing::debug!(%error, "connection");
            }
            drop(place);
        });
    }
    drop(listener);
    if tokio::time::timeout(STOP_GRACE, graceful.shutdown()).await.is_err() {
        tracing::warn!("some HTTP requests did not end in time");
    }
}

async fn accept(
    listener: &TcpListener,
    places: &Arc<Semaphore>,
) -> Option<(tokio::net::TcpStream, SocketAddr, tokio::sync::OwnedSemaphorePermit)> {
    // Place first: beyond the bound, connections wait in the system's queue and cost no memory here.
    let place = places.clone().acquire_owned().await.ok()?;
    match listener.accept().await {
        Ok((stream, peer)) => {
            // Answers are small and whole; waiting to fill a packet only delays them.
            drop(stream.set_nodelay(true));
            Some((stream, peer, place))
        }
        Err(error) => {
            tracing::warn!(%error, "accept");
            tokio::time::sleep(ACCEPT_PAUSE).await;
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::{
        body::Bytes,
        response::{Sse, sse::Event},
        routing::get,
    };
    use futures::{StreamExt, stream};
    use std::convert::Infallible;
    use tokio::{
        io::{AsyncReadExt, AsyncWriteExt},
        net::TcpStream,
        time::timeout,
    };

    /// Far more than the buffers of a connection take.
    const LARGE: usize = 64 << 20;
    const WRITE_TIMEOUT_S: u64 = 1;

    /// Serves one connection at a time.
    async fn served() -> (SocketAddr, watch::Sender<bool>) {
        let quiet = || async {
            let late = stream::once(tokio::time::sleep(Duration::from_secs(3 * WRITE_TIMEOUT_S)));
            let events =
                stream::iter([()]).chain(late).map(|()| Ok::<_, Infallible>(Event::default().data("here")));
            Sse::new(events)
        };
        let router = Router::new()
            .route("/large", get(|| async { Bytes::from(vec![0_u8; LARGE]) }))
            .route("/small", get(|| async { "small" }))
            .route("/quiet", get(quiet));
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let at = listener.local_addr().unwrap();
        let (stop, stopping) = watch::channel(false);
        let limits = Limits { connections: 1, write_timeout_s: WRITE_TIMEOUT_S, ..Limits::default() };
        tokio::spawn(serve(listener, router, limits, stopping));
        (at, stop)
    }

    async fn asked(at: SocketAddr, path: &str) -> TcpStream {
        let mut stream = TcpStream::connect(at).await.unwrap();
        let head = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
        stream.write_all(head.as_bytes()).await.unwrap();
        stream
    }

    #[tokio::test]
    async fn a_client_that_does_not_read_its_answer_is_cut_off() {
        let (at, _stop) = served().await;
        let mut unread = asked(at, "/large").await;
        let mut answer = String::new();
        let mut next = asked(at, "/small").await;
        let read = timeout(Duration::from_secs(10), next.read_to_string(&mut answer)).await;
        assert!(read.is_ok(), "the one connection is still held by a client that does not read");
        assert!(answer.ends_with("small"), "{answer}");
        let mut rest = Vec::new();
        drop(unread.read_to_end(&mut rest).await);
        assert!(rest.len() < LARGE, "all of it was sent");
    }

    #[tokio::test]
    async fn a_client_that_reads_slowly_and_a_quiet_stream_are_not() {
        let (at, _stop) = served().await;
        let mut slow = asked(at, "/large").await;
        let (mut piece, mut got) = (vec![0; LARGE / 16], 0);
        while let Ok(n @ 1..) = slow.read(&mut piece).await {
            let pieces = got / piece.len();
            got += n;
            if got / piece.len() > pieces {
                tokio::time::sleep(Duration::from_millis(WRITE_TIMEOUT_S * 1_000 / 4)).await;
            }
        }
        assert!(got > LARGE, "cut off after {got} bytes");
        let mut events = String::new();
        asked(at, "/quiet").await.read_to_string(&mut events).await.unwrap();
        assert_eq!(events.matches("data: here").count(), 2, "{events}");
    }
}
