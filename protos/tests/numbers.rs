//! Numbers that are none, too large, too small or too precise, in every numeric field of every
//! message that a robot sends, as the descriptors list them: each message is accepted, or refused
//! with the field at fault or one around it.

use prost_reflect::{
    DescriptorPool, DynamicMessage, FieldDescriptor, Kind, MessageDescriptor, ReflectMessage as _, Value,
    prost::Message as _,
};
use protos::{
    CheckedFrame, FILE_DESCRIPTOR_SET, Rejection,
    convert::{CheckedGaze, CheckedLocalise, CheckedOdometry, CheckedScan},
    v1,
};

const REALS: [f64; 10] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    1e39,
    1e300,
    -1e300,
    -0.0,
    5e-324,
    9_007_199_254_740_993.0,
    -1.0,
];
const WHOLE: [i64; 6] = [0, -1, i64::MIN, i64::MAX, 9_007_199_254_740_993, 2_147_483_647];

/// Refused with another field than the one that was changed: sizes, encodings and bytes are
/// compared with the pixels.
const COMPARED: [&str; 4] = ["width_px", "height_px", "encoding", "withheld_bytes"];

/// Parts of a question where a robot is that have no meaning in it, and are not looked at.
const UNUSED: [[&str; 2]; 3] = [["frame", "odometry"], ["frame", "prior"], ["scan", "odom_from_robot"]];

fn frame() -> v1::Frame {
    let pose = v1::Pose2 { x_m: 1.0, y_m: 2.0, theta_rad: 0.5 };
    v1::Frame {
        epoch: 1,
        seq: 1,
        captured_ns: 1,
        encoding: v1::ImageEncoding::Gray8.into(),
        width_px: 4,
        height_px: 3,
        image: vec![0; 12].into(),
        intrinsics: Some(v1::Intrinsics {
            fx_px: 600.0,
            fy_px: 600.0,
            cx_px: 2.0,
            cy_px: 1.5,
            ..v1::Intrinsics::default()
        }),
        robot_from_camera: Some(v1::Pose3 { qw: 1.0, ..v1::Pose3::default() }),
        odometry: Some(pose),
        prior: Some(v1::Pose2Covariance {
            pose: Some(pose),
            covariance: vec![0.1, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.1],
        }),
        ..v1::Frame::default()
    }
}

fn scan() -> v1::Scan {
    v1::Scan {
        epoch: 1,
        seq: 1,
        odom_from_robot: Some(v1::Pose2::default()),
        robot_from_laser: Some(v1::Pose2::default()),
        first_bearing_rad: -1.0,
        bearing_step_rad: 0.5,
        max_range_m: 20.0,
        ranges_m: vec![1.0; 5],
        ..v1::Scan::default()
    }
}

fn quads() -> v1::Quads {
    let corner = |u_px: f64, v_px: f64| v1::Point { u_px, v_px };
    let found = v1::FoundQuad {
        border: Some(v1::Border {
            corners: vec![corner(8.0, 8.0), corner(40.0, 8.0), corner(40.0, 40.0), corner(8.0, 40.0)],
        }),
        corner_covariance_px2: [0.5, 0.0, 0.5].repeat(4),
        score: 0.9,
        patch: Some(v1::Patch {
            left_px: 0,
            top_px: 0,
            width_px: 48,
            height_px: 48,
            encoding: v1::ImageEncoding::Gray8.into(),
            image: vec![0; 48 * 48].into(),
        }),
        ..v1::FoundQuad::default()
    };
    v1::Quads { epoch: 1, seq: 1, width_px: 64, height_px: 48, quads: vec![found], ..v1::Quads::default() }
}

/// What is wrong with a message of these bytes.
type Judge = fn(&[u8]) -> Option<Rejection>;

fn judge<M, C>(bytes: &[u8]) -> Option<Rejection>
where
    M: protos::prost::Message + Default,
    C: TryFrom<M, Error = Rejection>,
{
    C::try_from(M::decode(bytes).expect("a message")).err()
}

struct Attacked {
    numbers: usize,
    refused: usize,
    wrong: Vec<String>,
}

/// Every value of a kind that is a number.
fn attacks(kind: &Kind) -> Vec<Value> {
    match kind {
        Kind::Double => REALS.map(Value::F64).to_vec(),
        Kind::Float => REALS.map(|x| Value::F32(x as f32)).to_vec(),
        Kind::Int32 | Kind::Sint32 | Kind::Sfixed32 => WHOLE.map(|n| Value::I32(n as i32)).to_vec(),
        Kind::Int64 | Kind::Sint64 | Kind::Sfixed64 => WHOLE.map(Value::I64).to_vec(),
        Kind::Uint32 | Kind::Fixed32 => WHOLE.map(|n| Value::U32(n as u32)).to_vec(),
        Kind::Uint64 | Kind::Fixed64 => WHOLE.map(|n| Value::U64(n as u64)).to_vec(),
        Kind::Enum(_) => WHOLE.map(|n| Value::EnumNumber(n as i32)).to_vec(),
        _ => Vec::new(),
    }
}

