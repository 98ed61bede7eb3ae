"""The client of the HTTP interface for asyncio, written by hand; `tools/generate.py` makes `_sync` of it."""
