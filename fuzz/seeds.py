#!/usr/bin/env python3
"""Writes the seeds of the fuzz targets (fuzz/corpus) of real values: examples of the HTTP interface, files of walls and
logs, messages of a robot, a visibility area. `python3 fuzz/seeds.py` after a change of a format.

JPEG seeds are made by `cjpeg` (Debian: libjpeg-turbo-progs) where it is installed, and else stay as they are."""

import json
import shutil
import struct
import subprocess
import zlib
from pathlib import Path

ROOT = Path(__file__).resolve().parent
CORPUS = ROOT / "corpus"


def seed(target, name, data):
    folder = CORPUS / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(data if isinstance(data, bytes) else data.encode())


def varint(n):
    n &= (1 << 64) - 1
    out = bytearray()
    while True:
        out.append(n & 127 | (128 if n > 127 else 0))
        n >>= 7
        if not n:
            return bytes(out)


def number(field, n):
    return varint(field << 3) + varint(n)


def real(field, x):
    return varint(field << 3 | 1) + struct.pack("<d", x)


def inner(field, data):
    return varint(field << 3 | 2) + varint(len(data)) + data


def doubles(field, values):
    return inner(field, b"".join(struct.pack("<d", x) for x in values))


def messages():
    pose = real(1, 1.5) + real(2, -2.0) + real(3, 0.7)
    head = number(1, 0x1234_5678_9ABC) + number(2, 17) + number(3, 1_795_442_730_000_000_000)
    camera = real(1, 600.0) + real(2, 601.0) + real(3, 320.0) + real(4, 240.0) + doubles(5, [-0.2, 0.05, 0, 0, 0])
    mount = real(1, -0.5) + real(2, 0.5) + real(3, -0.5) + real(4, 0.5) + real(5, 0.1) + real(7, 1.2)
    prior = inner(1, pose) + doubles(2, [0.1, 0, 0, 0, 0.1, 0, 0, 0, 0.05])
    frame = head + number(4, 3) + number(5, 4) + number(6, 3) + inner(7, bytes(12))
    frame += inner(8, camera) + inner(9, mount) + inner(10, pose) + inner(11, prior) + number(12, 400) + inner(13, b"hall")
    corners = [(8, 8), (40, 9), (41, 40), (9, 41)]
    border = b"".join(inner(1, real(1, x) + real(2, y)) for x, y in corners)
    patch = number(3, 48) + number(4, 48) + number(5, 3) + inner(6, bytes(48 * 48))
    found = inner(1, border) + doubles(2, [0.5, 0.0, 0.5] * 4) + inner(3, border) + real(4, 0.9) + inner(6, patch)
    quads = head + number(4, 64) + number(5, 48) + inner(6, found) + inner(7, camera) + inner(8, mount) + inner(9, pose)
    scan = head + inner(4, pose) + inner(5, pose) + real(6, -1.5) + real(7, 0.05) + real(8, 20.0)
    scan += inner(9, b"".join(struct.pack("<f", 1 + i / 10) for i in range(60)))
    gaze = inner(1, prior) + real(2, 0.1) + real(4, 1.2) + real(7, 1.0) + doubles(8, [-1.5, 1.5]) + number(10, 2)
    localise = inner(1, frame) + inner(2, scan) + inner(3, b"hall") + number(4, 2000)
    for i, (name, data) in enumerate(
        [("frame", frame), ("quads", quads), ("odometry", head + inner(4, pose)), ("scan", scan), ("gaze", gaze),
         ("localise", localise)]
    ):
        seed("messages", name, bytes([i]) + data)


def png(width, height, depth, colour, rows, extra=b"", interlace=0):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, interlace)
    body = chunk(b"IHDR", head) + extra + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def images():
    for name, depth, colour, channels in [("grey", 8, 0, 1), ("grey16", 16, 0, 1), ("rgb", 8, 2, 3), ("rgba", 8, 6, 4),
                                          ("bits", 1, 0, 1)]:
        width, height = 24, 16
        line = (width * channels * depth + 7) // 8
        rows = b"".join(bytes([y % 5]) + bytes((x * 7 + y * 3) & 255 for x in range(line)) for y in range(height))
        seed("png", name, png(width, height, depth, colour, rows))
    palette = struct.pack(">I", 12) + b"PLTE" + bytes(range(12)) + struct.pack(">I", zlib.crc32(b"PLTE" + bytes(range(12))))
    rows = b"".join(b"\0" + bytes(x % 4 for x in range(8)) for _ in range(8))
    seed("png", "palette", png(8, 8, 8, 3, rows, palette))
    if not shutil.which("cjpeg"):
        return
    pixels = bytes((x * 9 + y * (5 + c)) % 256 for y in range(30) for x in range(40) for c in range(3))
    picture = b"P6 40 30 255\n" + pixels
    for name, options in [("colour", []), ("grey", ["-grayscale"]), ("progressive", ["-progressive"]),
                          ("sampled", ["-sample", "2x2"]), ("restart", ["-restart", "1"]), ("rgb", ["-rgb"])]:
        made = subprocess.run(["cjpeg", "-quality", "60", *options], input=picture, stdout=subprocess.PIPE, check=True)
        seed("jpeg", name, made.stdout)


