"""Writes CDR bytes of random messages with rosbags, an implementation of ROS 2 types that shares nothing with this crate.

Run in the folder `ros2/tests`, with rosbags 0.11.9 (`pip install rosbags==0.11.9`):

    python golden.py > fixtures/rosbags.txt

For each message: its type and hash, byte order, every field by its path (numbers as Python prints them, exact; bytes as
hexadecimal digits), and the payload. The seed is fixed, so the file comes out the same.
"""

import json
import math
import random
from importlib.metadata import version

import numpy as np
from rosbags.typesys import Stores, get_typestore, get_types_from_msg

SEED = 20261124
MESSAGES_OF_A_TYPE = 3

TYPES = [
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CompressedImage",
    "sensor_msgs/msg/CameraInfo",
    "sensor_msgs/msg/LaserScan",
    "nav_msgs/msg/Odometry",
    "tf2_msgs/msg/TFMessage",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "vision_msgs/msg/Detection2DArray",
]

# ros-perception/vision_msgs 4.1.1, without comments.
VISION = {
    "Point2D": "float64 x\nfloat64 y\n",
    "Pose2D": "vision_msgs/Point2D position\nfloat64 theta\n",
    "BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n",
    "ObjectHypothesis": "string class_id\nfloat64 score\n",
    "ObjectHypothesisWithPose": "ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n",
    "Detection2D": "std_msgs/Header header\nObjectHypothesisWithPose[] results\nBoundingBox2D bbox\nstring id\n",
    "Detection2DArray": "std_msgs/Header header\nDetection2D[] detections\n",
}

WORDS = ["", "a", "map", "odom", "base_link", "camera_optical_frame", "caméra", "plumb_bob", "rgb8", "フレーム", "x/y z"]


def store():
    types = get_typestore(Stores.ROS2_JAZZY)
    added = {}
    for name, text in VISION.items():
        added.update(get_types_from_msg(text, f"vision_msgs/msg/{name}"))
    types.register(added)
    return types


def number(name, rng):
    """A random value of a primitive type, with the edges of its range."""
    if name == "bool":
        return rng.random() < 0.5
    if name in ("float32", "float64"):
        exotic = [0.0, -0.0, math.inf, -math.inf, math.nan, 1e-30, -1e30]
        value = rng.choice(exotic) if rng.random() < 0.15 else rng.uniform(-1000, 1000)
        return float(np.float32(value)) if name == "float32" else value
    bits = int(name.lstrip("uint"))
    low, high = (0, 2**bits - 1) if name.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    return rng.choice([low, high]) if rng.random() < 0.2 else rng.randint(low, high)


def value(types, kind, rng, path, lines):
    """A random value of a type; appends a line for every field."""
    nodetype, detail = kind
    if nodetype == 1:  # primitive: (name, length)
        name = detail[0]
        made = rng.choice(WORDS) if name == "string" else number(name, rng)
        shown = json.dumps(made, ensure_ascii=False) if name == "string" else repr(made).lower()
        lines.append(f"{path} = {shown}")
        return made
    if nodetype == 2:  # name of a type
        return message(types, detail, rng, path + ".", lines)
    element, length = detail  # 3: array, 4: sequence
    several = [0, 1, 2, 3] if element[0] == 2 else [0, 1, 2, 3, 5]
    count = length if nodetype == 3 else rng.choice(several)
    if element[0] == 2:
        lines.append(f"{path}.len = {count}")
        return [value(types, element, rng, f"{path}[{i}]", lines) for i in range(count)]
    name = element[1][0]
    made = [number(name, rng) for _ in range(count)]
    if name == "uint8":
        lines.append(f"{path} = {bytes(made).hex()}")
    else:
        lines.append(f"{path} = {' '.join(repr(m) for m in made)}")
    return np.array(made, dtype=name)


def message(types, name, rng, prefix, lines):
    """A random message; appends a line for every field."""
    fields = {field: value(types, kind, rng, prefix + field, lines) for field, kind in types.fielddefs[name][1]}
    return types.types[name](**fields)


def main():
    types, rng = store(), random.Random(SEED)
    print("# Random messages and their CDR bytes, written by rosbags " + version("rosbags") + ", store ROS2_JAZZY.")
    print(f"# In ros2/tests: python golden.py > fixtures/rosbags.txt (seed {SEED})")
    for name in TYPES:
        for i in range(MESSAGES_OF_A_TYPE):
            lines = []
            made = message(types, name, rng, "", lines)
            little = i % 2 == 0
            payload = bytes(types.serialize_cdr(made, name, little_endian=little))
            print(f"\nmessage {name} {types.hash_rihs01(name)} {'little' if little else 'big'}")
            print("\n".join(lines))
            print(f"payload {payload.hex()}")


if __name__ == "__main__":
    main()
