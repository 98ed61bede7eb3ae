"""The bodies of the HTTP interface as frozen dataclasses, with the field names of its JSON and the type names of its
OpenAPI document; enumerations have no `Body` in their name.

Lengths are metres, angles radians, counter-clockwise from the map's x axis; times are milliseconds or nanoseconds since
the Unix epoch; the last part of a field's name is its unit. Covariances are over (x, y, theta), row-major. Answers,
quads and poses of the wire are in `waymark.wire`.
"""

from waymark.api import bodies, live
from waymark.api.bodies import *  # noqa: F403
from waymark.api.live import *  # noqa: F403

__all__ = [*bodies.__all__, *live.__all__]
