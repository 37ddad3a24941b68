#!/usr/bin/env python3
"""Checks that includes follow the directions in ARCHITECTURE.md, and that only the two allowed places include gRPC."""

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
                         # The protocol's definitions, which both ends share; never the driver.
                         "display/drivers/voxlink/protocol", "display/drivers/voxlink/packet",
                         "display/drivers/voxlink/assembler", "display/drivers/voxlink/capabilities",
                         "display/drivers/voxlink/decoder",
                         "display/drivers/fadecandy/protocol"],
    "display/drivers": ["display/api", "display/conformance", "display/crc", "display/sync", "display/usb",
                        "display/geometry"],
    # The only driver whose device is not on a bus: it contains its model and carrier.
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
              # The syntax of an address, and suggestions: the same at both ends.
              "daemon/address", "daemon/usage",
              # The protobuf form of a display's geometry.
              "daemon/geometry_wire",
              # Strokes of letters: in scenes and in pictures of them.
              "daemon/text",
              # Colour maps and pictures of meshes, read as the daemon reads them.
              "daemon/colormaps", "daemon/pictures"],
    # Emulated devices belong to display; this is the program that runs them.
    "tools/emulator": ["display", "daemon/usage", "tools/emulator"],
    "tools/bench": ["gpu", "display", "daemon/wire", "voxeld/v1", "tools/bench"],
    "tools/bench/voxel_bench": ["display/sync", "voxeld/v1", "tools/child", "daemon/process",
                                "tools/bench/frame",
                                "tools/bench/paper"],
    # The only command that opens displays itself; it parses them as the daemon does.
    "tools/voxelctl/verify": ["display/conformance", "display/drivers/registry", "display/drivers/driver_context",
                              "display/drivers/options", "display/sync", "display/usb", "daemon/config/display_config",
                              "daemon/config/display_view", "tools/voxelctl"],
    # A display is shown during calibration as the daemon would show it.
    "tools/voxelctl/calibrate": ["display/drivers/registry", "display/drivers/options", "display/drivers/driver_context",
                                 "display/profiles", "display/sync", "display/api", "display/usb", "gpu", "daemon/config",
                                 "daemon/core", "display/geometry", "tools/voxelctl"],
    # A written profile is tested as the daemon would use it.
    "tools/voxelctl/init": ["display/drivers/registry", "display/drivers/options", "display/profiles", "display/sync",
                            "tools/voxelctl"],
    # Receives the protocols in which the network driver sends pictures.
    "tools/lights": ["display/drivers/network/protocol", "display/sync", "daemon/address", "tools/lights"],
    "tools/voxelctl/lights": ["display/drivers/wiring", "display/sync", "gpu/affine", "voxeld", "tools/lights", "tools/voxelctl"],
    "tools/markers": ["voxeld", "scene_update", "display/sync", "tools/markers"],
    # A separate program, which uses the parts of voxelctl that connect and that show received scenes.
    "tools/ros": ["voxeld/credentials", "daemon/usage", "display/sync", "tools/markers", "tools/voxelctl/cli/server_options",
                  "tools/voxelctl/commands/console", "tools/voxelctl/connection/address", "tools/voxelctl/connection/connection",
                  "tools/voxelctl/feed", "tools/voxelctl/process", "tools/voxelctl/text", "tools/ros"],
    "tools/recording": ["voxeld/v1", "tools/recording"],
    # Tokens are made in the form that the daemon reads.
    "tools/voxelctl/token": ["daemon/access", "daemon/address", "tools/voxelctl"],
    # Parses descriptions of displays as the daemon does.
    "tools/voxelctl/profile": ["display/api", "display/drivers/options", "display/drivers/usb_options",
                               "display/drivers/simulated", "display/geometry", "display/profiles",
                               "tools/voxelctl"],
    # Its own headers are "voxeld/…", in the form that its users write.
    "client": ["voxeld", "display/sync", "daemon/address"],
    # Public headers use neither protobuf nor anything else of this project.
    "client/cpp/voxeld": ["voxeld/address.h", "voxeld/basics.h", "voxeld/credentials.h", "voxeld/drawing.h", "voxeld/expression.h",
                          "voxeld/receipt.h", "voxeld/shapes.h"],
    "client/cpp/examples": ["voxeld/client.h"],
    "tests": ["daemon", "gpu", "display", "voxeld", "tools", "client"],
}

# Every folder may include these.
SHARED = ("common/",)

# The only places that may include gRPC's headers: one on each side of the connection. No header includes them.
GRPC = ("daemon/services/", "tools/voxelctl/connection", "tools/bench/voxel_bench/", "client/cpp/")
GRPC_TESTS = ("tests/daemon/services/", "tests/e2e/", "tests/hil/", "tests/tools/", "tests/integration/")
PROTOBUF_FREE = ("common/", "gpu/", "display/", "daemon/scene/", "daemon/core/", "daemon/pipeline/", "daemon/config/")

# Includes that are relative to the repository root, or to protobuf's output folder.
OURS = re.compile(r"(common|display|gpu|daemon|tools|client|tests|voxeld)/")
INCLUDE = re.compile(r'^\s*#\s*include\s+([<"])([^">]+)[">]')


def rule_of(path):
    best = max((f for f in ALLOWED if path.startswith(f + "/")), key=len, default=None)
    return best


def wrong_includes(path, lines, own_header=os.path.exists):
    """Returns: what is wrong with the includes of a file, whose path is relative to the repository root. own_header says whether a
    header exists at a path."""
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
            # These are also built outside of the tree.
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
