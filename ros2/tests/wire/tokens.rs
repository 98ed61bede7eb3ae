//! Claim: liveliness tokens of rmw_zenoh are read and written part by part, those of newer releases
//! included.

use ros2::rmw_zenoh::{
    CPU_BACKEND, Durability, Endpoint, EntityKind, Gid, History, Liveliness, MAX_TOKEN_BYTES, Qos,
    QosDuration, QosError, Reliability, Token, TokenError,
};

/// Examples of rmw_zenoh's design document.
const LISTENER: &str = "@ros2_lv/0/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener";
pub(crate) const TALKER: &str = concat!(
    "@ros2_lv/0/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/",
    "std_msgs::msg::dds_::String_/RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18/::,7:,:,:,,",
);

fn node() -> Token {
    Token {
        domain: 0,
        zid: "aac3178e146ba6f1fc6e6a4085e77f21".into(),
        node_id: "0".into(),
        entity_id: "0".into(),
        kind: EntityKind::Node,
        enclave: "/".into(),
        namespace: "/".into(),
        node: "listener".into(),
        endpoint: None,
    }
}

fn publisher() -> Token {
    let endpoint = Endpoint {
        topic: "/chatter".into(),
        dds_type: "std_msgs::msg::dds_::String_".into(),
        hash: "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18".into(),
        qos: Qos::reliable(7),
        backends: None,
    };
    Token {
        zid: "8b20917502ee955ac4476e0266340d5c".into(),
        entity_id: "10".into(),
        kind: EntityKind::Publisher,
        node: "talker".into(),
        endpoint: Some(endpoint),
        ..node()
    }
}

fn both_ways(token: &Token, text: &str) {
    assert_eq!(token.to_key().as_deref(), Ok(text));
    assert_eq!(Token::parse(text).as_ref(), Ok(token));
}

#[test]
fn the_tokens_of_the_design_document() {
    both_ways(&node(), LISTENER);
    both_ways(&publisher(), TALKER);
    assert_eq!(publisher().endpoint.unwrap().type_name().unwrap().to_string(), "std_msgs/msg/String");
    assert_eq!(Token::every(0), "@ros2_lv/0/**");
}

#[test]
fn namespaces_and_nested_topics_have_percent_signs() {
    let mut token = publisher();
    token.namespace = "/robot1/arm".into();
    token.enclave = "/talker_listener".into();
    token.kind = EntityKind::Subscription;
    token.endpoint.as_mut().unwrap().topic = "/robot1/camera/image".into();
    let text = token.to_key().unwrap();
    assert!(text.contains("/10/MS/%talker_listener/%robot1%arm/talker/%robot1%camera%image/std_msgs"));
    both_ways(&token, &text);
}

#[test]
fn a_fourteenth_part_holds_backends_and_others_are_passed_over() {
    let mut token = publisher();
    token.kind = EntityKind::Subscription;
    token.endpoint.as_mut().unwrap().backends = Some(CPU_BACKEND.into());
    let text = token.to_key().unwrap();
    assert!(text.ends_with("/::,7:,:,:,,/backends:cpu:"), "{text}");
    both_ways(&token, &text);
    assert_eq!(Token::parse(&format!("{TALKER}/later:1")), Ok(publisher()));
    assert_eq!(Token::parse(&format!("{LISTENER}/later/2")), Ok(node()));
    let later = Token::parse(&format!("{TALKER}/later:1/backends:cuda:x")).unwrap();
    assert_eq!(later.endpoint.unwrap().backends.as_deref(), Some("cuda:x"));
}

#[test]
fn services_and_clients_are_read() {
    for (letters, kind) in [("SS", EntityKind::Service), ("SC", EntityKind::Client)] {
        let text = TALKER.replace("/MP/", &format!("/{letters}/")).replace("::msg::", "::srv::");
        let token = Token::parse(&text).unwrap();
        assert_eq!(token.kind, kind);
        assert!(token.endpoint.unwrap().type_name().is_err());
    }
}

