//! Claim: whatever frames a robot sends, no thread of the router behind the front panics, and
//! another client loses no message. `WAYMARK_RUNS` says how many frames; each connection sends some
//! of them, until it is ended.

use super::*;
use std::{
    panic,
    sync::atomic::{AtomicU64, Ordering},
};
use tokio::io::{AsyncReadExt as _, DuplexStream, ReadHalf, WriteHalf};
use zenoh_buffers::reader::DidntRead;
use zenoh_codec::RCodec as _;
use zenoh_protocol::{
    network::{
        DeclareFinal, DeclareQueryable, Response, ResponseFinal, UndeclareQueryable, UndeclareToken,
        declare::queryable::ext::QueryableInfoType, response,
    },
    transport::{OpenSyn, TransportBody, TransportMessage},
    zenoh::{Del, Err as ErrorReply, PushBody, ResponseBody},
};

/// Frames in a run of the tests.
const RUNS: u64 = 20_000;
/// Most frames of one connection.
const OF_CONNECTION: u64 = 100;
/// Connections between two looks at the other client.
const LOOK_EVERY: u64 = 50;
/// Longest wait for what happens at once.
const SOON: Duration = Duration::from_secs(20);

/// How a connection behaves.
#[derive(Clone, Copy, PartialEq)]
enum Temper {
    /// As a client of zenoh: nothing of it may be refused.
    Good,
    /// In whole messages that a client would not send.
    Wild,
    /// Wild, with bytes changed.
    Broken,
}

/// Numbers that follow from the one before, and messages by them.
struct Random {
    state: u64,
    temper: Temper,
    next_key: u16,
    /// Next number of what a good client declares, which uses none twice.
    next_id: u32,
}

