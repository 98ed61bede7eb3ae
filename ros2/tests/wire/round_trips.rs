//! Claim: what is written is read again, for messages of any content, in both byte orders; and
//! bytes of any content are read without a panic.

use crate::rosbags::samples;
use proptest::prelude::*;
use ros2::{
    cdr::ByteOrder,
    messages::{
        BoundingBox2D, CameraInfo, CompressedImage, Detection2D, Detection2DArray, Header, Image, LaserScan,
        Message, MessageKind, ObjectHypothesisWithPose, Pose, Pose2D, PoseWithCovariance, Quaternion,
        RegionOfInterest, TFMessage, Time, Transform, TransformStamped, Vector3,
    },
    rmw_zenoh::{Attachment, DataKey, Gid, Token},
};

const ORDERS: [ByteOrder; 2] = [ByteOrder::Little, ByteOrder::Big];

/// Both ways in both byte orders.
fn check<'a, M: Message<'a>>(message: &M, decode: impl Fn(&[u8]) -> bool) {
    for order in ORDERS {
        assert!(decode(&message.encode_in(order)), "{order:?}");
    }
}

fn numbers<const N: usize>() -> impl Strategy<Value = [f64; N]> {
    prop::collection::vec(-1e9..1e9, N).prop_map(|v| v.try_into().expect("N numbers"))
}

fn text() -> impl Strategy<Value = String> {
    prop_oneof!["[a-z_/]{0,9}", "\\PC{0,7}"]
}

fn time() -> impl Strategy<Value = Time> {
    any::<(i32, u32)>().prop_map(|(sec, nanosec)| Time { sec, nanosec })
}

