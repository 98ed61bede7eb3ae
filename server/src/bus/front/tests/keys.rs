//! Keys of a robot's messages, as the inspection takes them, and their bounds.

use super::*;

#[test]
fn a_key_is_as_long_as_its_declared_prefix_and_its_suffix() {
    for at in 0..named(&key(0, 0)).len() {
        for (prefix, suffix, passes) in [
            (0, MAX_KEY_BYTES, true),
            (0, MAX_KEY_BYTES + 1, false),
            (4000, MAX_KEY_BYTES - 4000, true),
            (4000, MAX_KEY_BYTES - 3999, false),
        ] {
            let mut inspection = opened();
            if prefix > 0 {
                let declared = frame([declared_key(3, key(0, prefix))]);
                assert!(inspection.batch(&declared).is_ok());
                // Of the two ends, what is declared rests on the other's keys.
                inspection.of_router(&declared);
            }
            let asked = named(&key(if prefix == 0 { 0 } else { 3 }, suffix)).swap_remove(at);
            let said = inspection.batch(&frame([asked.clone()]));
            assert_eq!(said.is_ok(), passes, "{prefix} {suffix} {asked:?}");
            assert!(passes || said == Err(Violation::LongKey));
        }
    }
}

/// Each end rests its keys on those that the other has declared.
#[test]
fn keys_that_rest_on_one_another_do_not_grow_beyond_the_bound() {
    let mut inspection = opened();
    assert!(inspection.batch(&frame([declared_key(1, key(0, 2000))])).is_ok());
    inspection.of_router(&frame([declared_key(7, key(1, 1000))]));
    assert!(inspection.batch(&frame([declared_key(2, key(7, 1096))])).is_ok());
    assert_eq!(inspection.batch(&frame([declared_key(3, key(7, 1097))])), Err(Violation::LongKey));
    let of_router = |length| WireExpr { mapping: Mapping::Receiver, ..key(7, length) };
    assert!(inspection.batch(&frame([put(of_router(1096), 1)])).is_ok());
    assert_eq!(inspection.batch(&frame([put(of_router(1097), 1)])), Err(Violation::LongKey));
    // It has declared no such key.
    assert_eq!(inspection.batch(&frame([declared_key(4, key(8, 1))])), Err(Violation::Protocol));
}

/// A router takes the parts of a key for key expressions, wherever they come from.
#[test]
fn the_whole_of_a_key_is_a_key_expression() {
    let said = |parts: &[&str]| {
        let mut inspection = opened();
        let (last, prefixes) = parts.split_last().unwrap();
        let wire = |scope, part: &str| WireExpr { scope, ..WireExpr::from(part.to_owned()) };
        for (at, prefix) in prefixes.iter().enumerate() {
            // What is declared rests on a key of the other end.
            inspection.of_router(&frame([declared_key(at as u16 + 1, wire(at as u16, prefix))]));
            inspection.batch(&frame([declared_key(at as u16 + 1, wire(at as u16, prefix))]))?;
        }
        let scope = prefixes.len() as u16;
        for named in named(&wire(scope, last)).into_iter().take(4) {
            inspection.batch(&frame([named]))?;
        }
        Ok(())
    };
    for good in [&["a/b"][..], &["a", "/b"], &["a", "b"], &["a", "/b", "c/**"], &["a/*/b$*c/@d"]] {
        assert_eq!(said(good), Ok(()), "{good:?}");
    }
    let bad: [&[&str]; 10] = [
        &[""],
        &["/a"],
        &["a/"],
        &["a//b"],
        &["a#"],
        &["a?b"],
        &["a*"],
        &["**/**"],
        &["a", "//b"],
        &["a", "/b", "/#"],
    ];
    for bad in bad {
        assert_eq!(said(bad), Err(Violation::BadKey), "{bad:?}");
    }
    let mut inspection = opened();
    assert!(inspection.batch(&frame([declared_key(1, key(0, 5)), declared_key(1, key(0, 5))])).is_ok());
    assert_eq!(inspection.batch(&frame([declared_key(1, key(0, 6))])), Err(Violation::Protocol));
    // Its declaration has ended: a router leaves it out.
    assert!(inspection.batch(&frame([put(key(2, 5), 1)])).is_ok());
}

#[test]
fn a_number_is_declared_again_with_the_same_key_alone() {
    for of in [
        |wire_expr| declare(DeclareBody::DeclareSubscriber(DeclareSubscriber { id: 4, wire_expr })),
        |wire_expr| declare(DeclareBody::DeclareToken(DeclareToken { id: 4, wire_expr })),
        |wire_expr: WireExpr<'static>| named(&wire_expr).swap_remove(2),
    ] {
        let mut inspection = opened();
        for _ in 0..2 {
            assert!(inspection.batch(&frame([of(key(0, 5))])).is_ok());
        }
        assert_eq!(inspection.batch(&frame([of(key(0, 6))])), Err(Violation::Protocol));
    }
}

