"""A camera loop: frames go out as they come, the pose of the robot comes back with each answer.

python 03_camera_loop.py --robot r1 --folder pictures/           # a folder of pictures as camera
python 03_camera_loop.py --robot r1 --device 0 --jpeg            # needs: pip install opencv-python

The landmarks of the map need a size and a place (04_localise.py). A camera whose calibration is known gives better
poses than `--view-deg` does: give its file as `--camera`.
"""

from __future__ import annotations

import argparse
import importlib
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from waymark import Capture, Image, Intrinsics, Pose3, Robot, WaymarkError


def from_folder(folder: Path) -> Iterator[Image]:
    """Every picture of a folder, by name."""
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in (".jpg", ".jpeg", ".png"):
            yield Image.file(path)


def from_device(number: int) -> Iterator[Image]:
    """The newest frame of a camera, until it ends."""
    cv2: Any = importlib.import_module("cv2")
    camera = cv2.VideoCapture(number)
    while True:
        is_read, pixels = camera.read()
        if not is_read:
            return
        yield Image.bgr(pixels)


def main() -> None:
    parser = argparse.ArgumentParser(description="Send the frames of a camera, and print poses.")
    parser.add_argument("--endpoint", default="tcp/127.0.0.1:7447", help="the server's zenoh endpoint")
    parser.add_argument("--robot", default="r1", help="name of a robot that the server knows")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--folder", type=Path, help="pictures as camera")
    source.add_argument("--device", type=int, help="number of a camera, by OpenCV")
    parser.add_argument("--view-deg", type=float, default=60.0, help="angle from the left to the right border")
    parser.add_argument("--camera", type=Path, help="file of `waymark camera calibrate --json`, or ost.yaml of ROS")
    parser.add_argument("--camera-height", type=float, default=1.2, help="over the floor, in metres")
    parser.add_argument("--jpeg", action="store_true", help="compress raw frames: for a slow network")
    arguments = parser.parse_args()

    frames = from_folder(arguments.folder) if arguments.folder else from_device(arguments.device)
    known = Intrinsics.from_file(arguments.camera) if arguments.camera else None
    mounting = Pose3.mounting(0.0, 0.0, arguments.camera_height)
    with Robot.connect(arguments.robot, endpoint=arguments.endpoint) as robot:
        for image in frames:
            captured_ns = time.time_ns()
            camera = known or Intrinsics.from_view(image.width_px, image.height_px, math.radians(arguments.view_deg))
            sent = image.jpeg() if arguments.jpeg else image
            capture = Capture(sent, camera, mounting, captured_ns=captured_ns, deadline_ms=5000)
            # One frame at a time; with `publish_frame` and `answers()` the camera need not wait.
            answer = robot.recognise("front", capture).accepted()
            if answer.map_from_robot is None:
                # With `gate_reprojection`: which number does not fit, and by how much.
                detail = answer.pose_refusal_detail
                print(f"{answer.status}: no pose", detail.sentence if detail else answer.pose_refusal)
                continue
            pose, (sigma_x, sigma_y, sigma_theta) = answer.map_from_robot.pose, answer.map_from_robot.sigma
            print(
                f"x {pose.x_m:.2f} +- {sigma_x:.2f} m, y {pose.y_m:.2f} +- {sigma_y:.2f} m, heading "
                f"{math.degrees(pose.theta_rad):.0f} +- {math.degrees(sigma_theta):.0f} degrees, by "
                + ", ".join(answer.pose_landmarks)
            )


if __name__ == "__main__":
    try:
        main()
    except (WaymarkError, OSError) as error:
        sys.exit(f"{Path(sys.argv[0]).name}: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
