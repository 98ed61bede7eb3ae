"""A teacher: make a map, upload one photograph of each landmark, learn, and try it on other photographs.

waymark serve                     # in another terminal
python 02_teach.py --map hall --size 0.6 0.84 --robot r1 poster.jpg door.jpg --try wall.jpg

The name of a landmark is the name of its file. With `--whole-image` the file shows the landmark and nothing else;
otherwise the server searches the landmark in it, and refuses a photograph with several framed things.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from waymark import MapClient, Refused, Region, Size, WaymarkError, named_landmarks


def main() -> None:
    parser = argparse.ArgumentParser(description="Teach photographs to a server, then recognise others.")
    parser.add_argument("--server", default="http://127.0.0.1:8080", help="the server's HTTP address")
    parser.add_argument("--map", default="hall", help="map to teach; created if it does not exist")
    parser.add_argument("--size", nargs=2, type=float, metavar=("WIDTH_M", "HEIGHT_M"), help="of every landmark")
    parser.add_argument("--whole-image", action="store_true", help="the whole image is the landmark")
    parser.add_argument("--robot", help="robot to assign to this map")
    parser.add_argument("--try", nargs="+", default=[], dest="tries", help="photographs to recognise afterwards")
    parser.add_argument("images", nargs="+", help="photographs, one landmark each")
    arguments = parser.parse_args()
    size = Size(*arguments.size) if arguments.size else None

    with MapClient(arguments.server) as maps:
        try:
            maps.create_map(arguments.map)
        except Refused as refused:
            if refused.code != "exists":
                raise
            print(f"map {arguments.map} exists: adding to it")
        names = []
        for path in map(Path, arguments.images):
            name = re.sub("[^a-z0-9_-]", "-", path.stem.lower())[:64]
            region: Region = "whole_image" if arguments.whole_image else "detect"
            # The landmark is made with its first view: nothing is left behind if the view is refused.
            view = maps.upload_view(arguments.map, name, path, region, make_landmark=True, size=size)
            print(f"{name}: corners {[(round(u), round(v)) for u, v in view.corners]}")
            names.append(name)

        # One job learns all landmarks, so that each is a negative of the others.
        maps.wait_for_job(maps.learn(arguments.map, names), progress=lambda job: print(f"{job.progress:4.0%}"))
        for name in names:
            landmark = maps.landmark(arguments.map, name)
            print(f"{name}: {landmark.status}", *landmark.failed_gates)
        if arguments.robot:
            maps.put_robot(arguments.robot, arguments.map)

        for path in map(Path, arguments.tries):
            answer = maps.recognise(arguments.map, path)
            print(f"{path}: {answer.status}", *(named.name for named in named_landmarks(answer)))


if __name__ == "__main__":
    try:
        main()
    except (WaymarkError, OSError) as error:
        sys.exit(f"{Path(sys.argv[0]).name}: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
