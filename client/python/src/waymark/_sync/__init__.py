# Made by tools/generate.py from _async/__init__.py. Do not edit.
"""The client of the HTTP interface that blocks."""