impl Random {
    /// 0 to `n` - 1.
    fn below(&mut self, n: u64) -> u64 {
        self.state =
            self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.state >> 33) % n
    }

    fn key(&mut self) -> WireExpr<'static> {
        let (is_good, good) =
            (self.temper == Temper::Good, ["**", "*/x", "a/**/b", "other/x", "@/**", "a$*/b", "c", "d/e"]);
        let mut text = good[self.below(8) as usize].to_owned();
        if is_good {
            // Each declared key ends with a chunk, so that each suffix may follow.
            let scope = self.below(u64::from(self.next_key)) as u16;
            text = if scope == 0 { text } else { format!("/x{}", self.below(9)) };
            return WireExpr { scope, mapping: Mapping::Sender, ..WireExpr::from(text) };
        }
        if self.below(30) == 0 {
            let length = [0, 7, MAX_KEY_BYTES - 1, MAX_KEY_BYTES + 1][self.below(4) as usize];
            text = (0..length).map(|_| b"ab/*$@?#~"[self.below(9) as usize] as char).collect();
        }
        let mapping = if self.below(60) == 0 { Mapping::Receiver } else { Mapping::Sender };
        let scope = if self.below(3) == 0 { 1 + self.below(4) as u16 } else { 0 };
        WireExpr { scope, mapping, ..WireExpr::from(if scope > 0 { format!("/{text}") } else { text }) }
    }

    fn body(&mut self) -> NetworkBody {
        let mut body = self.any_body();
        if self.temper == Temper::Good {
            self.number(&mut body);
        }
        body
    }

    /// What begins gets the next number.
    fn number(&mut self, body: &mut NetworkBody) {
        let id = match body {
            NetworkBody::Interest(interest) if interest.mode != InterestMode::Final => &mut interest.id,
            NetworkBody::Declare(declare) => match &mut declare.body {
                DeclareBody::DeclareSubscriber(it) => &mut it.id,
                DeclareBody::DeclareQueryable(it) => &mut it.id,
                DeclareBody::DeclareToken(it) => &mut it.id,
                _ => return,
            },
            _ => return,
        };
        *id = self.next_id;
        self.next_id += 1;
    }

    fn any_body(&mut self) -> NetworkBody {
        let begun = if self.temper == Temper::Good { u64::from(self.next_id) } else { 6 };
        let (id, wire_expr) = (self.below(begun) as u32, self.key());
        let ended = || declare::common::ext::WireExprType { wire_expr: wire_expr.clone() };
        match self.below(14) {
            kind @ 0..4 => self.data(kind, id, wire_expr),
            4 if self.temper == Temper::Good => declare(DeclareBody::DeclareFinal(DeclareFinal)),
            4 => declare(DeclareBody::UndeclareKeyExpr(UndeclareKeyExpr { id: id as u16 })),
            5 => declare(DeclareBody::UndeclareQueryable(UndeclareQueryable { id, ext_wire_expr: ended() })),
            6 => declare(DeclareBody::UndeclareToken(UndeclareToken { id, ext_wire_expr: ended() })),
            7 => declare(DeclareBody::DeclareQueryable(DeclareQueryable {
                id,
                wire_expr,
                ext_info: QueryableInfoType::DEFAULT,
            })),
            8 if self.temper == Temper::Good => {
                self.next_key += 1;
                declared_key(self.next_key - 1, key(0, 1 + self.below(9) as usize))
            }
            8 => declared_key(1 + self.below(40) as u16, key(0, 1 + self.below(9) as usize)),
            9 => {
                let mode = [InterestMode::Final, InterestMode::Current, InterestMode::CurrentFuture];
                let options = InterestOptions::ALL + InterestOptions::AGGREGATE;
                NetworkBody::Interest(Interest {
                    id,
                    mode: mode[self.below(3) as usize],
                    options: if self.below(2) == 0 { options } else { InterestOptions::ALL },
                    wire_expr: (self.below(4) > 0).then_some(wire_expr),
                    ext_qos: interest::ext::QoSType::DEFAULT,
                    ext_tstamp: None,
                    ext_nodeid: interest::ext::NodeIdType::DEFAULT,
                })
            }
            _ => {
                let mut all = named(&wire_expr);
                if self.temper == Temper::Good {
                    // Keys are declared above, each once.
                    all.retain(|body| !matches!(body, NetworkBody::Declare(it) if matches!(it.body, DeclareBody::DeclareKeyExpr(_))));
                }
                all.swap_remove(self.below(all.len() as u64) as usize)
            }
        }
    }

    /// Data, replies and their ends.
    fn data(&mut self, kind: u64, id: u32, wire_expr: WireExpr<'static>) -> NetworkBody {
        match kind {
            0 => put(wire_expr, self.below(200) as usize),
            1 => match put(wire_expr, 0) {
                NetworkBody::Push(push) => NetworkBody::Push(Push {
                    payload: PushBody::Del(Del {
                        timestamp: None,
                        ext_sinfo: None,
                        ext_attachment: None,
                        ext_unknown: Vec::new(),
                    }),
                    ..push
                }),
                other => other,
            },
            2 => NetworkBody::Response(Response {
                rid: id,
                wire_expr,
                payload: ResponseBody::Err(ErrorReply {
                    encoding: zenoh_protocol::core::Encoding::default(),
                    ext_sinfo: None,
                    ext_unknown: Vec::new(),
                    payload: vec![0_u8; 20].into(),
                }),
                ext_qos: response::ext::QoSType::DEFAULT,
                ext_tstamp: None,
                ext_respid: None,
                ext_ts_stack: None,
            }),
            _ => NetworkBody::ResponseFinal(ResponseFinal {
                rid: id,
                ext_qos: response::ext::QoSType::DEFAULT,
                ext_tstamp: None,
            }),
        }
    }

    /// One to four messages, whole, in fragments, or with some bytes changed.
    fn batch(&mut self, sn: &mut u32) -> Vec<u8> {
        let mut bodies: Vec<_> = (0..=self.below(4)).map(|_| self.body()).collect();
        if self.below(8) == 0 {
            let body = if self.temper == Temper::Good { put(self.key(), 300) } else { bodies.swap_remove(0) };
            let whole = frame([body])[2..].to_vec();
            // The first fragment of a client holds the key.
            let least = if self.temper == Temper::Good { 100 } else { 0 };
            let (first, rest) = whole.split_at(least + self.below((whole.len() - least) as u64) as usize);
            let batch =
                [fragment(*sn, true, true, first.to_vec()), fragment(*sn + 1, false, false, rest.to_vec())];
            *sn += 2;
            return batch.concat();
        }
        let mut batch = numbered(*sn, bodies);
        *sn += 1;
        if self.temper == Temper::Broken && self.below(8) == 0 {
            for _ in 0..=self.below(3) {
                let at = self.below(batch.len() as u64) as usize;
                batch[at] = self.below(256) as u8;
            }
            if self.below(8) == 0 {
                batch.truncate(1 + self.below(batch.len() as u64) as usize);
            }
        }
        batch
    }
}

async fn send(to: &mut WriteHalf<DuplexStream>, batch: &[u8]) -> std::io::Result<()> {
    let length = u16::try_from(batch.len()).expect("a batch").to_le_bytes();
    to.write_all(&[&length[..], batch].concat()).await
}

async fn received(from: &mut ReadHalf<DuplexStream>) -> TransportBody {
    let mut batch = vec![0; usize::from(from.read_u16_le().await.expect("a batch"))];
    from.read_exact(&mut batch).await.expect("a batch");
    let message: Result<TransportMessage, DidntRead> = Zenoh080.read(&mut &batch[..]);
    message.expect("a message").body
}