def json_bodies():
    examples = json.loads((ROOT.parent / "server/src/http/examples.json").read_text())
    capture = {
        "intrinsics": {"fx_px": 600.0, "fy_px": 600.0, "cx_px": 320.0, "cy_px": 240.0},
        "map_from_robot": {"pose": {"x_m": 1.0, "y_m": 2.0, "theta_rad": 0.5},
                           "covariance": [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.001]},
        "robot_from_camera": {"qx": -0.5, "qy": 0.5, "qz": -0.5, "qw": 0.5, "x_m": 0.1, "y_m": 0.0, "z_m": 1.2},
        "ceiling_height_m": 2.5,
    }
    of = ["POST /maps/{map}/landmarks", "POST /maps/{map}/bulk/create-landmarks",
          "PATCH /maps/{map}/landmarks/{landmark}", capture, [[1, 2], [30, 2], [30, 40], [1, 40]],
          "PUT /maps/{map}/walls", "POST /maps/{map}/landmarks/{landmark}/learn", "POST /maps/{map}/learn",
          "POST /maps/{map}/gatherings", "POST /maps/{map}/gatherings/{gathering}/accept", "POST /maps",
          "POST /robots/{robot}/cameras/{camera}/calibrate", "POST /maps/{map}/visible", "POST /maps/{map}/coverage"]
    for i, body in enumerate(of):
        body = examples[body] if isinstance(body, str) else body
        seed("json", f"body-{i:02}", bytes([i]) + json.dumps(body).encode())
    far = {**capture, "robot_from_camera": {**capture["robot_from_camera"], "z_m": 12.2}}
    seed("json", "far-camera", b"\x03" + json.dumps(far).encode())


def map_files():
    yaml = "image: map.pgm\nresolution: 0.05\norigin: [-1.0, -2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    rows = ["#" * 20, *["#" + "." * 18 + "#"] * 12, "#" * 20]
    pgm = b"P5\n20 14\n255\n" + b"".join(bytes(0 if c == "#" else 254 for c in row) for row in rows)
    seed("map_files", "grid", b"\0" + yaml.encode() + b"\0" + pgm)
    seed("map_files", "grid-default-picture", b"\0" + yaml.replace("negate: 0", "negate: 1\nmode: scale").encode())
    line = {"type": "LineString", "coordinates": [[0, 0], [4, 0], [4, 3]]}
    ring = {"type": "Polygon", "coordinates": [[[0, 0], [4, 0], [4, 3], [0, 3], [0, 0]]]}
    features = [{"type": "Feature", "properties": {}, "geometry": g} for g in (line, ring)]
    seed("map_files", "geojson", b"\x01" + json.dumps({"type": "FeatureCollection", "features": features}).encode())
    seed("map_files", "walls", b"\x02" + json.dumps({"segments": [{"a": [0, 0], "b": [4, 0]}]}).encode())
    svg = '<svg xmlns="http://www.w3.org/2000/svg" width="8cm" height="2cm" viewBox="0 0 8 2"><g transform="rotate(5)">'
    svg += '<path stroke="red" d="M0 1H8 q 1 1 2 0 a1 1 0 0 1 1 1z"/><rect stroke="#000" width="3" height="1"/></g></svg>'
    seed("map_files", "svg", b"\x03" + svg.encode())
    seed("map_files", "vector", b"\x040 0 4 0\n4 0 4 3\n1000,2000,3000,2000\n")
    beams = " ".join(f"{1 + i / 50:.2f}" for i in range(36))
    flaser = f"FLASER 36 {beams} 0.1 0.2 0.3 0.1 0.2 0.3 976052857.34 host 0.1\n"
    seed("map_files", "carmen", b"\x05" + ("# CARMEN\nODOM 0 0 0 0 0 0 1.0 host 1.0\n" + flaser * 2).encode())
    seed("map_files", "numbered", b"\x05" + ("1 0.1 0.2 0.3 " + beams + "\n").encode())


def texts():
    for i, key in enumerate(["robot/r1/frame/front", "robot/r1/quads/c-0", "robot/r1/odometry", "robot/r1/alive/7",
                             "robot/r1/rpc/gaze", "map/hall/changed", "map/hall/version"]):
        seed("keys", f"key-{i}", f"default\nwaymark/1/default/{key}")
    seed("keys", "key-below", "works_2\nrobot/r1/answer/front")
    secret = "A" * 43
    seed("credentials", "bearer", f"Bearer wmk_17_{secret}")
    seed("credentials", "local", f"wmk_local-8080_{secret}")
    seed("credentials", "cookie", f"waymark_session_8080\na=b; waymark_session_8080={secret}; c")
    seed("credentials", "key", "6f1c0a52-0b7a-4c9e-9c6e-3d0c1f2a4b5d")


def poses():
    usual = [240, 160, 400, 165, 398, 320, 242, 318, *[0.25, 0, 0.25] * 4, 0.6, 0.6, 600, 600, 320, 240]
    for name, numbers in [
        ("usual", usual),
        ("bent", [*usual, -0.2, 0.05, 0.001, 0.0, 0.0]),
        ("front", [250, 142, 390, 142, 390, 338, 250, 338, *usual[8:20], 0.6, 0.84, 700, 700, 320, 240]),
        ("far", [318, 238, 322, 238, 322, 242, 318, 242, *usual[8:]]),
    ]:
        seed("pose", name, struct.pack(f"<{len(numbers)}d", *numbers))


def stored():
    # `model` is a row of `model_contents` behind one byte; it stays as it is.
    seed("stored", "model-head", (CORPUS / "stored/model").read_bytes()[:201])
    seed("stored", "area", b"\x00\x01" + struct.pack("<12d", 8, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0))


for write in (messages, images, json_bodies, map_files, texts, poses, stored):
    write()
