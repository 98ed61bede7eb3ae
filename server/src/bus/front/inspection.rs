//! What a connection sends, read by zenoh's own codec before a router gets it. In: batches of the transport. Out: what each of
//! them costs, or why the connection ends.
//!
//! A router panics where it forwards a key of more than 65 535 bytes, which a declared prefix and a suffix may make, and its
//! access control looks at a message after that. So the length of each declared key is kept here, and a key at most
//! [`MAX_KEY_BYTES`] long passes. Of a message in fragments, the first one names its key. What follows it is a fragment of the
//! same message for the router only if it goes on without a gap, so each gap ends the connection.

use std::collections::{BTreeMap, BTreeSet};
use zenoh_buffers::reader::DidntRead;
use zenoh_codec::{RCodec, Zenoh080, Zenoh080Bounded, Zenoh080Condition, transport::frame::FrameReader};
use zenoh_protocol::{
    common::imsg,
    core::{Field, Reliability, WireExpr},
    network::{
        DeclareBody, Mapping, NetworkBody, NetworkMessage, RequestId, id, interest::InterestMode, push::flag,
    },
    transport::{Fragment, InitSyn, TransportBody, TransportMessage},
};

/// Longest key, in bytes: names of ROS 2 with their types have some hundreds.
pub(crate) const MAX_KEY_BYTES: usize = 4096;
/// Most declared keys, subscriptions, queryables, tokens and lasting interests of one connection together. A router of ROS 2
/// on a robot has some hundreds.
pub(crate) const MAX_DECLARED: usize = 4096;
/// Largest sequence number that a router agrees to.
const MAX_SN: u64 = u32::MAX as u64;

/// Why a connection ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub(crate) enum Violation {
    #[error("a key is longer than {MAX_KEY_BYTES} bytes")]
    LongKey,
    #[error("more than {MAX_DECLARED} keys, subscriptions, queryables, tokens and interests are declared")]
    ManyDeclared,
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
}

/// What is known of a connection. At most [`MAX_DECLARED`] entries of the robot, as many keys as the router declares (65 536 at
/// most), and one message in fragments of each priority.
#[derive(Debug, Default)]
pub(super) struct Inspection {
    agreed: Option<Agreed>,
    /// Length of each key that the robot has declared, in bytes. One that is declared again counts with the longer.
    keys: BTreeMap<u16, usize>,
    /// The same of the router. One that ends is kept: the robot may have used it before it knew.
    router_keys: BTreeMap<u16, usize>,
    declared: BTreeSet<(Kind, u32)>,
    /// Sequence number of the next fragment, by reliability and priority.
    fragmented: BTreeMap<(bool, u8), u64>,
}

impl Inspection {
    /// Reads a batch of the router for the keys that it declares, on which those of the robot may rest.
    pub(super) fn of_router(&mut self, mut batch: &[u8]) {
        while let Some(first) = batch.first()
            && imsg::mid(*first) == zenoh_protocol::transport::id::FRAME
        {
            let Ok(frame) = opened(&mut batch) else { return };
            for message in frame {
                if let NetworkBody::Declare(declare) = &message.body
                    && let DeclareBody::DeclareKeyExpr(it) = &declare.body
                {
                    let prefix = self.keys.get(&it.wire_expr.scope).copied().unwrap_or_default();
                    let longest = self.router_keys.entry(it.id).or_default();
                    *longest = (prefix + it.wire_expr.suffix.len()).max(*longest);
                }
            }
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
        self.key(&key?).map(|_| ())
    }

    fn message(&mut self, message: &NetworkMessage, cost: &mut Cost) -> Result<(), Violation> {
        let (key, declared) = match &message.body {
            NetworkBody::Push(push) => (Some(&push.wire_expr), None),
            NetworkBody::Request(request) => (Some(&request.wire_expr), None),
            NetworkBody::Response(response) => (Some(&response.wire_expr), None),
            NetworkBody::ResponseFinal(_) | NetworkBody::OAM(_) => (None, None),
            NetworkBody::Interest(interest) => {
                cost.declarations += 1;
                let lasts = matches!(interest.mode, InterestMode::Future | InterestMode::CurrentFuture);
                let change = (lasts || interest.mode == InterestMode::Final).then_some(lasts);
                (interest.wire_expr.as_ref(), change.map(|begins| (Kind::Interest, interest.id, begins)))
            }
            NetworkBody::Declare(declare) => {
                cost.declarations += 1;
                match &declare.body {
                    DeclareBody::DeclareKeyExpr(it) => {
                        let bytes = self.key(&it.wire_expr)?;
                        let longest = self.keys.entry(it.id).or_default();
                        *longest = bytes.max(*longest);
                        (None, None)
                    }
                    DeclareBody::UndeclareKeyExpr(it) => {
                        self.keys.remove(&it.id);
                        (None, None)
                    }
                    DeclareBody::DeclareFinal(_) => (None, None),
                    DeclareBody::DeclareSubscriber(it) => {
                        (Some(&it.wire_expr), Some((Kind::Subscriber, it.id, true)))
                    }
                    DeclareBody::UndeclareSubscriber(it) => {
                        (Some(&it.ext_wire_expr.wire_expr), Some((Kind::Subscriber, it.id, false)))
                    }
                    DeclareBody::DeclareQueryable(it) => {
                        (Some(&it.wire_expr), Some((Kind::Queryable, it.id, true)))
                    }
                    DeclareBody::UndeclareQueryable(it) => {
                        (Some(&it.ext_wire_expr.wire_expr), Some((Kind::Queryable, it.id, false)))
                    }
                    DeclareBody::DeclareToken(it) => (Some(&it.wire_expr), Some((Kind::Token, it.id, true))),
                    DeclareBody::UndeclareToken(it) => {
                        (Some(&it.ext_wire_expr.wire_expr), Some((Kind::Token, it.id, false)))
                    }
                }
            }
        };
        if matches!(message.body, NetworkBody::Push(_) | NetworkBody::Request(_) | NetworkBody::Response(_)) {
            cost.messages += 1;
        }
        if let Some(key) = key {
            self.key(key)?;
        }
        match declared {
            Some((kind, id, true)) => {
                self.declared.insert((kind, id));
            }
            Some((kind, id, false)) => {
                self.declared.remove(&(kind, id));
            }
            None => {}
        }
        if self.declared.len() + self.keys.len() > MAX_DECLARED {
            return Err(Violation::ManyDeclared);
        }
        Ok(())
    }

    /// Length of a key. The prefix of one that is declared is always of the other end: zenoh writes no mapping there.
    fn key(&self, key: &WireExpr<'_>) -> Result<usize, Violation> {
        let prefix = match key.mapping {
            _ if key.scope == 0 => 0,
            Mapping::Sender => self.keys.get(&key.scope).copied().unwrap_or_default(),
            Mapping::Receiver => *self.router_keys.get(&key.scope).ok_or(Violation::Protocol)?,
        };
        let bytes = prefix + key.suffix.len();
        if bytes > MAX_KEY_BYTES { Err(Violation::LongKey) } else { Ok(bytes) }
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
            sn_mask: syn.resolution.get(Field::FrameSN).mask().min(MAX_SN),
        }
    }
}
