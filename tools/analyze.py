#!/usr/bin/env python3
"""Runs clang-16's analyses, or GCC, over translation units, as many at once as tools/jobs says.

usage: analyze.py syntax|gcc|tidy|affected BUILD_DIR FILE...
Exit 1 if any finding; each is printed once. `syntax` (Clang, with its analysis of lock annotations) and `gcc` compile without writing
anything; a header is compiled on its own, with the options of a source that includes it. `affected` compiles nothing: it prints what to
compile after the headers among FILE have changed. That is, for each of these headers and each header that includes one of them, directly
or indirectly, the source of the same name, which includes it first, or, without such a source, the header. Files that are built only with
CUDA are skipped, and so are the parts named *-inl.h, which a source includes in its middle.
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


INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)


def includers():
    """Returns: by each header of the project, the files that include it."""
    listed = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.c", "*.cc", "*.h", "*.cu", "*.cuh"],
                            capture_output=True, text=True, check=True).stdout.split()
    listed = [path for path in listed if os.path.exists(path)]
    known = set(listed)
    found = {}
    for path in listed:
        with open(path, encoding="utf-8") as file:
            names = INCLUDE.findall(file.read())
        for name in names:
            # Searched in the compiler's order: beside the including file, then in the root, then where users' programs have the client.
            for place in (os.path.normpath(os.path.join(os.path.dirname(path), name)), name, "client/cpp/" + name):
                if place in known:
                    found.setdefault(place, []).append(path)
                    break
    return found


def affected(paths, included_by):
    """Returns: what to compile after the headers among `paths` have changed; see above."""
    found = []
    open_ = [path for path in paths if path.endswith(".h")]
    seen = set(open_)
    while open_:
        path = open_.pop()
        source = path[:-2] + ".cc"
        found.append(source if os.path.exists(source) else path)
        for includer in included_by.get(path, []):
            if includer.endswith(".h") and includer not in seen:
                seen.add(includer)
                open_.append(includer)
    return sorted(found)


def source_that_includes(header, included_by, commands):
    """Returns: a source of the build that includes `header` through the fewest intermediate headers, or None."""
    seen = {header}
    level = [header]
    while level:
        following = []
        for path in level:
            for includer in included_by.get(path, []):
                if includer.endswith((".cc", ".c")) and os.path.realpath(includer) in commands:
                    return includer
                if includer not in seen:
                    seen.add(includer)
                    following.append(includer)
        level = following
    return None


def header_entry(header, included_by, commands):
    """Returns: the command that compiles `header` by itself, or None."""
    source = source_that_includes(header, included_by, commands)
    if source is None:
        return None
    entry = commands[os.path.realpath(source)]
    # CMake ends the command with the source.
    command = entry["command"].removesuffix(entry["file"])
    language = "c" if source.endswith(".c") else "c++"
    return {"file": os.path.realpath(header), "directory": entry["directory"],
            "command": f"{command} -x {language} {shlex.quote(os.path.realpath(header))}"}


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
    if not os.path.basename(arguments[0]).startswith("clang"):  # C
        return [argument for argument in arguments if not argument.startswith("-Wthread-safety")] + ["-fsyntax-only", "-w"]
    # With -w, Clang would not warn of anything.
    return arguments + ["-fsyntax-only", "-Wno-everything", "-Wthread-safety", "-Werror=thread-safety"]


def run(mode, build_dir, path, commands):
    entry = None if path.endswith("-inl.h") else commands.get(os.path.realpath(path))
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
    """Returns whether the file is a CUDA source, a source of a disabled part or some test's main file, which are built elsewhere,
    some of them only with a GPU."""
    return path.endswith("-inl.h") or re.match(r"gpu/cuda/|tools/bench/(frame|paper)/(no_)?cuda_"
                    r"|tests/.*cuda|tests/gpu/simt/(include/|vectors\.h|engines_simt\.cc)|tests/gpu/worker/illegal_|tests/fuzz/packed_main\.cc", path)


def jobs():
    here = os.path.dirname(os.path.abspath(__file__))
    return int(subprocess.run([os.path.join(here, "jobs")], capture_output=True, text=True, check=True).stdout)


def main():
    if len(sys.argv) < 3 or sys.argv[1] not in ("syntax", "gcc", "tidy", "affected"):
        print(__doc__, file=sys.stderr)
        return 2
    mode, build_dir, paths = sys.argv[1], sys.argv[2], sys.argv[3:]
    commands = compile_commands(build_dir)
    headers = [path for path in paths if path.endswith(".h")]
    if headers:
        included_by = includers()
        if mode == "affected":
            print("\n".join(affected(headers, included_by)))
            return 0
        for path in headers:
            entry = header_entry(path, included_by, commands)
            if entry is not None:
                commands[os.path.realpath(path)] = entry
    if mode == "affected":
        return 0
    found = False
    with concurrent.futures.ThreadPoolExecutor(jobs()) as pool:
        for output in pool.map(lambda path: run(mode, build_dir, path, commands), paths):
            if output:
                found = True
                print(output, end="")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
