//! A TCP proxy on loopback whose link has faults: between a robot and its server, or between any
//! two programs. Connections are taken and passed on; what a fault does holds for all of them, in
//! both directions.

use std::{
    net::SocketAddr,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::{
        TcpListener, TcpStream,
        tcp::{OwnedReadHalf, OwnedWriteHalf},
    },
    sync::watch,
    task::JoinHandle,
};

/// Most bytes that are passed on at a time.
const PIECE_BYTES: usize = 16 << 10;
/// The same on a slow link: a hundredth of a second at 1 Mbit/s.
const SLOW_PIECE_BYTES: usize = 1_250;

/// What the link does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Link {
    /// Passes everything on.
    Up,
    /// Passes nothing on and takes no new connection. Nothing is lost: it is as if packets were
    /// sent again until they arrive.
    Down,
    /// Passes on so many bytes a second, in each direction.
    Slow(u32),
    /// Takes everything and passes nothing on, for ever, on the connections that there are. New
    /// ones pass.
    HalfOpen,
    /// The same, on new connections, too.
    Dead,
    /// Passes on so many bytes more from the client, then resets the connection. New ones pass.
    ResetAfter(usize),
}

/// A state and its number: a connection knows whether it is older.
type Numbered = (Link, u64);

/// The proxy. It ends with its test.
#[derive(Debug)]
pub struct Proxy {
    /// Where clients connect.
    pub address: SocketAddr,
    /// `tcp` or `tls`: bytes are passed on as they are.
    protocol: String,
    link: watch::Sender<Numbered>,
    connections: Arc<AtomicU64>,
    task: JoinHandle<()>,
}

impl Proxy {
    /// Starts one before the zenoh endpoint of a server, `tcp/HOST:PORT` or `tls/HOST:PORT`.
    pub async fn start(endpoint: &str) -> Self {
        let (protocol, server) = endpoint.split_once('/').expect("an endpoint");
        let (protocol, server) = (protocol.to_owned(), server.to_owned());
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
        let address = listener.local_addr().expect("its address");
        let link = watch::Sender::new((Link::Up, 0));
        let connections = Arc::<AtomicU64>::default();
        let task = tokio::spawn(accept(listener, server, link.clone(), connections.clone()));
        Self { address, protocol, link, connections, task }
    }

    /// The endpoint for a robot.
    pub fn endpoint(&self) -> String {
        format!("{}/{}", self.protocol, self.address)
    }

    /// From now on the link is so.
    pub fn set(&self, link: Link) {
        self.link.send_modify(|(now, number)| (*now, *number) = (link, *number + 1));
    }

    /// Connections that were taken.
    pub fn connections(&self) -> u64 {
        self.connections.load(Ordering::Relaxed)
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.task.abort();
    }
}

async fn accept(
    listener: TcpListener,
    server: String,
    link: watch::Sender<Numbered>,
    connections: Arc<AtomicU64>,
) {
    loop {
        let mut changes = link.subscribe();
        if changes.wait_for(|(link, _)| *link != Link::Down).await.is_err() {
            return;
        }
        let Ok((client, _)) = listener.accept().await else { continue };
        connections.fetch_add(1, Ordering::Relaxed);
        let (server, link) = (server.clone(), link.subscribe());
        tokio::spawn(async move {
            // A server that is not there closes the connection of the client.
            if let Ok(server) = TcpStream::connect(server).await {
                join(client, server, link).await;
            }
        });
    }
}

/// How one direction ends.
enum Ended {
    /// One end has closed, or is gone.
    Closed,
    /// By [`Link::ResetAfter`].
    Reset,
}

/// Passes on between two connections until one ends; then both end.
async fn join(client: TcpStream, server: TcpStream, link: watch::Receiver<Numbered>) {
    for stream in [&client, &server] {
        stream.set_nodelay(true).expect("a socket");
    }
    let born = link.borrow().1;
    let (from_client, to_client) = client.into_split();
    let (from_server, to_server) = server.into_split();
    let mut up =
        Direction { from: from_client, to: to_server, link: link.clone(), born, is_up: true, passed: 0 };
    let mut down = Direction { from: from_server, to: to_client, link, born, is_up: false, passed: 0 };
    let ended = tokio::select! {
        ended = up.run() => ended,
        ended = down.run() => ended,
    };
    if matches!(ended, Ended::Reset) {
        for socket in [up.from.as_ref(), down.from.as_ref()] {
            socket.set_zero_linger().expect("a socket");
        }
    }
}

struct Direction {
    from: OwnedReadHalf,
    to: OwnedWriteHalf,
    link: watch::Receiver<Numbered>,
    /// Number of the link's state when the connection began.
    born: u64,
    /// From the client to the server.
    is_up: bool,
    /// Bytes since the link is to reset.
    passed: usize,
}

impl Direction {
    async fn run(&mut self) -> Ended {
        let mut piece = vec![0; PIECE_BYTES];
        loop {
            let (link, number) = *self.link.borrow_and_update();
            let is_older = self.born < number;
            let most = match link {
                Link::Down => {
                    if self.link.changed().await.is_err() {
                        return Ended::Closed;
                    }
                    continue;
                }
                Link::HalfOpen if is_older => return self.swallow(&mut piece).await,
                Link::Dead => return self.swallow(&mut piece).await,
                Link::ResetAfter(bytes) if is_older && self.is_up => {
                    match bytes.saturating_sub(self.passed) {
                        0 => return Ended::Reset,
                        left => left,
                    }
                }
                Link::Slow(_) => SLOW_PIECE_BYTES,
                Link::Up | Link::HalfOpen | Link::ResetAfter(_) => PIECE_BYTES,
            };
            let read = tokio::select! {
                read = self.from.read(&mut piece[..most.min(PIECE_BYTES)]) => read,
                changed = self.link.changed() => match changed {
                    Ok(()) => continue,
                    Err(_) => return Ended::Closed,
                },
            };
            let Ok(read @ 1..) = read else { return Ended::Closed };
            if self.to.write_all(&piece[..read]).await.is_err() {
                return Ended::Closed;
            }
            match link {
                Link::Slow(bytes_per_s) => {
                    tokio::time::sleep(Duration::from_secs_f64(read as f64 / f64::from(bytes_per_s))).await;
                }
                Link::ResetAfter(_) => self.passed += read,
                _ => {}
            }
        }
    }

    /// Takes whatever comes, for as long as the proxy is there. The other end is told nothing, not
    /// even an end.
    async fn swallow(&mut self, piece: &mut [u8]) -> Ended {
        while let Ok(1..) = self.from.read(piece).await {}
        while self.link.changed().await.is_ok() {}
        Ended::Closed
    }
}