/// Opens a session, and sends frames until there are enough or the connection ends; how many went,
/// and how it ended.
async fn connection(router: &std::path::Path, random: &mut Random, lasting: &Lasting) -> (u64, End) {
    random.temper = [Temper::Good, Temper::Wild, Temper::Broken][random.below(3) as usize];
    (random.next_key, random.next_id) = (1, 1);
    let (robot, front) = tokio::io::duplex(1 << 12);
    let (read, write) = UnixStream::connect(router).await.expect("a router").into_split();
    // One who connects again and again, and another one.
    let peer = Name::new(if random.temper == Temper::Good { "good" } else { "wild" }).expect("a name");
    let relayed = tokio::spawn(relay(front, ToRouter { read, write }, lasting.of(Peer::Robot(peer))));
    let (mut from, mut to) = tokio::io::split(robot);
    send(&mut to, &init(1)).await.expect("sent");
    let TransportBody::InitAck(ack) = received(&mut from).await else { panic!("no InitAck") };
    let mut sn = 1;
    let open = OpenSyn {
        lease: Duration::from_secs(30),
        initial_sn: sn,
        cookie: ack.cookie,
        ext_qos: None,
        ext_auth: None,
        ext_mlink: None,
        ext_lowlatency: None,
        ext_compression: None,
        ext_remote_bound: None,
    };
    let mut bytes = Vec::new();
    Zenoh080.write(&mut &mut bytes, &open).expect("written");
    send(&mut to, &bytes).await.expect("sent");
    assert!(matches!(received(&mut from).await, TransportBody::OpenAck(_)));
    let taken = tokio::spawn(async move { tokio::io::copy(&mut from, &mut tokio::io::sink()).await });
    let mut sent = 0;
    while sent < OF_CONNECTION && !taken.is_finished() && send(&mut to, &random.batch(&mut sn)).await.is_ok()
    {
        sent += 1;
    }
    drop(to.shutdown().await);
    let ended = timeout(SOON, relayed).await.expect("ends").expect("no panic");
    drop(taken.await);
    (sent, ended)
}

#[tokio::test(flavor = "multi_thread")]
async fn any_frames_of_a_robot_leave_the_router_and_others_whole() {
    static PANICS: AtomicU64 = AtomicU64::new(0);
    let before = panic::take_hook();
    panic::set_hook(Box::new(move |what| {
        // Threads of other tests may panic on purpose; those of zenoh's runtimes have names of its
        // own.
        let thread = std::thread::current().name().unwrap_or_default().to_owned();
        if ["rx-", "tx-", "net-", "app-", "acc-"].iter().any(|zenoh| thread.starts_with(zenoh)) {
            PANICS.fetch_add(1, Ordering::Relaxed);
        }
        before(what);
    }));
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path().join("router");
    let listen = vec![format!("unixsock-stream/{}", at.display())];
    let settings =
        RouterSettings { listen, connect: None, tls: None, access: None, robots: 8, frame_bytes: 1 << 16 };
    let router = router::open(&settings).await.expect("a router");
    let other = router::open_client(&settings.listen[0]).await.expect("a client");
    let (heard, mut numbers) = tokio::sync::mpsc::unbounded_channel();
    let hear = move |sample: zenoh::sample::Sample| {
        // Robots may write here, too; theirs are of another length.
        if let Ok(number) = <[u8; 16]>::try_from(&*sample.payload().to_bytes()) {
            heard.send(u128::from_le_bytes(number)).ok();
        }
    };
    let _numbers = router.declare_subscriber("other/number").callback(hear).await.expect("declared");
    let runs = std::env::var("WAYMARK_RUNS").ok().and_then(|text| text.parse().ok()).unwrap_or(RUNS);
    let mut random = Random { state: 35, temper: Temper::Good, next_key: 1, next_id: 1 };
    let lasting = Lasting::default();
    let (mut sent, mut connections, mut violations) = (0, 0_u64, 0_u64);
    while sent < runs {
        let (frames, ended) = connection(&at, &mut random, &lasting).await;
        sent += frames;
        let is_violation = matches!(ended, End::Violation(_));
        assert!(random.temper != Temper::Good || !is_violation, "{ended:?}");
        violations += u64::from(is_violation);
        connections += 1;
        if connections % LOOK_EVERY == 0 || sent >= runs {
            let number = u128::MAX - u128::from(connections);
            other.put("other/number", number.to_le_bytes().to_vec()).await.expect("sent");
            let heard = async { while numbers.recv().await.expect("open") != number {} };
            timeout(SOON, heard).await.expect("the other client is heard");
            assert_eq!(PANICS.load(Ordering::Relaxed), 0, "after {sent} frames");
        }
    }
    println!("{sent} frames in {connections} connections, {violations} of them ended by the front");
    assert!(violations > connections / 4 && violations < connections, "{violations} of {connections}");
    other.close().await.expect("closed");
    router.close().await.expect("closed");
}
