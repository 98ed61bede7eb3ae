//! A robot that speaks zenoh's transport by hand: the client of the crate stops itself before it
//! sends what is wrong.

use client::RobotTls;
use rustls::{
    ClientConfig, ClientConnection, RootCertStore, StreamOwned,
    pki_types::{CertificateDer, PrivateKeyDer, ServerName, pem::PemObject},
};
use std::{
    io::{Read, Write},
    net::TcpStream,
    os::unix::net::UnixStream,
    path::Path,
    sync::Arc,
    time::Duration,
};

/// Longest wait for an answer of the other end.
const WAIT: Duration = Duration::from_secs(10);
/// Bytes of each declared part of a long key: it goes into one batch.
const PART: usize = 45_000;

trait Stream: Read + Write + Send {}
impl<T: Read + Write + Send> Stream for T {}

/// An open session.
pub(crate) struct RawRobot {
    stream: Box<dyn Stream>,
    seq: u64,
    next_key: u64,
    /// The other end takes nothing any more.
    is_closed: bool,
}

/// A number as zenoh writes it: seven bits a byte, the lowest first.
fn number(out: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        out.push((number as u8 & 0x7f) | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

fn bytes(out: &mut Vec<u8>, bytes: &[u8]) {
    number(out, bytes.len() as u64);
    out.extend(bytes);
}

impl RawRobot {
    /// Connects to `tcp/` or, with certificates, to `tls/` on this machine, as the session `id`.
    pub(crate) fn connect(id: u128, endpoint: &str, tls: Option<&RobotTls>) -> Self {
        let (_, address) = endpoint.split_once('/').expect("an endpoint");
        let socket = TcpStream::connect(address).expect("connected");
        socket.set_read_timeout(Some(WAIT)).expect("a time-out");
        match tls {
            None => Self::over(Box::new(socket), id),
            Some(tls) => Self::over(Box::new(encrypted(socket, tls)), id),
        }
    }

    /// Connects to the socket of a router itself, where no front is.
    pub(crate) fn connect_inside(id: u128, socket: &Path) -> Self {
        let socket = UnixStream::connect(socket).expect("connected");
        socket.set_read_timeout(Some(WAIT)).expect("a time-out");
        Self::over(Box::new(socket), id)
    }

    fn over(stream: Box<dyn Stream>, id: u128) -> Self {
        let mut robot = Self { stream, seq: 1, next_key: 1, is_closed: false };
        robot.open(id);
        robot
    }

    /// Whether the other end says that the session ends, before it closes the connection.
    pub(crate) fn is_told_off(&mut self) -> bool {
        let mut length = [0; 2];
        while self.stream.read_exact(&mut length).is_ok() {
            let mut batch = vec![0; usize::from(u16::from_le_bytes(length))];
            if self.stream.read_exact(&mut batch).is_err() {
                break;
            }
            if batch.first().is_some_and(|first| first & 0x1f == 0x03) {
                return true;
            }
        }
        false
    }

    /// The four messages by which a session opens: `InitSyn`, `InitAck`, `OpenSyn`, `OpenAck`.
    fn open(&mut self, id: u128) {
        let mut init = vec![0x01, 0x09, 0xf2];
        init.extend(id.to_le_bytes());
        self.send(&init);
        let ack = self.receive();
        assert_eq!(ack[0] & 0x3f, 0x21, "{ack:?}");
        // Version, kind with the length of the id, id; resolution and size of batches where they
        // are announced; cookie.
        let mut at = 3 + usize::from(ack[2] >> 4) + 1 + if ack[0] & 0x40 == 0 { 0 } else { 3 };
        let (mut length, mut shift) = (0, 0);
        loop {
            length |= usize::from(ack[at] & 0x7f) << shift;
            (at, shift) = (at + 1, shift + 7);
            if ack[at - 1] < 0x80 {
                break;
            }
        }
        let mut open = vec![0x42];
        number(&mut open, 30);
        number(&mut open, self.seq);
        bytes(&mut open, &ack[at..at + length]);
        self.send(&open);
        let ack = self.receive();
        assert_eq!(ack[0] & 0x3f, 0x22, "{ack:?}");
    }

    fn send(&mut self, batch: &[u8]) {
        let length = u16::try_from(batch.len()).expect("a batch").to_le_bytes();
        let sent = self.stream.write_all(&[&length, batch].concat());
        self.is_closed |= sent.and_then(|()| self.stream.flush()).is_err();
    }

    fn receive(&mut self) -> Vec<u8> {
        let mut length = [0; 2];
        self.stream.read_exact(&mut length).expect("a batch");
        let mut batch = vec![0; usize::from(u16::from_le_bytes(length))];
        self.stream.read_exact(&mut batch).expect("a batch");
        batch
    }

    fn frame(&mut self, message: &[u8]) {
        let mut frame = vec![0x25];
        number(&mut frame, self.seq);
        self.seq += 1;
        frame.extend(message);
        self.send(&frame);
    }

    /// Declares all of `key` but its end, in parts that rest on one another; the id of what is
    /// declared, and the end.
    fn declare<'a>(&mut self, key: &'a str) -> (u64, &'a str) {
        let (mut scope, mut rest) = (0, key);
        while rest.len() > PART {
            let (part, after) = rest.split_at(PART);
            let mut message = vec![0x1e, 0x20];
            number(&mut message, self.next_key);
            number(&mut message, scope);
            bytes(&mut message, part.as_bytes());
            self.frame(&message);
            (scope, rest) = (self.next_key, after);
            self.next_key += 1;
        }
        (scope, rest)
    }

    /// Sends a message of a kind about `key`, however long that is.
    pub(crate) fn say(&mut self, kind: Kind, key: &str) {
        let (scope, end) = self.declare(key);
        let (head, has_id) = kind.head();
        let mut message = head.to_vec();
        if has_id {
            number(&mut message, 1000 + self.seq);
        }
        message.extend(kind.options());
        number(&mut message, scope);
        bytes(&mut message, end.as_bytes());
        message.extend(kind.body());
        self.frame(&message);
    }
}

/// What is said about a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Put,
    Delete,
    Query,
    Reply,
    Key,
    Subscriber,
    Queryable,
    Token,
    /// Present and coming tokens.
    TokenInterest,
    /// Present tokens.
    TokenQuestion,
    /// Present and coming subscribers and queryables, and declared keys.
    Interest,
    /// The same, told as one: zenoh 1.10.2 declares the key of the interest in return, which no
    /// access control checks.
    AggregateInterest,
}

