#!/usr/bin/env python3
"""Checks that includes point the way that ARCHITECTURE.md says, and that gRPC stays behind its two doors."""

import os
import re
import subprocess
import sys

# A folder may include itself and these; the longest prefix decides.
ALLOWED = {
    "common": [],
    "display/sync": [],
    "display/crc": [],
    "display/api": ["display/sync"],
    "display/geometry": ["display/api"],
    "display/profiles": [],
    "display/usb": ["display/api", "display/sync"],
    "display/conformance": ["display/sync", "display/usb"],
    "display/emulator": ["display/api", "display/sync", "display/usb", "display/geometry",
                         # The protocol's words, shared by both ends; never the driver.
                         "display/drivers/voxlink/protocol", "display/drivers/voxlink/packet",
                         "display/drivers/voxlink/assembler", "display/drivers/voxlink/capabilities",
                         "display/drivers/voxlink/decoder",
                         "display/drivers/fadecandy/protocol"],
    "display/drivers": ["display/api", "display/conformance", "display/crc", "display/sync", "display/usb",
                        "display/geometry"],
    # The one driver whose device is not on a bus: it brings its model and carrier along.
    "display/drivers/simulated": ["display"],
    "gpu": ["display/api", "display/crc", "display/geometry", "display/sync"],
    "daemon": ["gpu", "display", "voxeld/v1", "daemon"],
    "daemon/scene": ["gpu", "display/api", "display/sync"],
    "daemon/pipeline": ["gpu", "display/api", "display/geometry", "display/sync", "daemon/scene", "daemon/core"],
    "daemon/core": ["gpu", "display/api", "display/geometry", "display/sync", "daemon/scene", "daemon/pipeline"],
    "daemon/explain": ["gpu", "display/api", "display/sync", "daemon/scene"],
    "daemon/access": ["display/sync", "daemon/address", "daemon/log"],
    "daemon/listen": ["display/sync", "daemon/address", "daemon/core/stats", "daemon/log"],
    "tools": ["voxeld", "display/geometry", "display/api", "display/sync", "gpu", "tools",
              # What an address looks like, and what was meant: alike at both ends.
              "daemon/address", "daemon/usage",
              # What a display's geometry is, on the wire.
              "daemon/geometry_wire",
              # Strokes of letters: in scenes and in pictures of them.
              "daemon/text",
              # Colour maps and pictures of meshes, read as the daemon reads them.
              "daemon/colormaps", "daemon/pictures"],
    # Emulated devices are of display; this is their program.
    "tools/emulator": ["display", "daemon/usage", "tools/emulator"],
    "tools/bench": ["gpu", "display", "daemon/wire", "voxeld/v1", "tools/bench"],
    "tools/bench/voxel_bench": ["display/sync", "voxeld/v1", "tools/child", "daemon/process",
                                "tools/bench/frame",
                                "tools/bench/paper"],
    # The one command that opens displays itself; it reads them as the daemon does.
    "tools/voxelctl/verify": ["display/conformance", "display/drivers/registry", "display/drivers/driver_context",
                              "display/drivers/options", "display/sync", "display/usb", "daemon/config/display_config",
                              "daemon/config/display_view", "tools/voxelctl"],
    # What is calibrated is shown as the daemon would.
    "tools/voxelctl/calibrate": ["display/drivers/registry", "display/drivers/options", "display/drivers/driver_context",
                                 "display/profiles", "display/sync", "display/api", "display/usb", "gpu", "daemon/config",
                                 "daemon/core", "display/geometry", "tools/voxelctl"],
    # A profile that was written is tried as the daemon would.
    "tools/voxelctl/init": ["display/drivers/registry", "display/drivers/options", "display/profiles", "display/sync",
                            "tools/voxelctl"],
    # What comes in by the protocols by which pictures go out.
    "tools/lights": ["display/drivers/network/protocol", "display/sync", "daemon/address", "tools/lights"],
    "tools/voxelctl/lights": ["display/drivers/wiring", "display/sync", "gpu/affine", "voxeld", "tools/lights", "tools/voxelctl"],
    "tools/markers": ["voxeld", "scene_update", "display/sync", "tools/markers"],
    # A program of its own over what of voxelctl makes its connection and shows what comes in.
    "tools/ros": ["voxeld/credentials", "daemon/usage", "display/sync", "tools/markers", "tools/voxelctl/cli/server_options",
                  "tools/voxelctl/commands/console", "tools/voxelctl/connection/address", "tools/voxelctl/connection/connection",
                  "tools/voxelctl/feed", "tools/voxelctl/process", "tools/voxelctl/text", "tools/ros"],
    "tools/recording": ["voxeld/v1", "tools/recording"],
    # Tokens are made as the daemon reads them.
    "tools/voxelctl/token": ["daemon/access", "daemon/address", "tools/voxelctl"],
    # And this reads descriptions of displays as the daemon does.
    "tools/voxelctl/profile": ["display/api", "display/drivers/options", "display/drivers/usb_options",
                               "display/drivers/simulated", "display/geometry", "display/profiles",
                               "tools/voxelctl"],
    # Its own headers are "voxeld/…", as its users write them.
    "client": ["voxeld", "display/sync", "daemon/address"],
    # What users see has neither protobuf nor anything else of ours.
    "client/cpp/voxeld": ["voxeld/address.h", "voxeld/basics.h", "voxeld/credentials.h", "voxeld/drawing.h", "voxeld/expression.h",
                          "voxeld/receipt.h", "voxeld/shapes.h"],
    "client/cpp/examples": ["voxeld/client.h"],
    "tests": ["daemon", "gpu", "display", "voxeld", "tools", "client"],
}

