//! What a connection sends, read by zenoh's own codec before a router gets it. In: batches of the
//! transport. Out: what each of them costs, or why the connection ends.
//!
//! A router panics where it forwards a key of more than 65 535 bytes, which a declared prefix and a
//! suffix may make, and where it compares a key that is no key expression with peers; its access
//! control looks at a message after that. So each declared key is kept here, and of what a message
//! names, the whole must be a key expression of at most [`MAX_KEY_BYTES`]. Of a message in
//! fragments, the first one names its key. What follows it is a fragment of the same message for
//! the router only if it goes on without a gap, so each gap ends the connection.

use super::lasting::{InterestKeys, MAX_INTEREST_BYTES};
use std::{
    collections::{BTreeMap, BTreeSet, btree_map::Entry},
    sync::Arc,
};
use zenoh::key_expr::keyexpr;
use zenoh_buffers::reader::DidntRead;
use zenoh_codec::{RCodec, Zenoh080, Zenoh080Bounded, Zenoh080Condition, transport::frame::FrameReader};
use zenoh_protocol::{
    common::imsg,
    core::{Field, Reliability, WhatAmI, WireExpr},
    network::{
        DeclareBody, Mapping, NetworkBody, NetworkMessage, RequestId, id, interest::InterestMode, push::flag,
    },
    transport::{Fragment, InitSyn, TransportBody, TransportMessage},
};

/// Longest key, in bytes: names of ROS 2 with their types have some hundreds.
pub(crate) const MAX_KEY_BYTES: usize = 4096;
/// Most declared keys, subscriptions, queryables, tokens and lasting interests of one connection
/// together. A router of ROS 2 on a robot has some hundreds.
pub(crate) const MAX_DECLARED: usize = 4096;
/// Most bytes of the keys of all these.
pub(crate) const MAX_DECLARED_BYTES: usize = 1 << 20;
/// Most bytes of the keys of a router that are kept. What rests on a further one ends the
/// connection.
pub(crate) const MAX_ROUTER_KEY_BYTES: usize = 4 << 20;
/// Largest sequence number that a router agrees to.
const MAX_SN: u64 = u32::MAX as u64;

/// Why a connection ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub(crate) enum Violation {
    #[error("a key is longer than {MAX_KEY_BYTES} bytes")]
    LongKey,
    #[error("a key is no key expression of zenoh")]
    BadKey,
    #[error(
        "more than {MAX_DECLARED} keys, subscriptions, queryables, tokens and interests are declared, or {MAX_DECLARED_BYTES} \
         bytes of them"
    )]
    ManyDeclared,
    #[error(
        "it has been interested in so many different keys that a router would keep more than {MAX_INTEREST_BYTES} bytes of them"
    )]
    ManyInterests,
    #[error("what it sends is not zenoh's protocol, or in an order that no client of zenoh sends")]
    Protocol,
    #[error(
        "its zenoh does not mark first fragments, so that keys of long messages cannot be checked: zenoh 1.1 or later does"
    )]
    UnmarkedFragments,
}

impl From<DidntRead> for Violation {
    fn from(_: DidntRead) -> Self {
        Self::Protocol
    }
}

/// What a batch asks of a router.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Cost {
    /// Declarations, and their ends.
    pub(super) declarations: usize,
    /// Data, questions and replies.
    pub(super) messages: usize,
}

/// What is declared, each with identifiers of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Subscriber,
    Queryable,
    Token,
    Interest,
}

/// What was agreed when the transport was opened.
#[derive(Debug, Clone, Copy)]
struct Agreed {
    has_markers: bool,
    sn_mask: u64,
    /// A router declares all that it tells of others with the number 0: each is known by its key.
    is_router: bool,
}

