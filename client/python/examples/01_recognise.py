"""A robot in thirty lines: send photographs, print the landmarks of each answer.

waymark serve                     # in another terminal, with a map that has been taught: 02_teach.py
python 01_recognise.py --robot r1 photo1.jpg photo2.jpg
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from waymark import Image, Robot, WaymarkError, named_landmarks, quad_corners


def main() -> None:
    parser = argparse.ArgumentParser(description="Send photographs as a robot, and print the answers.")
    parser.add_argument("--endpoint", default="tcp/127.0.0.1:7447", help="the server's zenoh endpoint")
    parser.add_argument("--robot", default="r1", help="name of a robot that the server knows")
    parser.add_argument("images", nargs="+", help="JPEG or PNG files")
    arguments = parser.parse_args()

    # Every photograph counts here, so wait for a full link. A driving robot keeps "latest".
    with Robot.connect(arguments.robot, endpoint=arguments.endpoint, delivery="every") as robot:
        for path in arguments.images:
            # `Capture(image, intrinsics=..., robot_from_camera=...)` also gives poses: 03 and 04.
            answer = robot.recognise("camera", Image.file(path), wait_s=30).accepted()
            print(f"{path}: {answer.status} against map {answer.map} in {answer.latency_ms:.0f} ms")
            for named in named_landmarks(answer):
                corners = " ".join(f"({u:.0f}, {v:.0f})" for u, v in quad_corners(named.quad))
                # A guided name rests on a pose known before, and starts none.
                how = "by the pose known before" if named.is_guided else f"confidence {named.quad.confidence:.2f}"
                print(f"    {named.name}, {how}, at {corners}")


if __name__ == "__main__":
    try:
        main()
    except (WaymarkError, OSError) as error:
        sys.exit(f"{Path(sys.argv[0]).name}: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