#[test]
fn other_texts_are_refused_with_a_reason() {
    let refused = |text: &str| Token::parse(text).expect_err(text);
    assert_eq!(refused(""), TokenError::Admin);
    assert_eq!(refused("@ros2/0/a/0/0/NN/%/%/n"), TokenError::Admin);
    assert_eq!(refused("@ros2_lv/0/a/0/0/NN/%/%"), TokenError::Parts(8));
    let parts: Vec<&str> = TALKER.split('/').collect();
    for count in 9..13 {
        assert_eq!(refused(&parts[..count].join("/")), TokenError::Parts(count));
    }
    assert_eq!(refused(&TALKER.replace("/talker/", "//")), TokenError::Part("node"));
    assert_eq!(refused(&format!("{TALKER}/")), TokenError::Part("backends:"));
    assert_eq!(refused(&TALKER.replace("/MP/", "/XX/")), TokenError::Kind);
    assert_eq!(refused(&TALKER.replace("lv/0/", "lv/zero/")), TokenError::Domain);
    assert_eq!(refused(&TALKER.replace("::,7", "9::,7")), TokenError::Qos(QosError("reliability")));
    let long = format!("{TALKER}/{}", "x".repeat(MAX_TOKEN_BYTES - TALKER.len() - 1));
    assert!(Token::parse(&long).is_ok());
    assert_eq!(refused(&format!("{long}x")), TokenError::TooLong(MAX_TOKEN_BYTES + 1));
}

#[test]
fn parts_that_make_no_key_are_not_written() {
    let wrong = |change: fn(&mut Token)| {
        let mut token = publisher();
        change(&mut token);
        token.to_key().unwrap_err()
    };
    assert_eq!(wrong(|t| t.node = String::new()), TokenError::Part("node"));
    assert_eq!(wrong(|t| t.node = "a%b".into()), TokenError::Part("node"));
    assert_eq!(wrong(|t| t.namespace = "/*".into()), TokenError::Part("namespace"));
    assert_eq!(wrong(|t| t.zid = "a$".into()), TokenError::Part("zid"));
    assert_eq!(wrong(|t| t.endpoint = None), TokenError::Endpoint);
    assert_eq!(wrong(|t| t.kind = EntityKind::Node), TokenError::Endpoint);
    let backends = |t: &mut Token| t.endpoint.as_mut().unwrap().backends = Some(String::new());
    assert_eq!(wrong(backends), TokenError::Part("backends"));
    assert!(matches!(wrong(|t| t.node = "n".repeat(MAX_TOKEN_BYTES)), TokenError::TooLong(_)));
}

#[test]
fn qualities_of_service_are_those_of_rmw_zenoh() {
    for (qos, text) in [
        (Qos::default(), "::,:,:,:,,"),
        (Qos::reliable(10), "::,10:,:,:,,"),
        (Qos::sensor_data(), "2::,5:,:,:,,"),
        (Qos::latched(1), ":1:,1:,:,:,,"),
    ] {
        assert_eq!(qos.to_string(), text);
        assert_eq!(Qos::parse(text), Ok(qos));
    }
    // Some releases write every field.
    let full = "1:2:1,42:9223372036,854775807:9223372036,854775807:1,9223372036,854775807";
    assert_eq!(Qos::parse(full), Ok(Qos::default()));
    let other = Qos {
        reliability: Reliability::SystemDefault,
        durability: Durability::BestAvailable,
        history: History::KeepAll,
        depth: 0,
        deadline: QosDuration { sec: 1, nsec: 0 },
        lifespan: QosDuration { sec: 9_223_372_036, nsec: 5 },
        liveliness: Liveliness::ManualByTopic,
        lease: QosDuration { sec: 0, nsec: 854_775_807 },
    };
    assert_eq!(other.to_string(), "0:4:2,0:1,0:,5:3,0,");
    assert_eq!(Qos::parse("0:4:2,0:1,0:,5:3,0,"), Ok(other));
    assert_eq!(Qos::parse("0:4:2,0:1,0:,5:3,0,:later"), Ok(other));
}

#[test]
fn qualities_of_service_of_other_forms_name_the_field() {
    for (text, field) in [
        ("", "durability"),
        ("::,:,:,", "liveliness"),
        ("::,:,:,:", "liveliness"),
        ("::,:,:,:,", "lease"),
        ("5::,:,:,:,,", "reliability"),
        (":x:,:,:,:,,", "durability"),
        ("::4,:,:,:,,", "history"),
        ("::1:,:,:,,", "history"),
        ("::,-1:,:,:,,", "depth"),
        ("::,:1:,:,,", "deadline"),
        ("::,:,:1 ,:,,", "lifespan"),
        ("::,:,:,:6,,", "liveliness"),
        ("::,:,:,:,99999999999999999999,", "lease"),
    ] {
        assert_eq!(Qos::parse(text), Err(QosError(field)), "{text}");
    }
}

#[test]
fn the_name_of_an_entity_is_the_hash_of_its_token() {
    assert_eq!(Gid::of_token(TALKER).to_string(), "eb85fa883b7846dc448a4501890ad062");
    assert_ne!(Gid::of_token(LISTENER), Gid::of_token(&LISTENER[..LISTENER.len() - 1]));
}
