//! Connections of HTTP: a deadline for the handshake, for the head of a request and for the reading
//! of an answer, a graceful end. axum's own `serve` installs no timer, so hyper's deadline would
//! not work there.

use super::{
    encryption::{self, WireProtocol},
    peer::Peer,
};
use crate::{
    accepting::{Bounds, accept_each},
    config::Limits,
};
use axum::{Router, body::Body, extract::Request, response::Response};
use hyper::{body::Incoming, server::conn::http1, service::service_fn};
use hyper_util::{
    rt::{TokioIo, TokioTimer},
    server::graceful::{GracefulShutdown, Watcher},
};
use std::{convert::Infallible, io, net::SocketAddr, pin::Pin, time::Duration};
use tokio::{
    io::{AsyncRead, AsyncWrite},
    net::{TcpListener, TcpStream},
    sync::watch,
};
use tokio_io_timeout::TimeoutStream;
use tokio_rustls::TlsAcceptor;
use tower::ServiceExt as _;

/// Largest head of a request, in bytes.
const HEAD_MAX: usize = 32 << 10;
/// Time that open requests have to end when the server stops.
const STOP_GRACE: Duration = Duration::from_secs(5);
/// How connections are served.
#[derive(Clone)]
struct Serving<Answer> {
    http: http1::Builder,
    tls: Option<TlsAcceptor>,
    answer: Answer,
    /// For who speaks plain text from another machine where TLS is on.
    refusing: Router,
    header_timeout: Duration,
    write_timeout: Duration,
}

/// Serves until `stopping` is true: with `tls`, encrypted, and plain text to clients of this
/// machine alone.
pub(crate) async fn serve<Answering: Future<Output = Result<Response, Infallible>> + Send + 'static>(
    listener: TcpListener,
    answer: impl Fn(Request) -> Answering + Clone + Send + Sync + 'static,
    tls: Option<TlsAcceptor>,
    limits: Limits,
    stopping: watch::Receiver<bool>,
) {
    let graceful = GracefulShutdown::new();
    let header_timeout = Duration::from_secs(limits.header_timeout_s);
    let mut http = http1::Builder::new();
    http.header_read_timeout(header_timeout).max_buf_size(HEAD_MAX);
    let serving = Serving {
        http,
        tls,
        answer,
        refusing: encryption::refusing(),
        header_timeout,
        write_timeout: Duration::from_secs(limits.write_timeout_s),
    };
    let bounds = Bounds { all: limits.connections, of_address: limits.connections_per_address };
    accept_each(&listener, bounds, stopping, |stream, peer, place| {
        let (serving, watcher) = (serving.clone(), graceful.watcher());
        tokio::spawn(async move {
            if let Err(error) = serving.connection(stream, peer, watcher).await {
                tracing::debug!(error, "connection");
            }
            drop(place);
        });
    })
    .await;
    drop(listener);
    if tokio::time::timeout(STOP_GRACE, graceful.shutdown()).await.is_err() {
        tracing::warn!("some HTTP requests did not end in time");
    }
}

