"""Writes `bag.mcap` of ROS 2 from `readings.json` and pictures, with rosbags 0.11.9 and mcap 1.6.0:

    python bag.py FOLDER
"""

import json
import math
import sys
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

folder = Path(sys.argv[1])
readings = json.loads((folder / "readings.json").read_text())
store = get_typestore(Stores.ROS2_JAZZY)
T = store.types


def make(name, *fields):
    return T[name](*fields)


def header(ns, frame):
    stamp = make("builtin_interfaces/msg/Time", ns // 10**9, ns % 10**9)
    return make("std_msgs/msg/Header", stamp, frame)


def turn(theta):
    return make("geometry_msgs/msg/Quaternion", 0.0, 0.0, math.sin(theta / 2), math.cos(theta / 2))


def vector(x, y, z):
    return make("geometry_msgs/msg/Vector3", float(x), float(y), float(z))


def transform(ns, parent, child, translation, rotation):
    inner = make("geometry_msgs/msg/Transform", translation, rotation)
    return make("geometry_msgs/msg/TransformStamped", header(ns, parent), child, inner)


with open(folder / "bag.mcap", "wb") as file:
    # As `ros2 bag record` with storage preset zstd_fast.
    writer = Writer(file, compression=CompressionType.ZSTD)
    writer.start(profile="ros2", library="bag.py")
    channels = {}

    def write(topic, name, message, at_ns):
        if topic not in channels:
            text = store.generate_msgdef(name, ros_version=2)[0].encode()
            schema = writer.register_schema(name, "ros2msg", text)
            meta = {"offered_qos_profiles": "", "topic_type_hash": store.hash_rihs01(name)}
            channels[topic] = writer.register_channel(topic, "cdr", schema, meta)
        data = bytes(store.serialize_cdr(message, name))
        writer.add_message(channels[topic], log_time=at_ns, publish_time=at_ns, data=data)

    for frame in readings["frames"]:
        ns = frame["at_ns"]
        x, y, z, qx, qy, qz, qw = frame["camera"]
        laser = frame["laser"]
        lx, ly, ltheta = laser["pose"]
        mountings = [
            transform(ns, "base_link", "camera_optical_frame", vector(x, y, z),
                      make("geometry_msgs/msg/Quaternion", qx, qy, qz, qw)),
            transform(ns, "base_link", "laser", vector(lx, ly, 0.2), turn(ltheta)),
        ]
        write("/tf", "tf2_msgs/msg/TFMessage", make("tf2_msgs/msg/TFMessage", mountings), ns)
        k = [float(v) for v in frame["k"]]
        width, height = frame["size"]
        info = make(
            "sensor_msgs/msg/CameraInfo", header(ns, "camera_optical_frame"), height, width,
            "plumb_bob", np.zeros(5), np.array(k), np.eye(3).ravel(),
            np.array(k[0:3] + [0.0] + k[3:6] + [0.0] + k[6:9] + [0.0]), 0, 0,
            make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False),
        )
        write("/camera/camera_info", "sensor_msgs/msg/CameraInfo", info, ns + 1)
        ox, oy, otheta = frame["odom"]
        pose = make("geometry_msgs/msg/Pose", make("geometry_msgs/msg/Point", ox, oy, 0.0), turn(otheta))
        twist = make("geometry_msgs/msg/Twist", vector(0, 0, 0), vector(0, 0, 0))
        odometry = make(
            "nav_msgs/msg/Odometry", header(ns, "odom"), "base_link",
            make("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36)),
            make("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)),
        )
        write("/odom", "nav_msgs/msg/Odometry", odometry, ns + 2)
        ranges = np.array(laser["ranges"], dtype=np.float32)
        last = laser["first"] + laser["step"] * (len(ranges) - 1)
        scan = make(
            "sensor_msgs/msg/LaserScan", header(ns, "laser"), laser["first"], last, laser["step"], 0.0, 0.0,
            0.05, laser["max"], ranges, np.zeros(0, dtype=np.float32),
        )
        write("/scan", "sensor_msgs/msg/LaserScan", scan, ns + 3)
        picture = np.frombuffer(Path(frame["picture"]).read_bytes(), dtype=np.uint8)
        image = make("sensor_msgs/msg/CompressedImage", header(ns, "camera_optical_frame"), "jpeg", picture)
        write("/camera/image_raw/compressed", "sensor_msgs/msg/CompressedImage", image, ns + 4)
    writer.finish()
