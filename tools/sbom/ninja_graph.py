"""Finds the inputs of a program of a Ninja build: objects, and the files that the compiler read for each object."""
import os
import struct
import subprocess


def inputs(build, target):
    """Returns: all direct and indirect inputs of `target`, as paths relative to `build` or absolute ones."""
    listed = subprocess.run(["ninja", "-C", build, "-t", "inputs", target], capture_output=True, text=True, check=True)
    return [line for line in listed.stdout.splitlines() if line and not line.startswith("ninja:")]


def dependencies(build):
    """Returns: {object: files that its compiler read}, from Ninja's log. The log is parsed here, because Ninja rewrites its log when
    it is queried, which must not happen while another Ninja builds."""
    with open(os.path.join(build, ".ninja_deps"), "rb") as file:
        data = file.read()
    magic = b"# ninjadeps\n"
    if not data.startswith(magic) or struct.unpack_from("<i", data, len(magic))[0] not in (3, 4):
        raise SystemExit(f"{build}/.ninja_deps: neither version 3 nor 4 of Ninja's log")
    has_long_time = struct.unpack_from("<i", data, len(magic))[0] == 4
    at, paths, found = len(magic) + 4, [], {}
    while at + 4 <= len(data):
        size = struct.unpack_from("<I", data, at)[0]
        at += 4
        is_list, size = bool(size >> 31), size & 0x7FFFFFFF
        if at + size > len(data):
            break  # an entry that is currently being written
        record = data[at : at + size]
        at += size
        if is_list:
            numbers = struct.unpack(f"<{size // 4}I", record)
            found[numbers[0]] = numbers[3 if has_long_time else 2 :]
        else:
            paths.append(record[:-4].rstrip(b"\0").decode())
    return {paths[key]: [paths[number] for number in numbers] for key, numbers in found.items()}


def files_read(build, programs):
    """Returns: real paths of all files that were read to make `programs`: headers, and static libraries that are not part of the
    build."""
    read = dependencies(build)
    result = set()
    for program in programs:
        for path in inputs(build, os.path.relpath(program, build)):
            result.update(read.get(path, []))
            if path.endswith((".a", ".o")) and os.path.isabs(path):
                result.add(path)
    return {os.path.realpath(os.path.join(build, path)) for path in result}
