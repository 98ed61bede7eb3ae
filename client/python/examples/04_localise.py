"""Place a landmark by hand, then drive: odometry and frames go out, the fused pose of the robot comes back.

python 04_localise.py --map hall --landmark poster --place 5.0 0.0 1.5 90 --robot r1 drive.csv

`--place` is the centre of the landmark on the map (x, y, height over the floor, in metres) and the direction in which
it faces, in degrees from the map's x axis. A line of the drive is a picture, as a path beside the file, and the
odometry at its capture: `picture,x_m,y_m,theta_rad`.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from pathlib import Path

from waymark import Capture, Image, Intrinsics, MapClient, Place, Pose2, Pose3, Robot


def main() -> None:
    parser = argparse.ArgumentParser(description="Place a landmark, then localise a robot that drives.")
    parser.add_argument("--server", default="http://127.0.0.1:8080", help="the server's HTTP address")
    parser.add_argument("--endpoint", default="tcp/127.0.0.1:7447", help="the server's zenoh endpoint")
    parser.add_argument("--map", default="hall", help="map that has been taught: 02_teach.py")
    parser.add_argument("--landmark", required=True, help="landmark of known size to place")
    parser.add_argument("--place", nargs=4, type=float, required=True, metavar=("X", "Y", "Z", "DEGREES"))
    parser.add_argument("--robot", default="r1", help="name of the robot; made known to the server")
    parser.add_argument("--focal", type=float, default=500.0, help="focal length of the camera, in pixels")
    parser.add_argument("--camera-height", type=float, default=1.2, help="over the floor, in metres")
    parser.add_argument("drive", type=Path, help="CSV: picture,x_m,y_m,theta_rad")
    arguments = parser.parse_args()

    with MapClient(arguments.server) as maps:
        x, y, z, degrees = arguments.place
        place = Place(x, y, z, math.radians(degrees))
        landmark = maps.update_landmark(arguments.map, arguments.landmark, place=place)
        if landmark.size is None:
            parser.error(f"{landmark.name} has no size: MapClient.update_landmark(..., size=Size(width_m, height_m))")
        maps.put_robot(arguments.robot, arguments.map)

    mounting = Pose3.mounting(0.0, 0.0, arguments.camera_height)
    with Robot.connect(arguments.robot, endpoint=arguments.endpoint) as robot, robot.poses() as poses:
        for line in csv.reader(arguments.drive.read_text().splitlines()):
            image = Image.file(arguments.drive.parent / line[0])
            odometry = Pose2(*map(float, line[1:]))
            centre = ((image.width_px - 1) / 2, (image.height_px - 1) / 2)
            camera = Intrinsics(arguments.focal, arguments.focal, *centre)
            # One clock stamps all messages of a robot, at capture.
            captured_ns = time.time_ns()
            robot.publish_odometry(odometry, captured_ns)
            robot.recognise("front", Capture(image, camera, mounting, odometry, captured_ns=captured_ns))
            # The server answers the frame, and corrects the fused pose; the newest odometry moves it on.
            robot.publish_odometry(odometry)
            newest = poses.get(1.0)
            while (newer := poses.get(0.1)) is not None:
                newest = newer
            if newest is None or newest.map_from_robot is None:
                print(f"{line[0]}: the pose is unknown")
                continue
            pose = newest.map_from_robot.pose
            print(
                f"{line[0]}: x {pose.x_m:.2f} m, y {pose.y_m:.2f} m, {math.degrees(pose.theta_rad):.0f} degrees, "
                f"{newest.trust}, by {' and '.join(newest.modalities)}"
            )


if __name__ == "__main__":
    main()
