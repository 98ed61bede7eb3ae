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
    assert_eq!(keys().all_frames(), "waymark/1/site-1/robot/*/frame/*");
}

#[test]
fn epochs_are_plain_numbers() {
    let parsed = |epoch: &str| keys().parse(&format!("waymark/1/site-1/robot/r1/alive/{epoch}"));
    let r1 = Name::new("r1").unwrap();
    assert_eq!(parsed("18446744073709551615"), Ok(Key::Alive(r1, Some(u64::MAX))));
    for text in ["", "x", "-1", "+1", "01", "18446744073709551616", "1/2"] {
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
    fn what_is_built_parses_back(a in names(), b in names(), fleet in names(), epoch: u64) {
        let keys = Keys::new(&fleet);
        for key in [
            Key::Frame(a.clone(), b.clone()),
            Key::Quads(a.clone(), b.clone()),
            Key::Answer(a.clone(), b.clone()),
            Key::Odometry(a.clone()),
            Key::Scan(a.clone()),
            Key::Pose(a.clone()),
            Key::Alive(a.clone(), None),
            Key::Alive(a.clone(), Some(epoch)),
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
