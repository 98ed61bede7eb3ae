//! What passes the front, in zenoh's own encoding, and what zenoh does on the other side of it.

mod any_frames;
mod keys;

use super::{
    inspection::{
        Cost, Inspection, MAX_DECLARED, MAX_DECLARED_BYTES, MAX_KEY_BYTES, MAX_ROUTER_KEY_BYTES, Violation,
    },
    lasting::MAX_INTEREST_BYTES,
    *,
};
use crate::{
    bus::router::{self, RouterSettings, RouterTls},
    identity::certificates::LinkCertificates,
};
use serde_json::json;
use std::net::{Ipv4Addr, UdpSocket};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use zenoh_codec::{WCodec as _, Zenoh080};
use zenoh_protocol::{
    core::{Reliability, WhatAmI, WireExpr, ZenohIdProto},
    network::{
        Declare, DeclareBody, DeclareKeyExpr, DeclareSubscriber, DeclareToken, Interest, Mapping,
        NetworkBody, NetworkMessage, Push, Request, UndeclareKeyExpr, UndeclareSubscriber, declare, interest,
        interest::{InterestMode, InterestOptions},
        push, request,
    },
    transport::{Fragment, Frame, InitSyn, KeepAlive, fragment, frame, init},
    zenoh::{ConsolidationMode, PushBody, Put, Query, RequestBody},
};

/// The first message of a client; `patch` of zenoh's changes to its protocol.
fn init(patch: u8) -> Vec<u8> {
    init_of(WhatAmI::Client, patch)
}

fn init_of(whatami: WhatAmI, patch: u8) -> Vec<u8> {
    let message = InitSyn {
        version: zenoh_protocol::VERSION,
        whatami,
        zid: ZenohIdProto::default(),
        resolution: zenoh_protocol::core::Resolution::default(),
        batch_size: u16::MAX,
        ext_qos: None,
        ext_qos_link: None,
        ext_auth: None,
        ext_mlink: None,
        ext_lowlatency: None,
        ext_compression: None,
        ext_patch: init::ext::PatchType::new(patch),
        ext_region_name: None,
    };
    let mut bytes = Vec::new();
    Zenoh080.write(&mut &mut bytes, &message).expect("written");
    bytes
}

fn frame(bodies: impl IntoIterator<Item = NetworkBody>) -> Vec<u8> {
    numbered(7, bodies)
}

fn numbered(sn: u32, bodies: impl IntoIterator<Item = NetworkBody>) -> Vec<u8> {
    let message = |body| NetworkMessage { body, reliability: Reliability::Reliable };
    let payload = bodies.into_iter().map(message).collect();
    let frame =
        Frame { reliability: Reliability::Reliable, sn, payload, ext_qos: frame::ext::QoSType::DEFAULT };
    let mut bytes = Vec::new();
    Zenoh080.write(&mut &mut bytes, &frame).expect("written");
    bytes
}

fn fragment(sn: u32, is_first: bool, more: bool, payload: Vec<u8>) -> Vec<u8> {
    let fragment = Fragment {
        reliability: Reliability::Reliable,
        more,
        sn,
        payload: payload.into(),
        ext_qos: fragment::ext::QoSType::DEFAULT,
        ext_first: is_first.then(fragment::ext::First::new),
        ext_drop: None,
    };
    let mut bytes = Vec::new();
    Zenoh080.write(&mut &mut bytes, &fragment).expect("written");
    bytes
}

fn key(scope: u16, length: usize) -> WireExpr<'static> {
    WireExpr { scope, ..WireExpr::from("k".repeat(length)) }
}

fn put(wire_expr: WireExpr<'static>, bytes: usize) -> NetworkBody {
    NetworkBody::Push(Push {
        wire_expr,
        ext_qos: push::ext::QoSType::DEFAULT,
        ext_tstamp: None,
        ext_nodeid: push::ext::NodeIdType::DEFAULT,
        ext_ts_stack: None,
        payload: PushBody::Put(Put {
            timestamp: None,
            encoding: zenoh_protocol::core::Encoding::default(),
            ext_sinfo: None,
            ext_attachment: None,
            ext_unknown: Vec::new(),
            payload: vec![0_u8; bytes].into(),
        }),
    })
}

fn declare(body: DeclareBody) -> NetworkBody {
    NetworkBody::Declare(Declare {
        interest_id: None,
        ext_qos: declare::ext::QoSType::DEFAULT,
        ext_tstamp: None,
        ext_nodeid: declare::ext::NodeIdType::DEFAULT,
        body,
    })
}

fn declared_key(id: u16, wire_expr: WireExpr<'static>) -> NetworkBody {
    declare(DeclareBody::DeclareKeyExpr(DeclareKeyExpr { id, wire_expr }))
}

