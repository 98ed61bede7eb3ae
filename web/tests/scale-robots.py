"""Robots that drive in circles and send odometry ten times a second: `scale-robots.py ENDPOINT NUMBER`.

They stand 4 m apart. Prints `ready` when all are connected, and drives until it is killed.
"""

from __future__ import annotations

import math
import sys
import time

from waymark import Pose2, Robot

RATE_HZ = 10
RADIUS_M = 3.0


def main() -> None:
    endpoint, number = sys.argv[1], int(sys.argv[2])
    robots = [Robot.connect(f"r{i}", endpoint=endpoint, timeout_s=60) for i in range(number)]
    print("ready", flush=True)
    begun = time.monotonic()
    while True:
        angle = 0.3 * (time.monotonic() - begun)
        for robot in robots:
            robot.publish_odometry(Pose2(RADIUS_M * math.sin(angle), RADIUS_M * (1 - math.cos(angle)), angle))
        time.sleep(1 / RATE_HZ)


main()
