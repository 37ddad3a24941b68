#!/usr/bin/env python3
"""Removes precompiled headers of a Ninja build if a header in them was installed after they were built, so that Ninja rebuilds them.

usage: stale_headers.py BUILD
Ninja compares modification times. dpkg sets those to the time at which the package was built, so an upgraded header seems to be older
than the precompiled header. The change time (ctime) is the time of the installation.
"""

import os
import subprocess
import sys
from pathlib import Path


def is_stale(build, precompiled):
    """Returns: whether a header in `precompiled` was installed after it was built. Generated headers are left to Ninja."""
    made = precompiled.stat().st_mtime
    listed = subprocess.run(["ninja", "-C", build, "-t", "deps", precompiled.relative_to(build)], capture_output=True, text=True, check=False)
    for line in listed.stdout.splitlines():
        header = line.strip()
        if not line.startswith("    /") or header.startswith(f"{build}{os.sep}"):
            continue
        try:
            if os.stat(header).st_ctime > made:
                return True
        except FileNotFoundError:
            return True
    return False


def main():
    if len(sys.argv) != 2:
        print(__doc__.splitlines()[2], file=sys.stderr)
        return 2
    build = Path(sys.argv[1]).resolve()
    if not (build / ".ninja_deps").exists():
        return 0
    for precompiled in sorted(build.rglob("*.pch")):
        if is_stale(build, precompiled):
            print(f"-- {precompiled.relative_to(build)} is stale and will be rebuilt: a header in it was installed later")
            precompiled.unlink()
    return 0


if __name__ == "__main__":
    sys.exit(main())