impl<Answering, Answer> Serving<Answer>
where
    Answering: Future<Output = Result<Response, Infallible>> + Send + 'static,
    Answer: Fn(Request) -> Answering + Clone + Send + Sync + 'static,
{
    /// Serves one connection to its end.
    async fn connection(self, stream: TcpStream, peer: SocketAddr, watcher: Watcher) -> Result<(), String> {
        let answer = self.answer.clone();
        let Some(tls) = &self.tls else {
            return self.http(self.timed(stream), answer, Peer::plain(peer), watcher).await;
        };
        let spoken = tokio::time::timeout(self.header_timeout, encryption::spoken(&stream, peer));
        match within(spoken.await)? {
            WireProtocol::Tls => {
                let handshake = tls.accept(self.timed(stream));
                let stream = within(tokio::time::timeout(self.header_timeout, handshake).await)?;
                self.http(stream, answer, Peer { addr: peer, is_encrypted: true }, watcher).await
            }
            WireProtocol::LocalPlain => {
                self.http(self.timed(stream), answer, Peer::plain(peer), watcher).await
            }
            WireProtocol::Plain => {
                let refusing = self.refusing.clone();
                let refuse = move |request| refusing.clone().oneshot(request);
                self.http(self.timed(stream), refuse, Peer::plain(peer), watcher).await
            }
        }
    }

    /// A stream that gives up when what it writes is not taken.
    fn timed(&self, stream: TcpStream) -> Pin<Box<TimeoutStream<TcpStream>>> {
        let mut stream = TimeoutStream::new(stream);
        // Runs only while there is something to write, and starts again with every part that is
        // taken.
        stream.set_write_timeout(Some(self.write_timeout));
        Box::pin(stream)
    }

    async fn http<Answered: Future<Output = Result<Response, Infallible>> + Send + 'static>(
        &self,
        stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
        answer: impl Fn(Request) -> Answered + Send + 'static,
        peer: Peer,
        watcher: Watcher,
    ) -> Result<(), String> {
        let answer = service_fn(move |request: Request<Incoming>| {
            let mut request = request.map(Body::new);
            request.extensions_mut().insert(peer);
            answer(request)
        });
        let mut http = self.http.clone();
        http.timer(TokioTimer::new());
        let connection = http.serve_connection(TokioIo::new(stream), answer);
        watcher.watch(connection).await.map_err(|error| error.to_string())
    }
}

fn within<T>(done: Result<io::Result<T>, tokio::time::error::Elapsed>) -> Result<T, String> {
    done.map_err(|elapsed| elapsed.to_string())?.map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::certificates::{Certificates, acceptor};
    use axum::{
        body::Bytes,
        response::{Sse, sse::Event},
        routing::get,
    };
    use futures::{StreamExt, stream};
    use tokio::{
        io::{AsyncReadExt, AsyncWriteExt},
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
        let answer = move |request| router.clone().oneshot(request);
        tokio::spawn(serve(listener, answer, None, limits, stopping));
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

    #[tokio::test]
    async fn plain_text_from_another_machine_gets_the_refusal_alone() {
        let folder = tempfile::tempdir().unwrap();
        let settings =
            crate::config::Tls { names: Vec::new(), own: None, client_authority: None, local_zenoh: None };
        let certificates = Certificates::open(&settings, folder.path(), 1_800_000_000_000).unwrap();
        let second = Duration::from_secs(1);
        let secret = Router::new().fallback(async || "secret");
        let serving = Serving {
            http: http1::Builder::new(),
            tls: Some(acceptor(certificates.current(), None, &[b"http/1.1"]).unwrap()),
            answer: move |request| secret.clone().oneshot(request),
            refusing: encryption::refusing(),
            header_timeout: second,
            write_timeout: second,
        };
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let at = listener.local_addr().unwrap();
        for (peer, status, is_answered) in
            [("127.0.0.1:9", "HTTP/1.1 200", true), ("192.0.2.4:9", "HTTP/1.1 426", false)]
        {
            let mut client = asked(at, "/").await;
            let (accepted, _) = listener.accept().await.unwrap();
            let graceful = GracefulShutdown::new();
            let served = serving.clone().connection(accepted, peer.parse().unwrap(), graceful.watcher());
            let mut answer = String::new();
            let (served, read) = tokio::join!(served, client.read_to_string(&mut answer));
            assert!(served.is_ok() && read.is_ok());
            assert!(answer.starts_with(status), "{peer}: {answer}");
            assert_eq!((answer.contains("secret"), answer.contains("https://")), (is_answered, !is_answered));
        }
        // A handshake that does not come.
        let _silent = TcpStream::connect(at).await.unwrap();
        let (accepted, peer) = listener.accept().await.unwrap();
        let graceful = GracefulShutdown::new();
        let served = timeout(Duration::from_secs(10), serving.connection(accepted, peer, graceful.watcher()));
        assert!(served.await.unwrap().unwrap_err().contains("deadline"));
    }
}