#[test]
fn a_router_declares_what_others_have_without_a_number_and_each_counts() {
    let begins = |n: usize| {
        let it = DeclareSubscriber { id: 0, wire_expr: key(0, n) };
        frame([declare(DeclareBody::DeclareSubscriber(it))])
    };
    let ends = |n: usize| {
        let ext_wire_expr = declare::common::ext::WireExprType { wire_expr: key(0, n) };
        frame([declare(DeclareBody::UndeclareSubscriber(UndeclareSubscriber { id: 0, ext_wire_expr }))])
    };
    let mut inspection = Inspection::default();
    assert!(inspection.batch(&init_of(WhatAmI::Router, 1)).is_ok());
    for n in 1..=1000 {
        assert!(inspection.batch(&begins(n)).is_ok(), "{n}");
    }
    for n in 1..=990 {
        assert!(inspection.batch(&ends(n)).is_ok(), "{n}");
    }
    // Ten are left, also after ends of what is not there, or of nothing that is named.
    let ended = UndeclareSubscriber { id: 0, ext_wire_expr: declare::common::ext::WireExprType::null() };
    let unnamed = frame([declare(DeclareBody::UndeclareSubscriber(ended))]);
    assert!(inspection.batch(&ends(1)).is_ok() && inspection.batch(&unnamed).is_ok());
    for id in 1..=(MAX_DECLARED - 10) as u32 {
        assert!(inspection.batch(&frame([subscriber(id)])).is_ok(), "{id}");
    }
    assert_eq!(inspection.batch(&begins(1)), Err(Violation::ManyDeclared));
    let mut client = opened();
    assert!(client.batch(&begins(1)).is_ok());
    assert_eq!(client.batch(&begins(2)), Err(Violation::Protocol));
}

#[test]
fn interests_in_ever_new_keys_end_the_connection_and_the_same_ones_do_not() {
    let interest = |i: usize| {
        let wire_expr = WireExpr::from(format!("r1/{i:04}"));
        let NetworkBody::Interest(it) = named(&wire_expr.to_owned()).swap_remove(2) else {
            panic!("no interest")
        };
        // Begun, and ended.
        let ends = Interest { mode: InterestMode::Final, ..it.clone() };
        frame([NetworkBody::Interest(it), NetworkBody::Interest(ends)])
    };
    let mut inspection = opened();
    let last = (0..MAX_INTEREST_BYTES).find(|i| inspection.batch(&interest(*i)).is_err()).expect("a bound");
    assert_eq!(inspection.batch(&interest(last)), Err(Violation::ManyInterests));
    assert!((1000..4000).contains(&last), "{last}");
    for i in 0..last {
        assert!(inspection.batch(&interest(i)).is_ok(), "{i}");
    }
}

#[test]
fn the_bytes_of_declared_keys_are_bounded() {
    let of = |id, bytes| declare(DeclareBody::DeclareToken(DeclareToken { id, wire_expr: key(0, bytes) }));
    let mut inspection = opened();
    let most = (MAX_DECLARED_BYTES / MAX_KEY_BYTES) as u32;
    for id in 0..most {
        // Each twice: the same one again is no further one.
        for _ in 0..2 {
            assert!(inspection.batch(&frame([of(id, MAX_KEY_BYTES)])).is_ok());
        }
    }
    assert_eq!(inspection.batch(&frame([declared_key(1, key(0, 1))])), Err(Violation::ManyDeclared));
    let ended = UndeclareSubscriber { id: 5, ext_wire_expr: declare::common::ext::WireExprType::null() };
    let mut inspection = opened();
    for _ in 0..most {
        let begins = DeclareSubscriber { id: 5, wire_expr: key(0, MAX_KEY_BYTES) };
        let ends = DeclareBody::UndeclareSubscriber(ended.clone());
        let both = [declare(DeclareBody::DeclareSubscriber(begins)), declare(ends)];
        assert!(both.into_iter().all(|one| inspection.batch(&frame([one])).is_ok()));
    }
    assert!(inspection.batch(&frame([of(1, MAX_KEY_BYTES)])).is_ok(), "what has ended counts no more");
}

#[test]
fn what_is_declared_is_counted_at_its_bound_and_what_ends_is_not() {
    let mut inspection = opened();
    let all = |from: u32, to: u32| frame((from..to).map(subscriber));
    let most = MAX_DECLARED as u32;
    let half = most / 2;
    let declarations = |n: u32| Ok(Cost { declarations: n as usize, messages: 0 });
    assert_eq!(inspection.batch(&all(0, half)), declarations(half));
    assert_eq!(inspection.batch(&all(half, most)), declarations(most - half));
    // The same again is no further one.
    assert_eq!(inspection.batch(&all(0, 10)), declarations(10));
    let ended = UndeclareSubscriber { id: 5, ext_wire_expr: declare::common::ext::WireExprType::null() };
    assert!(inspection.batch(&frame([declare(DeclareBody::UndeclareSubscriber(ended))])).is_ok());
    assert!(inspection.batch(&frame([declared_key(1, key(0, 2))])).is_ok());
    let key_ended = DeclareBody::UndeclareKeyExpr(UndeclareKeyExpr { id: 1 });
    assert!(inspection.batch(&frame([declare(key_ended)])).is_ok());
    assert!(inspection.batch(&all(most, most + 1)).is_ok());
    assert_eq!(inspection.batch(&all(most + 1, most + 2)), Err(Violation::ManyDeclared));
}

#[test]
fn the_bytes_of_the_routers_keys_are_bounded_and_one_that_is_declared_again_counts_once() {
    let mut inspection = opened();
    let most = (MAX_ROUTER_KEY_BYTES / MAX_KEY_BYTES) as u16;
    for id in 1..=most {
        for _ in 0..2 {
            inspection.of_router(&frame([declared_key(id, key(0, MAX_KEY_BYTES))]));
        }
    }
    inspection.of_router(&frame([declared_key(most + 1, key(0, 1))]));
    let on = |id| frame([put(WireExpr { mapping: Mapping::Receiver, ..key(id, 0) }, 1)]);
    assert!(inspection.batch(&on(most)).is_ok());
    assert_eq!(inspection.batch(&on(most + 1)), Err(Violation::Protocol));
}
