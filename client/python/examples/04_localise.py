"""Place a landmark by hand, then drive: odometry and frames go out, the fused pose of the robot comes back.

python 04_localise.py --map hall --landmark poster --place 5.0 0.0 1.5 90 --robot r1 drive.csv

`--place` is the centre of the landmark on the map (x, y, height over the floor, in metres) and the direction in which
it faces, in degrees from the map's x axis. A line of the drive is a picture, as a path beside the file, and the
odometry at its capture: `picture,x_m,y_m,theta_rad`. The first line may be these words; `drive.csv` beside this program
is a sample.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from waymark import Capture, Image, Intrinsics, InvalidInput, MapClient, Place, Pose2, Pose3, Robot, WaymarkError

HEADER = ["picture", "x_m", "y_m", "theta_rad"]


def steps(drive: Path) -> Iterator[tuple[Path, Pose2]]:
    """Each picture of a drive with the odometry at its capture."""
    for number, line in enumerate(csv.reader(drive.read_text(encoding="utf-8-sig").splitlines()), 1):
        words = [word.strip() for word in line]
        if not any(words) or (number == 1 and words == HEADER):
            continue
        try:
            picture, x_m, y_m, theta_rad = words
            yield drive.parent / picture, Pose2(float(x_m), float(y_m), float(theta_rad))
        except ValueError:
            raise InvalidInput(
                f"line {number} of {drive} is not {','.join(HEADER)}: {','.join(line)}", field="drive"
            ) from None


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
        for picture, odometry in steps(arguments.drive):
            image = Image.file(picture)
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
                print(f"{picture.name}: the pose is unknown")
                continue
            pose = newest.map_from_robot.pose
            print(
                f"{picture.name}: x {pose.x_m:.2f} m, y {pose.y_m:.2f} m, {math.degrees(pose.theta_rad):.0f} degrees, "
                f"{newest.trust}, by {' and '.join(newest.modalities)}"
            )


if __name__ == "__main__":
    try:
        main()
    except (WaymarkError, OSError) as error:
        sys.exit(f"{Path(sys.argv[0]).name}: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
