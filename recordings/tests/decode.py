"""Decodes every message of a recording by the schemas in it; a line for each kind: its name, count and some fields.

    python decode.py FILE        (mcap and mcap-protobuf-support)
"""

import sys
from collections import Counter

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

FIELDS = {
    "waymark.v1.Frame": lambda m: f"seq={m.seq} width_px={m.width_px}",
    "waymark.v1.RobotPose": lambda m: f"map={m.map}",
    "waymark.v1.MapChanged": lambda m: f"version={m.version}",
    "foxglove.RawImage": lambda m: f"encoding={m.encoding} step={m.step}",
    "foxglove.SceneUpdate": lambda m: f"entities={len(m.entities)}",
    "foxglove.ImageAnnotations": lambda m: f"text={m.texts[0].text}",
}

counts, last = Counter(), {}
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
    for schema, _channel, _message, decoded in reader.iter_decoded_messages():
        counts[schema.name] += 1
        last[schema.name] = decoded
for name in sorted(counts):
    shown = FIELDS.get(name)
    print(" ".join([name, str(counts[name])] + ([shown(last[name])] if shown else [])))
