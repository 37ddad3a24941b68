#!/usr/bin/env python3
"""Runs clang-16's analyses, or GCC, over translation units, as many at once as tools/jobs says.

usage: analyze.py syntax|gcc|tidy BUILD_DIR FILE...
Exit 1 if any finding; each is printed once. `syntax` (Clang, with its analysis of lock annotations) and `gcc` compile without writing
anything. Sources that are only built with CUDA are passed over.
"""

import concurrent.futures
import json
import os
import re
import shlex
import subprocess
import sys


def compile_commands(build_dir):
    with open(os.path.join(build_dir, "compile_commands.json"), encoding="utf-8") as file:
        return {os.path.realpath(entry["file"]): entry for entry in json.load(file)}


def analysis_command(mode, build_dir, path, entry):
    if mode == "tidy":
        return ["clang-tidy-16", "--quiet", "-p", build_dir, path]
    arguments = shlex.split(entry["command"])
    if os.path.basename(arguments[0]) == "ccache":
        arguments = arguments[1:]
    cut = arguments.index("-o")
    del arguments[cut : cut + 2]
    arguments.remove("-c")
    if mode == "gcc":
        arguments = ["g++", *(argument for argument in arguments[1:] if not argument.startswith("-Wthread-safety"))]
        return arguments + ["-fsyntax-only", "-w"]
    # With -w, Clang would not warn of anything.
    return arguments + ["-fsyntax-only", "-Wno-everything", "-Wthread-safety", "-Werror=thread-safety"]


def run(mode, build_dir, path, commands):
    entry = commands.get(os.path.realpath(path))
    if entry is None:
        return "" if optional(path) else f"{path}: not part of the build\n"
    done = subprocess.run(
        analysis_command(mode, build_dir, path, entry),
        cwd=None if mode == "tidy" else entry["directory"],
        capture_output=True,
        text=True,
        check=False,
    )
    return (done.stdout + done.stderr) if done.returncode else ""


def optional(path):
    """CUDA sources, sources of switched-off parts and some tests' main files are built elsewhere, some only where there is a GPU."""
    return path.startswith(("gpu/cuda/", "gpu/worker/")) or re.match(
        r"tools/bench/(frame|paper)/(no_)?cuda_|tests/.*cuda|tests/gpu/simt/engines_simt\.cc|tests/fuzz/packed_main\.cc", path)


def jobs():
    here = os.path.dirname(os.path.abspath(__file__))
    return int(subprocess.run([os.path.join(here, "jobs")], capture_output=True, text=True, check=True).stdout)


def main():
    if len(sys.argv) < 3 or sys.argv[1] not in ("syntax", "gcc", "tidy"):
        print(__doc__, file=sys.stderr)
        return 2
    mode, build_dir, paths = sys.argv[1], sys.argv[2], sys.argv[3:]
    commands = compile_commands(build_dir)
    found = False
    with concurrent.futures.ThreadPoolExecutor(jobs()) as pool:
        for output in pool.map(lambda path: run(mode, build_dir, path, commands), paths):
            if output:
                found = True
                print(output, end="")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