/// What is known of a connection. At most [`MAX_DECLARED`] entries of the robot,
/// [`MAX_ROUTER_KEY_BYTES`] of keys of the router, and one message in fragments of each priority.
#[derive(Debug, Default)]
pub(super) struct Inspection {
    agreed: Option<Agreed>,
    /// The keys that the robot has declared.
    keys: BTreeMap<u16, Box<str>>,
    /// Those of the router. One that ends is kept: the robot may have used it before it knew.
    router_keys: BTreeMap<u16, Box<str>>,
    router_key_bytes: usize,
    /// What the robot has declared, and its keys: one, or those of the number 0 of a router.
    declared: BTreeMap<(Kind, u32), BTreeSet<Box<str>>>,
    declared_count: usize,
    /// Bytes of the keys of all.
    declared_bytes: usize,
    interests: Arc<InterestKeys>,
    /// Sequence number of the next fragment, by reliability and priority.
    fragmented: BTreeMap<(bool, u8), u64>,
}

impl Inspection {
    pub(super) fn new(interests: Arc<InterestKeys>) -> Self {
        Self { interests, ..Self::default() }
    }

    /// Reads a batch of the router for the keys that it declares, on which those of the robot may
    /// rest.
    pub(super) fn of_router(&mut self, mut batch: &[u8]) {
        while let Some(first) = batch.first()
            && imsg::mid(*first) == zenoh_protocol::transport::id::FRAME
        {
            let Ok(frame) = opened(&mut batch) else { return };
            for message in frame {
                if let NetworkBody::Declare(declare) = &message.body
                    && let DeclareBody::DeclareKeyExpr(it) = &declare.body
                {
                    let prefix = self.keys.get(&it.wire_expr.scope).map_or("", |key| key);
                    self.router_declares(it.id, [prefix, &it.wire_expr.suffix].concat());
                }
            }
        }
    }

    fn router_declares(&mut self, id: u16, key: String) {
        self.router_key_bytes += key.len();
        self.router_key_bytes -= self.router_keys.remove(&id).map_or(0, |before| before.len());
        if self.router_key_bytes > MAX_ROUTER_KEY_BYTES {
            self.router_key_bytes -= key.len();
        } else {
            self.router_keys.insert(id, key.into());
        }
    }

    /// Reads a batch of the robot whole.
    pub(super) fn batch(&mut self, mut batch: &[u8]) -> Result<Cost, Violation> {
        let mut cost = Cost::default();
        while !batch.is_empty() {
            let before = batch.len();
            if imsg::mid(batch[0]) == zenoh_protocol::transport::id::FRAME {
                self.frame(&mut batch, &mut cost)?;
            } else {
                let message: Result<TransportMessage, DidntRead> = Zenoh080.read(&mut batch);
                self.transport(message?.body, &mut cost)?;
            }
            if batch.len() == before {
                return Err(Violation::Protocol);
            }
        }
        Ok(cost)
    }

    fn frame(&mut self, batch: &mut &[u8], cost: &mut Cost) -> Result<(), Violation> {
        if self.agreed.is_none() {
            return Err(Violation::Protocol);
        }
        for message in opened(batch)? {
            self.message(&message, cost)?;
        }
        Ok(())
    }

    fn transport(&mut self, body: TransportBody, cost: &mut Cost) -> Result<(), Violation> {
        match (body, self.agreed) {
            (TransportBody::InitSyn(syn), None) => self.agreed = Some(Agreed::of(&syn)),
            (TransportBody::Fragment(fragment), Some(agreed)) => self.fragment(&fragment, agreed, cost)?,
            (TransportBody::OpenSyn(_) | TransportBody::KeepAlive(_) | TransportBody::OAM(_), Some(_))
            | (TransportBody::Close(_), _) => {}
            _ => return Err(Violation::Protocol),
        }
        Ok(())
    }

    fn fragment(&mut self, fragment: &Fragment, agreed: Agreed, cost: &mut Cost) -> Result<(), Violation> {
        if !agreed.has_markers {
            return Err(Violation::UnmarkedFragments);
        }
        let channel = (fragment.reliability == Reliability::Reliable, fragment.ext_qos.priority() as u8);
        let sn = u64::from(fragment.sn) & agreed.sn_mask;
        if fragment.ext_first.is_some() {
            self.first(&fragment.payload)?;
            cost.messages += 1;
        } else if self.fragmented.get(&channel) != Some(&sn) {
            return Err(Violation::Protocol);
        }
        if fragment.more && fragment.ext_drop.is_none() {
            self.fragmented.insert(channel, (sn + 1) & agreed.sn_mask);
        } else {
            self.fragmented.remove(&channel);
        }
        Ok(())
    }

