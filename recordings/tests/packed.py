"""Writes small files whose chunks are packed by others: `python packed.py` in the folder `recordings/tests`, with
mcap 1.6.0, lz4 4.4.5 and zstandard 0.25.0. `fixtures/no_chunks.mcap` has its messages outside of chunks.
"""

from mcap.writer import CompressionType, Writer

for name, options in [
    ("zstd", {"compression": CompressionType.ZSTD}),
    ("lz4", {"compression": CompressionType.LZ4}),
    ("no_chunks", {"use_chunking": False}),
]:
    with open(f"fixtures/{name}.mcap", "wb") as file:
        writer = Writer(file, chunk_size=10_000, **options)
        writer.start(profile="ros2", library="packed.py")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/text", "cdr", schema)
        for i in range(200):
            writer.add_message(channel, i, (f"message {i} " * 20).encode(), i)
        writer.finish()