/// Gets a changed message, the path of what was changed, and its value.
type Send<'a> = dyn FnMut(DynamicMessage, &[String], Option<&Value>) + 'a;

/// Changes every number below `path`; `send` gets the changed part and gives what the whole is
/// refused with.
fn walk(part: &DynamicMessage, path: &[String], send: &mut Send<'_>) {
    for field in part.descriptor().fields() {
        let below: Vec<String> = path.iter().cloned().chain([field.name().to_owned()]).collect();
        if let Kind::Message(inner) = field.kind() {
            inside(part, (&field, &inner), &below, send);
            continue;
        }
        for value in attacks(&field.kind()) {
            let mut changed = part.clone();
            if field.is_list() {
                let mut list = part.get_field(&field).as_list().map(<[Value]>::to_vec).unwrap_or_default();
                match list.last_mut() {
                    Some(last) => *last = value.clone(),
                    None => list.push(value.clone()),
                }
                changed.set_field(&field, Value::List(list));
            } else {
                changed.set_field(&field, value.clone());
            }
            send(changed, &below, Some(&value));
        }
    }
}

/// The numbers of a message in a field; one that is absent is made.
fn inside(
    part: &DynamicMessage,
    (field, inner): (&FieldDescriptor, &MessageDescriptor),
    below: &[String],
    send: &mut Send<'_>,
) {
    let mut list = part.get_field(field).as_list().map(<[Value]>::to_vec).unwrap_or_default();
    let present = if field.is_list() { list.pop() } else { Some(part.get_field(field).into_owned()) };
    let message = present.and_then(|value| value.as_message().cloned());
    let message = message.unwrap_or_else(|| DynamicMessage::new(inner.clone()));
    walk(&message, below, &mut |changed, path, value| {
        let mut whole = part.clone();
        if field.is_list() {
            let items = list.iter().cloned().chain([Value::Message(changed)]).collect();
            whole.set_field(field, Value::List(items));
        } else {
            whole.set_field(field, Value::Message(changed));
        }
        send(whole, path, value);
    });
}

/// Whether the field of a refusal is the one at `path`, one around it or one inside of the same
/// message.
fn names(field: &str, path: &[String]) -> bool {
    let first = field.split(['.', '[']).next().unwrap_or_default();
    first == path[0] || path.iter().any(|part| COMPARED.contains(&part.as_str()))
}

fn attack(name: &str, good: &[u8], judge: Judge, told: &mut Attacked) {
    let pool = DescriptorPool::decode(FILE_DESCRIPTOR_SET).expect("descriptors");
    let kind = pool.get_message_by_name(&format!("waymark.v1.{name}")).expect("a message");
    assert!(judge(good).is_none(), "{name}: {:?}", judge(good));
    let base = DynamicMessage::decode(kind, good).expect("a message");
    walk(&base, &[], &mut |changed, path, value| {
        told.numbers += 1;
        let what = format!("{name}.{} = {value:?}", path.join("."));
        let not_finite = match value {
            Some(Value::F64(x)) => {
                !x.is_finite() && !UNUSED.iter().any(|part| path.starts_with(&part.map(str::to_owned)))
            }
            _ => false,
        };
        match judge(&changed.encode_to_vec()) {
            Some(refusal) if names(&refusal.field, path) => told.refused += 1,
            Some(refusal) => told.wrong.push(format!("{what}: {refusal:?}")),
            None if not_finite => told.wrong.push(format!("{what} is accepted")),
            None => {}
        }
    });
}

#[test]
fn every_number_of_every_message_is_accepted_or_refused_with_its_field() {
    let mut told = Attacked { numbers: 0, refused: 0, wrong: Vec::new() };
    let full =
        v1::LocaliseRequest { frame: Some(frame()), scan: Some(scan()), ..v1::LocaliseRequest::default() };
    let odometry = v1::Odometry { odom_from_robot: Some(v1::Pose2::default()), ..v1::Odometry::default() };
    attack("Frame", &frame().encode_to_vec(), judge::<v1::Frame, CheckedFrame>, &mut told);
    attack("Quads", &quads().encode_to_vec(), judge::<v1::Quads, CheckedFrame>, &mut told);
    attack("Scan", &scan().encode_to_vec(), judge::<v1::Scan, CheckedScan>, &mut told);
    attack("Odometry", &odometry.encode_to_vec(), judge::<v1::Odometry, CheckedOdometry>, &mut told);
    attack(
        "GazeRequest",
        &v1::GazeRequest::default().encode_to_vec(),
        judge::<v1::GazeRequest, CheckedGaze>,
        &mut told,
    );
    attack(
        "LocaliseRequest",
        &full.encode_to_vec(),
        judge::<v1::LocaliseRequest, CheckedLocalise>,
        &mut told,
    );
    let Attacked { numbers, refused, wrong } = told;
    assert!(wrong.is_empty(), "{} of {numbers}:\n{}", wrong.len(), wrong.join("\n"));
    assert!(numbers > 500 && refused > 250, "{numbers} numbers, {refused} refused");
}