fn pose([x, y, z, a, b, c, d]: [f64; 7]) -> Pose {
    Pose { position: Vector3 { x, y, z }, orientation: Quaternion { x: a, y: b, z: c, w: d } }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn images(stamp in time(), names in (text(), text()), sizes in any::<[u32; 3]>(), data in any::<Vec<u8>>()) {
        let header = Header { stamp, frame_id: &names.0 };
        let image = Image {
            header,
            height: sizes[0],
            width: sizes[1],
            encoding: &names.1,
            is_bigendian: sizes[0] as u8,
            step: sizes[2],
            data: &data,
        };
        check(&image, |payload| Image::decode(payload) == Ok(image));
        let compressed = CompressedImage { header, format: &names.1, data: &data };
        check(&compressed, |payload| CompressedImage::decode(payload) == Ok(compressed));
    }

    #[test]
    fn scans(
        stamp in time(),
        name in text(),
        heads in prop::array::uniform7(-9.0_f32..9.0),
        lists in (prop::collection::vec(-9.0_f32..99.0, 0..40), prop::collection::vec(0.0_f32..9.0, 0..5)),
    ) {
        let scan = LaserScan {
            header: Header { stamp, frame_id: &name },
            angle_min: heads[0],
            angle_max: heads[1],
            angle_increment: heads[2],
            time_increment: heads[3],
            scan_time: heads[4],
            range_min: heads[5],
            range_max: heads[6],
            ranges: lists.0,
            intensities: lists.1,
        };
        check(&scan, |payload| LaserScan::decode(payload).as_ref() == Ok(&scan));
    }

    #[test]
    fn calibrations(
        name in text(),
        d in prop::collection::vec(-1.0..1.0, 0..15),
        sizes in any::<[u32; 6]>(),
        krp in (numbers::<9>(), numbers::<9>(), numbers::<12>()),
        do_rectify: bool,
    ) {
        let info = CameraInfo {
            header: Header { stamp: Time::default(), frame_id: &name },
            height: sizes[0],
            width: sizes[1],
            distortion_model: "plumb_bob",
            d,
            k: krp.0,
            r: krp.1,
            p: krp.2,
            binning_x: sizes[2],
            binning_y: sizes[3],
            roi: RegionOfInterest { x_offset: sizes[4], y_offset: sizes[5], height: 1, width: 2, do_rectify },
        };
        check(&info, |payload| CameraInfo::decode(payload).as_ref() == Ok(&info));
    }

    #[test]
    fn lists(stamp in time(), names in prop::collection::vec((text(), numbers::<7>()), 0..6)) {
        let header = |frame_id| Header { stamp, frame_id };
        let link = |(name, numbers): &'_ (String, [f64; 7])| {
            let Pose { position, orientation } = pose(*numbers);
            (name.clone(), Transform { translation: position, rotation: orientation })
        };
        let links: Vec<(String, Transform)> = names.iter().map(link).collect();
        let transforms = links
            .iter()
            .map(|(name, transform)| TransformStamped {
                header: header(name),
                child_frame_id: name,
                transform: *transform,
            })
            .collect();
        let message = TFMessage { transforms };
        check(&message, |payload| TFMessage::decode(payload).as_ref() == Ok(&message));

        let result = |(name, numbers): &'_ (String, [f64; 7])| ObjectHypothesisWithPose {
            class_id: "poster",
            score: name.len() as f64,
            pose: PoseWithCovariance { pose: pose(*numbers), covariance: [numbers[0]; 36] },
        };
        let results: Vec<ObjectHypothesisWithPose<'_>> = names.iter().map(result).collect();
        let detections = names
            .iter()
            .map(|(name, n)| Detection2D {
                header: header(name),
                results: results.clone(),
                bbox: BoundingBox2D { center: Pose2D { x: n[0], y: n[1], theta: n[2] }, size_x: n[3], size_y: n[4] },
                id: name,
            })
            .collect();
        let message = Detection2DArray { header: header(""), detections };
        check(&message, |payload| Detection2DArray::decode(payload).as_ref() == Ok(&message));
    }

    #[test]
    fn damaged_messages_are_read_without_a_panic(
        which: prop::sample::Index,
        edits in prop::collection::vec(any::<(prop::sample::Index, u8)>(), 1..6),
    ) {
        let samples = samples();
        let sample = which.get(&samples);
        let mut payload = sample.payload.clone();
        for (at, byte) in edits {
            let at = at.index(payload.len());
            payload[at] = byte;
        }
        match sample.kind.decode(&payload) {
            // What is read is written to bytes that mean the same.
            Ok(message) => {
                let again = message.encode_in(sample.order);
                let back = sample.kind.decode(&again).map(|m| m.encode_in(sample.order));
                prop_assert_eq!(back, Ok(again.clone()));
            }
            Err(error) => prop_assert!(error.offset <= payload.len(), "{error}"),
        }
    }

    #[test]
    fn any_bytes_and_texts_are_read_without_a_panic(bytes in any::<Vec<u8>>(), text in "\\PC{0,60}") {
        for kind in MessageKind::ALL {
            // Random bytes hardly ever begin with a header, and then announce more than there is.
            prop_assert!(kind.decode(&bytes).is_err() || bytes.len() < 12);
        }
        prop_assert!(Attachment::read(&bytes).is_err() || bytes.len() == 33);
        if let Ok(key) = DataKey::parse(&text) {
            prop_assert_eq!(key.to_string(), text);
        }
    }

    #[test]
    fn attachments(sequence: i64, source_ns: i64, gid: [u8; 16]) {
        let attachment = Attachment { sequence, source_ns, source: Gid(gid) };
        prop_assert_eq!(Attachment::read(&attachment.write()), Ok(attachment));
    }

    #[test]
    fn keys(domain: u32, topic in "[a-zA-Z_][a-z0-9_]{0,5}(/[a-z_][a-z0-9_]{0,5}){0,3}", hash in "RIHS01_[0-9a-f]{64}") {
        let text = format!("{domain}/{topic}/tf2_msgs::msg::dds_::TFMessage_/{hash}");
        let key = DataKey::parse(&text).expect("a key");
        prop_assert_eq!((key.domain, key.topic.as_key(), key.hash), (domain, topic.as_str(), hash.as_str()));
        prop_assert_eq!(key.to_string(), text);
    }

    #[test]
    fn tokens(
        head in "[0-9a-f]{1,8}/[0-9]{1,2}/[0-9]{1,2}",
        node in "(%|%[a-z]{1,5})/(%|%[a-z]{1,5}%[a-z]{1,5})/[a-z_]{1,9}",
        endpoint in prop::option::of("(MP|MS|SS|SC)/(%[a-z]{1,5}){1,3}/a::msg::dds_::B_/RIHS01_[0-9a-f]{4}"),
        qos in "[02]?:[01]?:2?,([1-9][0-9]{0,2})?:,:7?,:3?,,(/backends:[a-z]{3}:)?",
        cut in any::<prop::sample::Index>(),
    ) {
        let text = match endpoint.as_deref().and_then(|e| e.split_once('/')) {
            Some((kind, topic)) => format!("@ros2_lv/0/{head}/{kind}/{node}/{topic}/{qos}"),
            None => format!("@ros2_lv/0/{head}/NN/{node}"),
        };
        let token = Token::parse(&text).expect("a token");
        // A depth of 42 is the default, which is not written.
        prop_assert_eq!(token.to_key(), Ok(text.replace(",42:", ",:")));
        let part = &text[..cut.index(text.len())];
        if let Ok(other) = Token::parse(part) {
            prop_assert_eq!(Token::parse(&other.to_key().expect("a key")), Ok(other));
        }
    }
}