fn subscriber(id: u32) -> NetworkBody {
    declare(DeclareBody::DeclareSubscriber(DeclareSubscriber { id, wire_expr: key(0, 3) }))
}

/// Every kind of message that names a key.
fn named(wire_expr: &WireExpr<'static>) -> Vec<NetworkBody> {
    let wire_expr = || wire_expr.clone();
    vec![
        put(wire_expr(), 1),
        NetworkBody::Request(Request {
            id: 1,
            wire_expr: wire_expr(),
            ext_qos: request::ext::QoSType::DEFAULT,
            ext_tstamp: None,
            ext_nodeid: request::ext::NodeIdType::DEFAULT,
            ext_target: request::ext::QueryTarget::DEFAULT,
            ext_budget: None,
            ext_timeout: None,
            ext_ts_stack: None,
            payload: RequestBody::Query(Query {
                consolidation: ConsolidationMode::DEFAULT,
                parameters: String::new(),
                ext_sinfo: None,
                ext_body: None,
                ext_attachment: None,
                ext_unknown: Vec::new(),
            }),
        }),
        NetworkBody::Interest(Interest {
            id: 1,
            mode: InterestMode::Future,
            options: InterestOptions::ALL + InterestOptions::AGGREGATE,
            wire_expr: Some(wire_expr()),
            ext_qos: interest::ext::QoSType::DEFAULT,
            ext_tstamp: None,
            ext_nodeid: interest::ext::NodeIdType::DEFAULT,
        }),
        declared_key(9, wire_expr()),
        declare(DeclareBody::DeclareSubscriber(DeclareSubscriber { id: 1, wire_expr: wire_expr() })),
        declare(DeclareBody::DeclareToken(DeclareToken { id: 1, wire_expr: wire_expr() })),
        declare(DeclareBody::UndeclareSubscriber(UndeclareSubscriber {
            id: 1,
            ext_wire_expr: declare::common::ext::WireExprType { wire_expr: wire_expr() },
        })),
    ]
}

/// One whose transport is open.
fn opened() -> Inspection {
    let mut inspection = Inspection::default();
    assert_eq!(inspection.batch(&init(1)), Ok(Cost::default()));
    inspection
}

#[test]
fn a_message_in_fragments_names_its_key_first_and_has_no_gap() {
    let whole = |scope, length| frame([put(key(scope, length), 100)])[2..].to_vec();
    let mut inspection = opened();
    assert!(inspection.batch(&frame([declared_key(3, key(0, 4000))])).is_ok());
    let counted = Ok(Cost { declarations: 0, messages: 1 });
    assert_eq!(inspection.batch(&fragment(10, true, true, whole(3, 96))), counted);
    assert_eq!(inspection.batch(&fragment(11, false, true, vec![9; 50])), Ok(Cost::default()));
    assert_eq!(inspection.batch(&fragment(12, false, false, vec![9; 50])), Ok(Cost::default()));
    assert_eq!(inspection.batch(&fragment(13, true, true, whole(3, 97))), Err(Violation::LongKey));
    // What continues nothing, and what does not follow.
    assert_eq!(inspection.batch(&fragment(13, false, false, vec![9])), Err(Violation::Protocol));
    assert!(inspection.batch(&fragment(20, true, true, whole(0, 5))).is_ok());
    assert_eq!(inspection.batch(&fragment(22, false, true, vec![9])), Err(Violation::Protocol));
    // No declaration is so long.
    let long = frame([subscriber(1)])[2..].to_vec();
    assert_eq!(inspection.batch(&fragment(30, true, true, long)), Err(Violation::Protocol));
    let mut old = Inspection::default();
    assert!(old.batch(&init(0)).is_ok());
    assert_eq!(old.batch(&fragment(10, true, true, whole(0, 5))), Err(Violation::UnmarkedFragments));
}

#[test]
fn messages_come_in_the_order_of_zenoh() {
    let alive = || {
        let mut bytes = Vec::new();
        Zenoh080.write(&mut &mut bytes, &KeepAlive).expect("written");
        bytes
    };
    assert_eq!(Inspection::default().batch(&frame([put(key(0, 3), 1)])), Err(Violation::Protocol));
    assert_eq!(Inspection::default().batch(&alive()), Err(Violation::Protocol));
    assert_eq!(opened().batch(&init(1)), Err(Violation::Protocol), "opened twice");
    assert_eq!(opened().batch(&[0x05, 0x01, 0xff, 0xff]), Err(Violation::Protocol));
    // Several in one batch.
    let both = [alive(), frame([put(key(0, 3), 1), put(key(0, 3), 1)]), alive()].concat();
    assert_eq!(opened().batch(&both), Ok(Cost { declarations: 0, messages: 2 }));
}

