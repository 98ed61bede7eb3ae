#!/usr/bin/env python3
"""Digests of the data sets that data/SETS.toml lists.

The digest of a set is the SHA-256 of one line for each of its files, sorted by path, each ending with a newline:

    relative/path/with/slashes<space>hexadecimal SHA-256 of the file

Every file of the folder counts, its README included; folders and links do not.

    python3 data/digest.py FOLDER...           digest and number of files of each folder
    python3 data/digest.py --check DIR         compare the folders of DIR with data/SETS.toml

--check prints a line for each set that is missing or differs, and ends with status 1 if there is one.
"""

import argparse
import hashlib
import pathlib
import sys
import tomllib

SETS = pathlib.Path(__file__).resolve().parent / "SETS.toml"


def file_digest(path):
    """Hexadecimal SHA-256 of one file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digest(folder):
    """(number of files, hexadecimal SHA-256) of a folder."""
    files = [path for path in folder.rglob("*") if path.is_file() and not path.is_symlink()]
    lines = [f"{path.relative_to(folder).as_posix()} {file_digest(path)}\n" for path in files]
    # Sorted by code points, so that the order does not depend on the machine.
    return len(lines), hashlib.sha256("".join(sorted(lines)).encode()).hexdigest()


def check(root):
    """The sets below `root` that are not as listed, a sentence each."""
    with open(SETS, "rb") as file:
        sets = tomllib.load(file)["set"]
    for known in sets:
        folder = root / known["name"]
        if not folder.is_dir():
            yield f"{known['name']}: missing"
            continue
        files, sha256 = digest(folder)
        if files != known["files"]:
            yield f"{known['name']}: {files} files, {known['files']} are listed"
        elif sha256 != known["sha256"]:
            yield f"{known['name']}: the content differs, sha256 {sha256}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", type=pathlib.Path, metavar="FOLDER")
    parser.add_argument("--check", type=pathlib.Path, metavar="DIR", help="folder that holds the sets")
    arguments = parser.parse_args()
    if arguments.check is None and not arguments.folders:
        parser.error("name folders, or --check DIR")
    if arguments.check is not None:
        if not arguments.check.is_dir():
            parser.error(f"{arguments.check} is not a folder")
        differing = list(check(arguments.check))
        print("\n".join(differing) or "all sets are as listed")
        return 1 if differing else 0
    for folder in arguments.folders:
        if not folder.is_dir():
            parser.error(f"{folder} is not a folder")
        files, sha256 = digest(folder)
        print(f"{sha256} {files:5} {folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
