"""Watch a map, with asyncio: answers, poses, robots that come and go, new versions.

python 05_watch_map.py --map hall
"""

from __future__ import annotations

import argparse
import asyncio
import sys
from pathlib import Path

from waymark import AsyncMapClient, WaymarkError, named_landmarks
from waymark.api import LiveAnswer, LiveEvent, LiveMapChange, LiveMissed, LivePose, LivePresence


def sentence(event: LiveEvent) -> str | None:
    """An event in words; `None` for one that says little."""
    if isinstance(event, LiveAnswer):
        names = ", ".join(named.name for named in named_landmarks(event.answer)) or event.answer.status
        return f"{event.robot}/{event.camera}: {names}"
    if isinstance(event, LivePose):
        return f"{event.robot} at {event.pose.x_m:.2f}, {event.pose.y_m:.2f} m, {event.trust}"
    if isinstance(event, LivePresence):
        return f"{event.robot} {'came' if event.alive else 'went'}"
    if isinstance(event, LiveMapChange):
        return f"map {event.map}: version {event.version}" if event.version else f"map {event.map} was deleted"
    if isinstance(event, LiveMissed):
        return f"{event.events} events missed"
    return None


async def watch(server: str, map: str, count: int) -> None:
    async with AsyncMapClient(server) as maps, await maps.live_events(map) as events:
        print(f"watching {map}", flush=True)
        async for event in events:
            text = sentence(event)
            if text is not None:
                print(text, flush=True)
                count -= 1
                if count == 0:
                    return


def main() -> None:
    parser = argparse.ArgumentParser(description="Print the events of a map as they come.")
    parser.add_argument("--server", default="http://127.0.0.1:8080", help="the server's HTTP address")
    parser.add_argument("--map", default="hall", help="map to watch")
    parser.add_argument("--count", type=int, default=0, help="stop after so many; 0: never")
    arguments = parser.parse_args()
    asyncio.run(watch(arguments.server, arguments.map, arguments.count))


if __name__ == "__main__":
    try:
        main()
    except (WaymarkError, OSError) as error:
        sys.exit(f"{Path(sys.argv[0]).name}: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