/// Bytes of messages, changed at places that follow from a number.
#[test]
fn no_bytes_panic() {
    let whole = frame(named(&key(3, 40)).into_iter().chain([put(key(0, 3), 300)]));
    let mut random = 1_u64;
    let mut next = move || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 33) as usize
    };
    let mut passed = 0;
    for _ in 0..20_000 {
        let mut changed = whole.clone();
        for _ in 0..=next() % 4 {
            let at = next() % changed.len();
            changed[at] = next() as u8;
        }
        changed.truncate(1 + next() % whole.len());
        passed += usize::from(opened().batch(&changed).is_ok());
    }
    assert!(passed > 0 && passed < 20_000, "{passed}");
}

#[tokio::test]
async fn a_robot_that_is_still_sending_reads_why_its_connection_ends() {
    let (mut robot, front) = tokio::io::duplex(1 << 10);
    let (router, _far) = tokio::io::duplex(1 << 10);
    let (read, write) = tokio::io::split(router);
    let relayed = tokio::spawn(relay(front, ToRouter { read, write }, Arc::default()));
    // No message of zenoh.
    robot.write_all(&[1, 0, 0xff]).await.expect("sent");
    let mut told = Vec::new();
    robot.read_to_end(&mut told).await.expect("an end in order");
    assert_eq!(told.get(2).map(|first| first & 0x1f), Some(0x03), "{told:?}");
    robot.write_all(&vec![0; 1 << 16]).await.expect("the rest is read");
    drop(robot);
    let ended = timeout(Duration::from_secs(10), relayed).await.expect("ends").expect("no panic");
    assert!(matches!(ended, End::Violation(_)), "{ended:?}");
}

/// What the front rests on inside zenoh: the name of the protocol of QUIC, its one stream and
/// framing, access control by the name in the certificate.
#[tokio::test(flavor = "multi_thread")]
async fn a_gate_of_zenoh_takes_a_stream_of_quic_for_the_robot_that_its_certificate_names() {
    let link = Arc::new(LinkCertificates::new(crate::store::now_ms()).unwrap());
    let at = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap();
    let rule = json!({
        "id": "own", "permission": "allow", "flows": ["ingress", "egress"], "key_exprs": ["r1/frame"],
        "messages": ["put", "declare_subscriber"],
    });
    let settings = RouterSettings {
        listen: vec![format!("quic/{at}")],
        connect: None,
        tls: Some(RouterTls {
            authorities: link.authority_pem(),
            listener: (&link.listener.0, &link.listener.1),
        }),
        access: Some(json!({
            "enabled": true, "default_permission": "deny", "rules": [rule],
            "subjects": [{ "id": "r1", "cert_common_names": ["r1"] }],
            "policies": [{ "rules": ["own"], "subjects": ["r1"] }],
        })),
        robots: 4,
        frame_bytes: 1 << 20,
    };
    let gate = router::open(&settings).await.unwrap();
    let (heard, mut frames) = tokio::sync::mpsc::unbounded_channel();
    let hear = move |sample: zenoh::sample::Sample| {
        heard.send(sample.payload().len()).unwrap();
    };
    let _frames = gate.declare_subscriber("r1/frame").callback(hear).await.unwrap();
    let to_gate = Arc::new(ToGate::new(link, watch::channel(Some(at)).1).unwrap());
    for (name, is_heard) in [("r1", true), ("r2", false)] {
        let (listener, endpoint) = bind("tcp/127.0.0.1:0").await.unwrap();
        let to_gate = to_gate.clone();
        let relayed = tokio::spawn(async move {
            let (stream, _) = listener.accept().await.unwrap();
            let mut at_gate = to_gate.connect(&Name::new(name).unwrap()).await.unwrap();
            let ToRouter { read, write } = &mut at_gate.ends;
            relay(stream, ToRouter { read, write }, Arc::default()).await
        });
        let robot = router::open_client(&endpoint).await.unwrap();
        let publisher = robot.declare_publisher("r1/frame").await.unwrap();
        let publisher = async || {
            // One batch, and one that goes in fragments.
            for bytes in [1000, 300_000] {
                publisher.put(vec![1_u8; bytes]).await.unwrap();
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        };
        let mut sizes = std::collections::BTreeSet::new();
        for _ in 0..if is_heard { 40 } else { 4 } {
            publisher().await;
            while let Ok(bytes) = frames.try_recv() {
                sizes.insert(bytes);
            }
            if sizes.len() == 2 {
                break;
            }
        }
        assert_eq!(sizes.len(), if is_heard { 2 } else { 0 }, "{name}: {sizes:?}");
        robot.close().await.unwrap();
        let ended = timeout(Duration::from_secs(10), relayed).await.expect("ends").unwrap();
        assert!(matches!(ended, End::Closed(_)), "{ended:?}");
    }
    gate.close().await.unwrap();
}
