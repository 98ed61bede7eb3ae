//! Claim: transforms of `/tf_static` are merged, summed up along the tree, and a missing link is
//! named.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use ros2::{
    convert::{
        LookupError, MAX_FRAME_NAME_BYTES, MAX_FRAMES, PoseError, RotationError, TransformError,
        TransformTree, body_from_optical, transform_stamped,
    },
    messages::{Message, Quaternion, TFMessage, Time, TransformStamped},
};

fn shifted(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::identity())
}

fn link<'a>(parent: &'a str, child: &'a str, x: f64) -> TransformStamped<'a> {
    transform_stamped(parent, child, Time::default(), &shifted(x, 0.0, 0.0))
}

fn tree(links: Vec<TransformStamped<'_>>) -> TransformTree {
    let mut tree = TransformTree::default();
    let (_, errors) = tree.merge(&TFMessage { transforms: links });
    assert_eq!(errors, []);
    tree
}

#[test]
fn the_camera_on_the_robot_is_the_sum_of_the_links() {
    // A camera 0.2 m ahead and 1 m up, turned left by 90 degrees, with its optical frame; as
    // drivers send it.
    let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    let base_from_body = Isometry3::from_parts(Translation3::new(0.2, 0.0, 1.0), turned);
    let optical = Isometry3::from_parts(Translation3::identity(), body_from_optical());
    let links = vec![
        transform_stamped("camera_link", "camera_optical_frame", Time::default(), &optical),
        transform_stamped("base_link", "camera_link", Time::default(), &base_from_body),
    ];
    let payload = TFMessage { transforms: links }.encode();
    let mut tree = TransformTree::default();
    assert_eq!(tree.merge(&TFMessage::decode(&payload).unwrap()), (2, vec![]));

    let robot_from_camera = tree.lookup("base_link", "camera_optical_frame").unwrap();
    // 3 m in front of the lens and 0.5 m to the right in the picture: 3 m left of the robot, 0.5 m
    // further ahead.
    let point = robot_from_camera * Point3::new(0.5, 0.0, 3.0);
    assert!((point - Point3::new(0.7, 3.0, 1.0)).norm() < 1e-9, "{point}");
    let back = tree.lookup("camera_optical_frame", "base_link").unwrap();
    assert!((back * point - Point3::new(0.5, 0.0, 3.0)).norm() < 1e-9);
    assert!(tree.lookup("base_link", "base_link").unwrap().translation.vector.norm() < 1e-12);
}

#[test]
fn siblings_are_linked_through_their_parent() {
    let tree = tree(vec![
        link("base_link", "laser", 0.3),
        link("base_link", "mast", -0.1),
        link("mast", "eye", 0.05),
    ]);
    let laser_from_eye = tree.lookup("laser", "eye").unwrap();
    assert!((laser_from_eye.translation.vector - Vector3::new(-0.35, 0.0, 0.0)).norm() < 1e-12);
    assert_eq!((tree.len(), tree.is_empty()), (3, false));
}

#[test]
fn the_newest_transform_of_a_child_wins() {
    let mut tree = tree(vec![link("base_link", "laser", 0.3), link("base_link", "eye", 0.1)]);
    assert_eq!(tree.insert(&link("base_link", "laser", 0.3)), Ok(false), "nothing has changed");
    assert_eq!(tree.insert(&link("base_link", "laser", 0.4)), Ok(true));
    assert_eq!(tree.insert(&link("eye", "laser", 0.5)), Ok(true), "another parent");
    assert!((tree.lookup("base_link", "laser").unwrap().translation.x - 0.6).abs() < 1e-12);
    assert_eq!(tree.len(), 2);
}

#[test]
fn a_leading_slash_does_not_matter() {
    let tree = tree(vec![link("/base_link", "/laser", 0.3)]);
    assert!(tree.lookup("base_link", "laser").is_ok());
    assert!(tree.lookup("/base_link", "/laser").is_ok());
}

#[test]
fn a_missing_link_is_named() {
    let tree = tree(vec![link("base_link", "laser", 0.3), link("camera_link", "optical", 0.0)]);
    let error = tree.lookup("base_link", "optical").unwrap_err();
    let expected = LookupError::NotLinked {
        from: "optical".into(),
        source_root: "camera_link".into(),
        to: "base_link".into(),
        target_root: "base_link".into(),
    };
    assert_eq!(error, expected);
    assert_eq!(
        error.to_string(),
        "nothing links `camera_link`, above `optical`, with `base_link`, above `base_link`"
    );
    assert_eq!(tree.lookup("base_link", "eye"), Err(LookupError::Unknown("eye".into())));
    assert_eq!(tree.lookup("base", "laser"), Err(LookupError::Unknown("base".into())));
    assert!(matches!(TransformTree::default().lookup("a", "a"), Err(LookupError::Unknown(_))));
}

#[test]
fn what_would_break_the_tree_is_left_out() {
    let mut tree = tree(vec![link("a", "b", 1.0), link("b", "c", 1.0)]);
    for (parent, child) in [("c", "a"), ("b", "a"), ("a", "a"), ("c", "b")] {
        let refused = Err(TransformError::Loop { child: child.into(), parent: parent.into() });
        assert_eq!(tree.insert(&link(parent, child, 0.0)), refused);
    }
    let long = "n".repeat(MAX_FRAME_NAME_BYTES + 1);
    for (parent, child, bytes) in [("", "x", 0), ("x", "", 0), ("x", long.as_str(), long.len())] {
        assert_eq!(tree.insert(&link(parent, child, 0.0)), Err(TransformError::Name(bytes)));
    }
    let mut zero = link("a", "d", 0.0);
    zero.transform.rotation = Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 0.0 };
    let mut nan = link("a", "e", 0.0);
    nan.transform.translation.y = f64::NAN;
    let (changed, errors) = tree.merge(&TFMessage { transforms: vec![zero, nan, link("a", "f", 0.0)] });
    assert_eq!(changed, 1, "the good one is taken");
    let fault = |child: &str, fault| TransformError::Pose { child: child.into(), fault };
    let expected =
        [fault("d", PoseError::Rotation(RotationError::Norm2(0.0))), fault("e", PoseError::Position)];
    assert_eq!(errors, expected);
    assert!(tree.lookup("a", "c").is_ok());
}

#[test]
fn there_are_only_so_many_frames() {
    let names: Vec<String> = (0..=MAX_FRAMES).map(|i| format!("f{i}")).collect();
    let mut tree = TransformTree::default();
    for pair in names[..MAX_FRAMES].windows(2) {
        assert_eq!(tree.insert(&link(&pair[0], &pair[1], 0.01)), Ok(true));
    }
    assert_eq!(tree.insert(&link("f0", "last", 0.0)), Ok(true));
    assert_eq!(tree.len(), MAX_FRAMES);
    assert_eq!(tree.insert(&link("f0", "more", 0.0)), Err(TransformError::Full("more".into())));
    assert_eq!(tree.insert(&link("f0", "last", 1.0)), Ok(true), "a known one may change");
    let deepest = format!("f{}", MAX_FRAMES - 1);
    let sum = tree.lookup("f0", &deepest).unwrap().translation.x;
    assert!((sum - 0.01 * (MAX_FRAMES - 1) as f64).abs() < 1e-9);
}