# Every folder may include these.
SHARED = ("common/",)

# The only places that may include gRPC's headers: one on each side of the wire. No header does.
GRPC = ("daemon/services/", "tools/voxelctl/connection", "tools/bench/voxel_bench/", "client/cpp/")
GRPC_TESTS = ("tests/daemon/services/", "tests/e2e/", "tests/hil/", "tests/tools/", "tests/integration/")
PROTOBUF_FREE = ("common/", "gpu/", "display/", "daemon/scene/", "daemon/core/", "daemon/pipeline/", "daemon/config/")

# What is written from the repository root, or from where protobuf's files are made.
OURS = re.compile(r"(common|display|gpu|daemon|tools|client|tests|voxeld)/")
INCLUDE = re.compile(r'^\s*#\s*include\s+([<"])([^">]+)[">]')


def rule_of(path):
    best = max((f for f in ALLOWED if path.startswith(f + "/")), key=len, default=None)
    return best


def wrong_includes(path, lines, own_header=os.path.exists):
    """What is wrong with the includes of a file, whose path is from the repository root. own_header says whether there
    is a header of that path."""
    folder = rule_of(path)
    if folder is None:
        return [f"{path}: lies in no folder that has a rule"]
    wrong = []
    first = True
    for number, line in enumerate(lines, 1):
        match = INCLUDE.match(line)
        if not match:
            continue
        kind, target = match.groups()
        where = f"{path}:{number}"
        own = path[:-len(".cc")] + ".h"
        if first and path.endswith(".cc") and own_header(own) and not own.endswith(target):
            wrong.append(f"{where}: {own} comes first, so that it is known to stand alone")
        first = False
        if target.startswith(("grpc/", "grpcpp/", "grpc++/")) or target.endswith(".grpc.pb.h"):
            if path.endswith(".h") and not path.startswith("tests/"):
                wrong.append(f"{where}: a header includes gRPC's {target}")
            elif not path.startswith(GRPC + GRPC_TESTS):
                wrong.append(f"{where}: only {', '.join(GRPC)} may include gRPC's headers")
            continue
        if target.startswith("google/protobuf/") and path.startswith(PROTOBUF_FREE):
            wrong.append(f"{where}: {folder} knows no protobuf")
        if not OURS.match(target):
            # These are built outside of the tree as well.
            if kind == '"' and not path.startswith(("client/cpp/examples/", "display/drivers/voxlink/firmware/")) and os.path.exists(os.path.join(os.path.dirname(path), target)):
                wrong.append(f'{where}: "{target}" is not written from the repository root')
            continue
        if kind == "<":
            wrong.append(f'{where}: <{target}> is one of ours; it must be written "{target}"')
        if target.startswith("tests/") and not path.startswith("tests/"):
            wrong.append(f"{where}: product code includes a test's header")
        ok = target.startswith((folder + "/", *SHARED)) or any(
            target.startswith(a) for a in ALLOWED[folder]) or path.startswith("tests/")
        if not ok:
            wrong.append(f"{where}: {folder} must not include {target}")
    return wrong


def main():
    files = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard",
         "*.cc", "*.h", "*.cu", "*.cuh"],
        capture_output=True, text=True, check=True).stdout.split()
    wrong = []
    for path in files:
        with open(path, encoding="utf-8") as file:
            wrong += wrong_includes(path, file.readlines())
    print(f"include directions: {len(files)} files, {len(wrong)} wrong")
    for line in wrong:
        print(line, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
