//! Claim: tokens of zenoh-bridge-ros2dds are read and written part by part.

use ros2::bridge_dds::{
    BridgeEndpoint, BridgeKind, BridgeToken, BridgeTokenError, DdsDurability, DdsHistory, DdsHistoryKind,
    DdsQos, DdsQosError, DdsReliability, MAX_BRIDGE_TOKEN_BYTES,
};

const SCAN: &str = "@/8b20917502ee955a/@ros2_lv/MP/bot1§scan/sensor_msgs§msg§LaserScan/:1:0:0,10";

fn scan() -> BridgeEndpoint {
    BridgeEndpoint {
        zid: "8b20917502ee955a".into(),
        kind: BridgeKind::Publisher,
        key: "bot1/scan".into(),
        ros_type: "sensor_msgs/msg/LaserScan".into(),
        qos: DdsQos {
            is_keyed: false,
            reliability: Some(DdsReliability::Reliable),
            durability: Some(DdsDurability::Volatile),
            history: Some(DdsHistory { kind: DdsHistoryKind::KeepLast, depth: 10 }),
            user_data: String::new(),
        },
    }
}

fn both_ways(token: &BridgeToken, text: &str) {
    assert_eq!(token.to_key(), text);
    assert_eq!(BridgeToken::parse(text).as_ref(), Ok(token));
}

#[test]
fn the_token_of_a_publisher_says_the_type_of_its_topic() {
    both_ways(&BridgeToken::Endpoint(scan()), SCAN);
    assert_eq!(scan().type_name().unwrap().name(), "LaserScan");
}

#[test]
fn bridges_services_and_actions_have_tokens_too() {
    let bridge = BridgeToken::Bridge { zid: "8b20".into() };
    both_ways(&bridge, "@/8b20/@ros2_lv");
    for (letters, kind) in [
        ("SS", BridgeKind::Service),
        ("SC", BridgeKind::ServiceClient),
        ("AS", BridgeKind::Action),
        ("AC", BridgeKind::ActionClient),
    ] {
        let text = format!("@/8b20/@ros2_lv/{letters}/bot1§add/example_interfaces§srv§AddTwoInts");
        let token = BridgeToken::parse(&text).unwrap();
        assert_eq!(token.to_key(), text);
        assert!(matches!(token, BridgeToken::Endpoint(e) if e.kind == kind && e.type_name().is_err()));
    }
}

#[test]
fn user_data_hold_the_hash_since_iron() {
    let text = "K:0:1:1,-1:enclave=/;typehash=RIHS01_64c1;";
    let qos = DdsQos::parse(text).unwrap();
    assert_eq!(qos.user_data, "enclave=/;typehash=RIHS01_64c1;");
    assert_eq!(qos.to_string(), text);
    assert!(qos.is_keyed);
    assert_eq!(qos.history, Some(DdsHistory { kind: DdsHistoryKind::KeepAll, depth: -1 }));
    assert_eq!(DdsQos::parse(":::"), Ok(DdsQos::default()));
    assert_eq!(DdsQos::default().to_string(), ":::");
    // The text behind the fourth colon is the user's.
    assert_eq!(DdsQos::parse("::::a:b").unwrap().user_data, "a:b");
}

#[test]
fn other_texts_are_refused_with_a_reason() {
    let refused = |text: &str| BridgeToken::parse(text).expect_err(text);
    for text in ["", "@/a", "@ros2_lv/0/a/0/0/NN/%/%/n", "@/a/@ros2_lv/MP", "@/a/@ros2_lv/MP/k"] {
        assert_eq!(refused(text), BridgeTokenError::Parts);
    }
    assert_eq!(refused("@/a/@ros2_lv/MP/k/t"), BridgeTokenError::Parts, "a topic without quality of service");
    assert_eq!(refused("@/a/@ros2_lv/SS/k/t/:::"), BridgeTokenError::Parts);
    assert_eq!(refused(&format!("{SCAN}/x")), BridgeTokenError::Parts);
    assert_eq!(refused("@//@ros2_lv"), BridgeTokenError::Empty("zid"));
    assert_eq!(refused("@/a/@ros2_lv/MP//t/:::"), BridgeTokenError::Empty("key"));
    assert_eq!(refused("@/a/@ros2_lv/MP/k//:::"), BridgeTokenError::Empty("type"));
    assert_eq!(refused("@/a/@ros2_lv/XX/k/t/:::"), BridgeTokenError::Kind);
    for (qos, field) in [
        ("", "reliability"),
        ("x:::", "key"),
        (":2::", "reliability"),
        ("::4:", "durability"),
        (":::0", "history"),
        (":::2,1", "history"),
        (":::0,x", "history"),
        ("::", "history"),
    ] {
        assert_eq!(DdsQos::parse(qos), Err(DdsQosError(field)), "{qos}");
    }
    let long = format!("@/{}/@ros2_lv", "a".repeat(MAX_BRIDGE_TOKEN_BYTES - 11));
    assert!(BridgeToken::parse(&long).is_ok());
    assert_eq!(refused(&format!("{long}x")), BridgeTokenError::TooLong(MAX_BRIDGE_TOKEN_BYTES + 1));
}
