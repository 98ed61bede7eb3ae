use super::*;
use proptest::prelude::*;

fn keys() -> Keys {
    Keys::new(&Name::new("site-1").unwrap())
}

fn names() -> impl Strategy<Value = Name> {
    "[a-z0-9_-]{1,64}".prop_map(|text| Name::new(text).unwrap())
}

#[test]
fn names_at_the_bound() {
    assert!(Name::new("a".repeat(MAX_NAME_BYTES)).is_ok());
    assert_eq!(Name::new("a".repeat(MAX_NAME_BYTES + 1)), Err(NameError::Length(MAX_NAME_BYTES + 1)));
    assert_eq!(Name::new(""), Err(NameError::Length(0)));
    for (text, position) in
        [("a/b", 1), ("*", 0), ("ab$", 2), ("A", 0), ("é", 0), ("a b", 1), ("a#", 1), ("@a", 0)]
    {
        assert_eq!(Name::new(text), Err(NameError::Character(position)), "{text}");
    }
}

#[test]
fn a_key_reads_as_written_down() {
    let key = Key::Frame(Name::new("r1").unwrap(), Name::new("front").unwrap());
    assert_eq!(keys().build(&key), "waymark/1/site-1/robot/r1/frame/front");
    assert_eq!(keys().all_frames(), "waymark/1/site-1/robot/*/frame");
}

#[test]
fn on_the_wire_the_camera_is_attached() {
    let key = Key::Quads(Name::new("r1").unwrap(), Name::new("front").unwrap());
    let wire = "waymark/1/site-1/robot/r1/quads";
    assert_eq!(keys().on_wire(&key), (wire.to_owned(), Some("front")));
    assert_eq!(keys().received(wire, Some(b"front")), Ok(key));
    let long = [b'a'; MAX_NAME_BYTES + 1];
    for attached in [None, Some(&b""[..]), Some(b"a/b"), Some(b"\xff"), Some(&long)] {
        assert!(keys().received(wire, attached).is_err(), "{attached:?}");
    }
    // The full key is none of the wire, and nothing else takes an attachment.
    assert_eq!(keys().received("waymark/1/site-1/robot/r1", Some(b"scan")), Err(KeyError::Shape));
    assert!(keys().received("waymark/1/site-1/robot/r1/scan", Some(b"front")).is_ok());
    let of_map = "waymark/1/site-1/server/s1/holds/frame";
    assert_eq!(keys().received(of_map, None), keys().parse(of_map), "a map of that name");
}

#[test]
fn slots_of_tokens_are_plain_numbers() {
    let parsed = |slot: &str| keys().parse(&format!("waymark/1/site-1/robot/r1/alive/{slot}"));
    let r1 = Name::new("r1").unwrap();
    assert_eq!(parsed("15"), Ok(Key::Alive(r1, alive_slot(u64::MAX))));
    for text in ["", "x", "-1", "+1", "01", "16", "18446744073709551616", "1/2"] {
        assert_eq!(parsed(text), Err(KeyError::Shape), "{text}");
    }
}

#[test]
fn foreign_and_crooked_keys_are_refused() {
    let k = keys();
    assert!(matches!(k.parse("waymark/2/site-1/robot/r1/scan"), Err(KeyError::Prefix(_))));
    assert!(matches!(k.parse("waymark/1/other/robot/r1/scan"), Err(KeyError::Prefix(_))));
    assert_eq!(k.parse("waymark/1/site-1/robot/r1/scan/x"), Err(KeyError::Shape));
    assert_eq!(k.parse("waymark/1/site-1/robot/r1/frame/a/b"), Err(KeyError::Shape));
    assert!(matches!(
        k.parse("waymark/1/site-1/robot/R1/frame/a"),
        Err(KeyError::Name { chunk: "robot", error: NameError::Character(0) })
    ));
    assert!(matches!(
        k.parse("waymark/1/site-1/robot/r1/frame/"),
        Err(KeyError::Name { chunk: "camera", .. })
    ));
}

proptest! {
    #[test]
    fn what_is_built_parses_back(a in names(), b in names(), fleet in names(), slot in 0..ALIVE_SLOTS, epoch: u64) {
        let keys = Keys::new(&fleet);
        for key in [
            Key::Frame(a.clone(), b.clone()),
            Key::Quads(a.clone(), b.clone()),
            Key::Answer(a.clone(), b.clone()),
            Key::Odometry(a.clone()),
            Key::Scan(a.clone()),
            Key::Pose(a.clone()),
            Key::Alive(a.clone(), slot),
            Key::MapChanged(a.clone()),
            Key::MapVersion(a.clone()),
            Key::Gaze(a.clone()),
            Key::Hello(a.clone()),
            Key::Localise(a.clone()),
            Key::Server(a.clone(), ServerToken::Alive(epoch)),
            Key::Server(a.clone(), ServerToken::Holds(b.clone())),
            Key::Server(a.clone(), ServerToken::Serves(b.clone())),
            Key::Server(a.clone(), ServerToken::Robot(b.clone())),
        ] {
            prop_assert_eq!(keys.parse(&keys.build(&key)), Ok(key));
        }
    }

    #[test]
    fn what_parses_was_built(text in "waymark/1/site-1/(robot|map|server)/[a-zA-Z*/]{0,20}(/frame/|/scan|/changed|/version|/serves/|/)[a-z*]{0,3}") {
        if let Ok(key) = keys().parse(&text) {
            prop_assert_eq!(keys().build(&key), text);
        }
    }

    #[test]
    fn any_text_parses_or_errs(text in ".{0,200}") {
        let whole = format!("waymark/1/site-1/{text}");
        prop_assert!(keys().parse(&text).is_err());
        if let Ok(key) = keys().parse(&whole) {
            prop_assert_eq!(keys().build(&key), whole);
        }
    }
}