    /// The head of a message in fragments: data, a question or a reply. Nothing else is so long.
    fn first(&mut self, mut payload: &[u8]) -> Result<(), Violation> {
        let key: Result<WireExpr<'static>, DidntRead> = (|| {
            let header: u8 = Zenoh080.read(&mut payload)?;
            match imsg::mid(header) {
                id::PUSH => {}
                id::REQUEST | id::RESPONSE => {
                    let _: RequestId = Zenoh080Bounded::<RequestId>::new().read(&mut payload)?;
                }
                _ => return Err(DidntRead),
            }
            // The flags of all three are those of a push.
            let mut key: WireExpr<'static> =
                Zenoh080Condition::new(imsg::has_flag(header, flag::N)).read(&mut payload)?;
            if imsg::has_flag(header, flag::M) {
                key.mapping = Mapping::Sender;
            }
            Ok(key)
        })();
        self.named(&key?).map(|_| ())
    }

    fn message(&mut self, message: &NetworkMessage, cost: &mut Cost) -> Result<(), Violation> {
        match &message.body {
            NetworkBody::Push(push) => self.data(&push.wire_expr, cost),
            NetworkBody::Request(request) => self.data(&request.wire_expr, cost),
            NetworkBody::Response(response) => self.data(&response.wire_expr, cost),
            NetworkBody::ResponseFinal(_) | NetworkBody::OAM(_) => Ok(()),
            NetworkBody::Interest(interest) => {
                cost.declarations += 1;
                let key = interest.wire_expr.as_ref().map_or(Ok(String::new()), |key| self.named(key))?;
                if interest.mode != InterestMode::Final && !self.interests.may_name(&key) {
                    return Err(Violation::ManyInterests);
                }
                match interest.mode {
                    InterestMode::Future | InterestMode::CurrentFuture => {
                        self.begins(Kind::Interest, interest.id, key)
                    }
                    InterestMode::Final => {
                        self.ends(Kind::Interest, interest.id, "");
                        Ok(())
                    }
                    InterestMode::Current => Ok(()),
                }
            }
            NetworkBody::Declare(declare) => {
                cost.declarations += 1;
                self.declaration(&declare.body)
            }
        }
    }

    fn data(&self, key: &WireExpr<'_>, cost: &mut Cost) -> Result<(), Violation> {
        cost.messages += 1;
        self.named(key).map(|_| ())
    }

    fn declaration(&mut self, body: &DeclareBody) -> Result<(), Violation> {
        match body {
            DeclareBody::DeclareKeyExpr(it) => self.key_begins(it.id, &it.wire_expr),
            DeclareBody::UndeclareKeyExpr(it) => {
                self.declared_bytes -= self.keys.remove(&it.id).map_or(0, |key| key.len());
                Ok(())
            }
            DeclareBody::DeclareFinal(_) => Ok(()),
            DeclareBody::DeclareSubscriber(it) => {
                self.begins(Kind::Subscriber, it.id, self.named(&it.wire_expr)?)
            }
            DeclareBody::DeclareQueryable(it) => {
                self.begins(Kind::Queryable, it.id, self.named(&it.wire_expr)?)
            }
            DeclareBody::DeclareToken(it) => self.begins(Kind::Token, it.id, self.named(&it.wire_expr)?),
            DeclareBody::UndeclareSubscriber(it) => {
                self.ends_named(Kind::Subscriber, it.id, &it.ext_wire_expr.wire_expr)
            }
            DeclareBody::UndeclareQueryable(it) => {
                self.ends_named(Kind::Queryable, it.id, &it.ext_wire_expr.wire_expr)
            }
            DeclareBody::UndeclareToken(it) => {
                self.ends_named(Kind::Token, it.id, &it.ext_wire_expr.wire_expr)
            }
        }
    }

    /// A key that is declared twice stays what it was for a router, and no client of zenoh does
    /// that.
    fn key_begins(&mut self, id: u16, key: &WireExpr<'_>) -> Result<(), Violation> {
        let Some(whole) = self.whole(key)? else { return Ok(()) };
        match self.keys.entry(id) {
            Entry::Occupied(before) if **before.get() != *whole => return Err(Violation::Protocol),
            Entry::Occupied(_) => {}
            Entry::Vacant(place) => {
                self.declared_bytes += whole.len();
                place.insert(whole.into());
            }
        }
        self.is_within_bounds()
    }

    /// A router keeps for ever what was declared before with the same number, if that had another
    /// key. No client of zenoh uses a number again before its end.
    fn begins(&mut self, kind: Kind, id: u32, key: String) -> Result<(), Violation> {
        let of_router = self.of_router_without_number(id);
        let keys = self.declared.entry((kind, id)).or_default();
        if !keys.contains(&*key) {
            if !keys.is_empty() && !of_router {
                return Err(Violation::Protocol);
            }
            self.declared_count += 1;
            self.declared_bytes += key.len();
            keys.insert(key.into());
        }
        self.is_within_bounds()
    }

    fn of_router_without_number(&self, id: u32) -> bool {
        id == 0 && self.agreed.is_some_and(|agreed| agreed.is_router)
    }

    /// A router's end without a number names its key in `key`; one that does not ends nothing.
    fn ends(&mut self, kind: Kind, id: u32, key: &str) {
        let of_router = self.of_router_without_number(id);
        let Entry::Occupied(mut keys) = self.declared.entry((kind, id)) else { return };
        let ended = if of_router { keys.get_mut().take(key).into_iter().collect() } else { keys.remove() };
        self.declared_count -= ended.len();
        self.declared_bytes -= ended.iter().map(|key| key.len()).sum::<usize>();
    }

    /// The end of a declaration may name its key, and need not.
    fn ends_named(&mut self, kind: Kind, id: u32, key: &WireExpr<'_>) -> Result<(), Violation> {
        let is_named = key.scope != 0 || !key.suffix.is_empty();
        let key = if is_named { self.named(key)? } else { String::new() };
        self.ends(kind, id, &key);
        Ok(())
    }

    fn is_within_bounds(&self) -> Result<(), Violation> {
        let count = self.declared_count + self.keys.len();
        if count > MAX_DECLARED || self.declared_bytes > MAX_DECLARED_BYTES {
            return Err(Violation::ManyDeclared);
        }
        Ok(())
    }

    /// A key that is named; empty if it rests on what has ended.
    fn named(&self, key: &WireExpr<'_>) -> Result<String, Violation> {
        self.whole(key).map(Option::unwrap_or_default)
    }

    /// The whole of a key, with its prefix; `None` if that has ended, which the end may have
    /// overtaken. The prefix of one that is declared is always of the other end: zenoh writes no
    /// mapping there.
    fn whole(&self, key: &WireExpr<'_>) -> Result<Option<String>, Violation> {
        let prefix = match key.mapping {
            _ if key.scope == 0 => "",
            Mapping::Sender => match self.keys.get(&key.scope) {
                Some(prefix) => prefix,
                None => return Ok(None),
            },
            Mapping::Receiver => self.router_keys.get(&key.scope).ok_or(Violation::Protocol)?,
        };
        if prefix.len() + key.suffix.len() > MAX_KEY_BYTES {
            return Err(Violation::LongKey);
        }
        let whole = [prefix, &key.suffix].concat();
        if keyexpr::new(&whole).is_ok() { Ok(Some(whole)) } else { Err(Violation::BadKey) }
    }
}

/// The messages of the frame at the front of a batch. They are behind it once they are read.
fn opened<'a, 'b>(batch: &'a mut &'b [u8]) -> Result<FrameReader<'a, &'b [u8]>, DidntRead> {
    Zenoh080.read(batch)
}

impl Agreed {
    /// What a router with zenoh's own settings agrees to.
    fn of(syn: &InitSyn) -> Self {
        Self {
            has_markers: syn.ext_patch.has_fragmentation_markers(),
            is_router: syn.whatami == WhatAmI::Router,
            sn_mask: syn.resolution.get(Field::FrameSN).mask().min(MAX_SN),
        }
    }
}