impl Kind {
    pub(crate) const ALL: [Self; 12] = [
        Self::Put,
        Self::Delete,
        Self::Query,
        Self::Reply,
        Self::Key,
        Self::Subscriber,
        Self::Queryable,
        Self::Token,
        Self::TokenInterest,
        Self::TokenQuestion,
        Self::Interest,
        Self::AggregateInterest,
    ];

    /// Flags and kind of the message, and whether an id follows.
    fn head(self) -> (&'static [u8], bool) {
        match self {
            Self::Put | Self::Delete => (&[0x7d], false),
            Self::Query => (&[0x7c], true),
            Self::Reply => (&[0x7b], true),
            Self::Key => (&[0x1e, 0x20], true),
            Self::Subscriber => (&[0x1e, 0x62], true),
            Self::Queryable => (&[0x1e, 0x64], true),
            Self::Token => (&[0x1e, 0x66], true),
            Self::TokenQuestion => (&[0x39], true),
            Self::TokenInterest | Self::Interest | Self::AggregateInterest => (&[0x79], true),
        }
    }

    /// Of an interest: what it is in, restricted to a key.
    fn options(self) -> &'static [u8] {
        match self {
            Self::TokenInterest | Self::TokenQuestion => &[0x78],
            Self::Interest => &[0x77],
            Self::AggregateInterest => &[0xf7],
            _ => &[],
        }
    }

    fn body(self) -> &'static [u8] {
        match self {
            Self::Put => &[0x01, 1, b'x'],
            Self::Delete => &[0x02],
            Self::Query => &[0x03],
            Self::Reply => &[0x04, 0x01, 1, b'x'],
            _ => &[],
        }
    }
}

fn encrypted(socket: TcpStream, tls: &RobotTls) -> StreamOwned<ClientConnection, TcpStream> {
    let mut roots = RootCertStore::empty();
    let authority = tls.authority.as_ref().expect("an authority");
    roots.add(CertificateDer::from_pem_file(authority).expect("an authority")).expect("an authority");
    let chain = CertificateDer::pem_file_iter(&tls.certificate).expect("a certificate");
    let chain = chain.collect::<Result<_, _>>().expect("a certificate");
    let key = PrivateKeyDer::from_pem_file(&tls.key).expect("a key");
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions();
    let config = config.expect("versions").with_root_certificates(roots);
    let config = config.with_client_auth_cert(chain, key).expect("a certificate");
    let name = ServerName::try_from("127.0.0.1").expect("a name");
    StreamOwned::new(ClientConnection::new(Arc::new(config), name).expect("a connection"), socket)
}
