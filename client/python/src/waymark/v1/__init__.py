"""The messages of the wire as the protobuf compiler makes them. `waymark.wire` has them as dataclasses."""
