#!/usr/bin/env python3
"""Seeds for the fuzz targets from real traffic: a voxeld of this tree with a network display of each protocol, and voxelctl drawing an
example of every shape; their messages, the persistent state and recordings become inputs. The rest is made from this tree's own files
and documents, and the protocols' own examples. They go to build/fuzz/seeds/TARGET, and from there to where tools/fuzz works
(build/fuzz/corpus); `tools/fuzz --merge` adds those that reach new code to the tree.

  tests/fuzz/make_seeds.py [--bin build/test/bin]
"""
import argparse
import hashlib
import os
import pathlib
import re
import shutil
import socket
import sqlite3
import struct
import subprocess
import sys
import tempfile
import threading
import time
import zlib
from concurrent import futures

import request_seeds
import session_seeds
import shape_seeds

ROOT = pathlib.Path(__file__).resolve().parents[2]
SEEDS = ROOT / "build/fuzz/seeds"
CORPUS = ROOT / "build/fuzz/corpus"
MOST = 4096


def text(data):
    """Encodes a text as Script::Text reads it (tests/fuzz/script.h)."""
    return data.replace(b"\\", b"\\\\") + b"\\a"


def put(target, data, most=MOST):
    if len(data) > most:
        return
    name = hashlib.sha1(data).hexdigest()
    for folder in (SEEDS / target, CORPUS / target):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


# ---- traffic between voxeld and its clients

class Recorder:
    """A server in front of the daemon's, which forwards every call unchanged, and records what clients send."""

    def __init__(self, listen, daemon):
        import grpc

        self.calls = []  # method, messages
        channel = grpc.insecure_channel(f"unix:{daemon}")
        recorder = self

        class Handler(grpc.GenericRpcHandler):
            def service(self, details):
                messages = []
                recorder.calls.append((details.method, messages))

                def requests(iterator):
                    for message in iterator:
                        messages.append(message)
                        yield message

                def call(iterator, context):
                    answers = channel.stream_stream(details.method)(requests(iterator))
                    context.add_callback(answers.cancel)
                    try:
                        yield from answers
                    except grpc.RpcError as error:
                        context.abort(error.code(), error.details())

                return grpc.stream_stream_rpc_method_handler(call)

        self.server = grpc.server(futures.ThreadPoolExecutor(max_workers=16), handlers=[Handler()])
        self.server.add_insecure_port(f"unix:{listen}")
        self.server.start()


def shapes():
    """Returns the examples of voxelctl's gallery, each with all its parts."""
    source = (ROOT / "tools/voxelctl/shape/examples.cc").read_text()
    literal = r'"(?:[^"\\]|\\.)*"'
    found = re.findall(r'\{"[^"]*",\s*((?:' + literal + r'\s*)+)\}', source)
    return ["".join(l[1:-1] for l in re.findall(literal, example)).split("\\n") for example in found]


def listen_udp():
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", 0))
    sock.settimeout(0.3)
    return sock


def collect(sock, into):
    try:
        while len(into) < 400:
            into.append(sock.recv(9216))
    except OSError:
        pass


def traffic(programs, folder):
    daemon, front, recording = folder / "d.sock", folder / "p.sock", folder / "r.mcap"
    senders = {p: listen_udp() for p in ("ddp", "e131", "artnet")}
    opc = socket.create_server(("127.0.0.1", 0))
    displays = ["cube=simulated,size=24x24x24"]
    for name, sock in {**senders, "opc": opc}.items():
        more = {"e131": ",sync_universe=9", "artnet": ",sync=true"}.get(name, "")
        displays.append(f"{name}=network,protocol={name},address=127.0.0.1:{sock.getsockname()[1]},cube=4x4x4{more}")
    command = [programs / "voxeld", "--listen", f"unix:{daemon}", "--http", "off"]
    for display in displays:
        command += ["--display", display]
    log = (folder / "voxeld.log").open("w")
    process = subprocess.Popen(command, stdout=log, stderr=log)
    try:
        for _ in range(200):
            if daemon.exists():
                break
            time.sleep(0.05)
        recorder = Recorder(front, daemon)
        env = dict(os.environ, VOXELD_SERVER=f"unix:{front}")

        def ctl(*arguments):
            subprocess.run([programs / "voxelctl", *arguments], env=env, stdout=subprocess.DEVNULL,
                           stderr=subprocess.DEVNULL, timeout=120, check=False)

        stream = []

        def read_opc():
            opc.settimeout(20)
            try:
                connection, _ = opc.accept()
                connection.settimeout(0.5)
                while len(b"".join(stream)) < 20000:
                    stream.append(connection.recv(65536))
                    if not stream[-1]:
                        break
            except OSError:
                pass

        heard = {name: [] for name in senders}
        threads = [threading.Thread(target=read_opc)]
        threads[0].start()
        record = subprocess.Popen([programs / "voxelctl", "record", recording], env=env, stdout=subprocess.DEVNULL,
                                  stderr=subprocess.DEVNULL)
        examples = shapes()
        for shape in examples:
            ctl("draw", *shape)
            for name, sock in senders.items():
                collect(sock, heard[name])
        ctl("draw", "object pin: cone end=0,0,0.4 start_radius=0 end_radius=0.1",
            "object pin: sphere center=0,0,0.45 radius=0.1", "instance object=pin at=0.5,0,0 tint=red", "instance object=pin")
        ctl("draw", "sphere radius=0.8", "clip_plane c=1", "mask: box size=1 fill=solid")
        ctl("draw", "points points=0,0,0;0.5,0.5,0.5 lifetime=2 label=spark")
        for path in sorted((ROOT / "tests/tools/data").glob("*")):
            ctl("play", str(path))
        ctl("pattern", "axes")
        ctl("clear")
        record.terminate()
        record.wait()
        threads[0].join()
    finally:
        process.terminate()
        process.wait()

    for method, messages in recorder.calls:
        name = method.rsplit("/", 1)[1]
        if name == "Stream" and messages:
            put("store", b"".join(bytes([8]) + text(m) + b"\x40" for m in messages), 16384)
            for message in messages:
                put("store", bytes([8]) + text(message) + b"\x40", 12288)
        elif name == "ApplyUpdate" and messages:
            put("store", bytes([6]) + text(messages[0]))
    if recording.exists():
        recorded = recording.read_bytes()
        put("mcap_file", recorded, 1 << 20)
        put("mcap_file", recorded[:8000], 16384)
    for number, name in enumerate(("ddp", "e131", "artnet")):
        packets = heard[name]
        if name == "e131":  # another source, and another priority
            for priority in (50, 150, 250):
                for packet in packets[:1]:
                    other = bytearray(packet)
                    other[22:38] = bytes(range(16))
                    other[108:109] = bytes([priority])
                    packets.append(bytes(other))
            put("light_datagrams", bytes([1, 3, 1]) + b"".join(b"\x40" + text(p) for p in [packets[0], *packets[-3:], packets[0]]))
        if name == "artnet":
            packets.append(b"Art-Net\0\x00\x20\x00\x0e\x00\x00")
        for packet in packets[:3] + packets[-3:]:
            put("light_datagrams", bytes([number, 3, 1]) + b"\x40" + text(packet))
        if packets:
            put("light_datagrams", bytes([number, 3, 1]) + b"".join(b"\x40" + text(p) for p in packets[:12]) + b"\x01\x05\x20")
    whole = b"".join(stream)
    if whole:
        put("opc_stream", b"\x40\x00\x00" + b"\x20" + text(whole[:1500]) + b"\x01\x05\x10")
        put("opc_stream", b"\x40\x00\x08" + b"".join(b"\x20" + text(whole[i:i + 70]) for i in range(0, 1400, 70)))
    print(f"{len(recorder.calls)} calls, {sum(len(p) for p in heard.values())} packets, {len(whole)} bytes of OPC")


def kept(programs, folder):
    """Writes seeds of the persistent state of a daemon with which an example of every shape was drawn."""
    address = f"unix:{folder}/k.sock"
    process = subprocess.Popen([programs / "voxeld", "--listen", address, "--http", "off", "--state-dir", folder / "kept", "--display",
                                "cube=simulated,size=24x24x24"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        time.sleep(1.5)
        for shape in [*shapes(), ["object pin: sphere radius=0.1", "instance object=pin at=0.5,0,0 tint=red"]]:
            subprocess.run([programs / "voxelctl", "--server", address, "draw", "--add", *shape], stdout=subprocess.DEVNULL,
                           stderr=subprocess.DEVNULL, timeout=60, check=False)
        time.sleep(1)
    finally:
        process.terminate()
        process.wait()
    kinds = {1: 0, 2: 2, 3: 1, 4: 3}
    database = sqlite3.connect(folder / "kept/state.db")
    for kind, row in database.execute("SELECT kind, bytes FROM rows"):
        put("kept_rows", bytes([kinds[kind], 0]) + bytes(row))
    database.execute("PRAGMA journal_mode=DELETE")
    database.execute("DELETE FROM rows WHERE length(bytes) > 400 OR owner % 16 != 0")
    database.commit()
    database.execute("PRAGMA page_size=512")  # keeps inputs small
    database.execute("VACUUM")
    database.close()
    put("state_file", (folder / "kept/state.db").read_bytes(), 16384)


# ---- files of the tree, and examples of the documents

def texts():
    for path in [*ROOT.glob("packaging/*.toml"), *ROOT.glob("packaging/deb/*.toml")]:
        put("config_text", path.read_bytes(), 1 << 16)
    for path in ROOT.glob("display/profiles/*.toml"):
        put("profile_text", path.read_bytes(), 1 << 16)
        lines = [l for l in path.read_text().splitlines() if "=" in l and not l.startswith("#")]
        put("display_option", ("a=simulated," + ",".join(l.split("#")[0].replace('"', "").replace(" ", "") for l in lines)).encode())
    documents = [*ROOT.glob("docs/**/*.md"), ROOT / "README.md", *ROOT.glob("display/drivers/*/README.md")]
    sources = [*ROOT.glob("tests/**/*.cc"), *ROOT.glob("tests/**/*.py")]
    for path in documents:
        content = path.read_text()
        for block in re.findall(r"```toml\n(.*?)```", content, re.S):
            put("config_text", block.encode())
            put("profile_text", block.encode())
            put("grants", block.encode())
    for path in documents + sources:
        content = path.read_text()
        for option in re.findall(r"[\"' ]([a-z0-9-]+=(?:simulated|network|fadecandy|voxlink)(?:,[a-z_]+=[^\"'`\s\\)]+)*)", content):
            put("display_option", option.encode())
    expressions = set()
    for path in [ROOT / "docs/expressions.md", ROOT / "tests/gpu/implicit/parse_test.cc"]:
        for quoted in re.findall(r"`([^`\n]+)`|\"([^\"\\\n]+)\"", path.read_text()):
            expressions.add(max(quoted, key=len))
    for expression in sorted(expressions):
        for how in (0, 1, 2):
            put("expression_text", bytes([how]) + text(expression.encode()) + bytes([1]) + text(b"r") + struct.pack("<f", 0.5), 600)
    source = (ROOT / "tests/daemon/access/grants_test.cc")
    if source.exists():
        for block in re.findall(r'R"\((.*?)\)"', source.read_text(), re.S):
            put("grants", block.encode())
    digest = hashlib.sha256(b"token").hexdigest()
    put("grants", f'[[token]]\nname = "a"\nsha256 = "{digest}"\nscopes = ["view", "draw"]\nexpires = 2027-01-31T00:00:00Z\n'
        '[[certificate]]\nname = "b"\nsubject = "b.example"\nscopes = ["view"]\n[[user]]\nname = "0"\nscopes = ["control"]\n'.encode())
    put("layout", b'[{"point": [0, 0, 0]}, null, {"point": [1, 0.5, -2]}, {}]')
    put("layout", str([{"point": [x, y, z]} for x in range(2) for y in range(2) for z in range(2)]).replace("'", '"').encode())
    formats = {"import_binary": ["pcd", "las", "ply", "vox"], "import_text": ["geojson", "topojson", "xyz", "csv", "pdb", "svg", "cif"],
               "import_volumes": ["nrrd", "raw", "dcm", "nii"], "import_meshes": ["obj", "stl", "gltf", "glb", "off", "3mf", "fbx", "dae"]}
    for target, extensions in formats.items():
        for number, extension in enumerate(extensions):
            for path in [*ROOT.glob(f"tests/tools/data/*.{extension}"), *pathlib.Path("/usr/share").glob(f"assimp/models/*/*.{extension}"),
                         *ROOT.glob(f"docs/**/*.{extension}")][:40]:
                put(target, bytes([number]) + path.read_bytes(), 8192)
    # The texts that tests contain.
    for path in ROOT.glob("tests/tools/voxelctl/*_test.cc"):
        for block in re.findall(r'R"[a-z]*\((.*?)\)[a-z]*"', path.read_text(), re.S):
            for target, number in (("import_text", 0), ("import_text", 1), ("import_text", 2), ("import_text", 4), ("import_text", 5),
                                   ("import_binary", 0), ("import_binary", 2), ("import_volumes", 0), ("import_meshes", 0)):
                put(target, bytes([number]) + block.encode(), 8192)
    put("import_text", b"\x05" + b'<svg viewBox="0 0 9 9"><path d="M1 1 L2 2 C3 3 4 4 5 5 Z" stroke="red"/><circle r="2"/><rect width="3" height="2"/></svg>')
    put("import_text", b"\x04" + b"ATOM      1  CA  ALA A   1      11.104   6.134  -6.504  1.00  0.00           C  \n" * 3)
    put("import_text", b"\x06" + b"data_a\nloop_\n_atom_site.type_symbol\n_atom_site.Cartn_x\n_atom_site.Cartn_y\n_atom_site.Cartn_z\nC 0 0 0\n'N' 1.4(2) 0 0\n")
    put("import_text", b"\x02" + b"1 2 3\n4 5 6 255 0 0\n")
    put("import_text", b"\x02" + b"2\nwater\nO 0 0 0\nH 1 0 0\n")
    put("import_text", b"\x03" + b"x,y,z,r,g,b\n1,2,3,4,5,6\n")
    put("import_binary", b"\x00" + b"VERSION .7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n1 2 3 4\n5 6 7 8\n")
    put("import_binary", b"\x03" + b"VOX \x96\x00\x00\x00MAIN\x00\x00\x00\x00\x38\x00\x00\x00SIZE\x0c\x00\x00\x00\x00\x00\x00\x00" + struct.pack("<III", 2, 2, 2) +
        b"XYZI\x0c\x00\x00\x00\x00\x00\x00\x00" + struct.pack("<IBBBBBBBB", 2, 0, 0, 0, 1, 1, 1, 1, 2))
    las = bytearray(227 + 40)
    las[:4] = b"LASF"
    las[24:26] = b"\x01\x02"
    struct.pack_into("<HIIBHI", las, 94, 227, 227, 0, 0, 20, 2)
    struct.pack_into("<12d", las, 131, 1, 1, 1, 0, 0, 0, 9, 0, 9, 0, 9, 0)
    put("import_binary", b"\x01" + bytes(las))
    put("import_volumes", b"\x00" + b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nspacings: 1 1 1\n\n" + bytes(range(8)))
    put("import_volumes", b"\x01" + bytes(range(96)))
    put("import_volumes", b"\x02" + bytes(128) + b"DICM" + b"\x02\x00\x10\x00UI\x14\x001.2.840.10008.1.2.1\x00" + b"\x28\x00\x10\x00US\x02\x00\x02\x00" +
        b"\x28\x00\x11\x00US\x02\x00\x02\x00" + b"\x28\x00\x00\x01US\x02\x00\x08\x00" + b"\xe0\x7f\x10\x00OW\x00\x00\x04\x00\x00\x00abcd")
    nifti = bytearray(352 + 8)
    struct.pack_into("<i", nifti, 0, 348)
    struct.pack_into("<8h", nifti, 40, 3, 2, 2, 2, 1, 1, 1, 1)
    struct.pack_into("<hh", nifti, 70, 2, 8)
    struct.pack_into("<8f", nifti, 76, 1, 1, 1, 1, 1, 1, 1, 1)
    struct.pack_into("<f", nifti, 108, 352)
    nifti[344:348] = b"n+1\0"
    put("import_volumes", b"\x03" + bytes(nifti))
    pictures()


def pictures():
    """Writes seeds of PNGs of every kind of pixel, 5x3, and a JPEG, made by ffmpeg if it is installed."""
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    for kind, channels in ((0, 1), (2, 3), (3, 1), (4, 2), (6, 4)):
        for depth in (1, 2, 4, 8, 16):
            if (kind in (2, 4, 6) and depth < 8) or (kind == 3 and depth > 8):
                continue
            for interlaced in (0, 1):
                row = (5 * channels * depth + 7) // 8
                rows = b"".join(bytes([i % 5]) + bytes((37 * j + i) % 256 & (0x11 if kind == 3 else 0xFF) for j in range(row)) for i in range(3))
                data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 5, 3, depth, kind, 0, 0, interlaced))
                if kind == 3:
                    data += chunk(b"PLTE", bytes(range(48))[: 3 * min(16, 2**depth)])
                if kind in (0, 2, 3):
                    data += chunk(b"tRNS", {0: b"\0\1", 2: b"\0\1\0\2\0\3", 3: b"\x80"}[kind])
                data += chunk(b"gAMA", struct.pack(">I", 45455)) + chunk(b"IDAT", zlib.compress(rows * 3)) + chunk(b"IEND", b"")
                put("pictures", data)
    if shutil.which("ffmpeg") is None:
        return
    with tempfile.TemporaryDirectory() as folder:
        source = pathlib.Path(folder) / "a.png"
        source.write_bytes(data)
        for name, options in (("a.jpg", []), ("b.jpg", ["-pix_fmt", "gray"]), ("c.jpg", ["-pix_fmt", "yuvj444p"])):
            subprocess.run(["ffmpeg", "-v", "quiet", "-i", source, *options, pathlib.Path(folder) / name], check=False)
            if (pathlib.Path(folder) / name).exists():
                put("pictures", (pathlib.Path(folder) / name).read_bytes())


# ---- protocols, written by hand

def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def voxlink():
    """Writes seeds of sessions as tests/fuzz/voxlink/device_session.cc and packets.h read them."""
    begin = lambda volume, base, bits=b"": bytes([0, volume, base, 4]) + text(bits)
    picture = lambda volume, slice_, value: bytes([2, volume, slice_, 0, 18, value])
    end = lambda volume, show=1: bytes([3, volume, show])
    packets = lambda *p: bytes([3, len(p) - 1]) + b"".join(p)
    reads, wait = bytes([6, 7]), bytes([8, 0xE8, 0x03])
    for choice in (0, 1, 2, 4, 8):
        start = bytes([choice, 2]) + reads
        whole = packets(begin(1, 0), *(picture(1, i, 40) for i in range(4)), end(1))
        second = packets(begin(2, 1, b"\x05"), picture(2, 0, 9), picture(2, 2, 9), end(2, 0), bytes([4, 2, 0]))
        ahead = packets(begin(3, 0), *(picture(3, i, 1) for i in range(4)), end(3, 0), bytes([5, 3, 9, 1]))
        missing = packets(begin(4, 0), picture(4, 1, 2), end(4)) + wait + packets(picture(4, 0, 2), end(4), bytes([6, 4, 4]))
        mode = bytes([1, 2, 0, 0]) + text(struct.pack("<BBBBIQ", 0, 1, 0, 0, 0, 0))
        requests = b"".join(bytes([1, r, 0, 0]) + text(b"") for r in range(9))
        for target in ("voxlink_device", "voxlink_firmware"):
            put(target, start + whole + wait + second + wait + reads + wait)
            put(target, start + whole + wait + ahead + wait + missing + reads + wait)
            put(target, bytes([choice]) + mode + requests + start[1:] + whole + wait + bytes([11, 1, 11, 2]) + start[1:] + whole)
    put("voxlink_decoder", b"\x00" + b"".join(b"\x00" + bytes(p) + b"\x03" for p in (
        bytes([0, 1, 0, 6]) + text(b""),
        *(bytes([2, 1, i, j, 24, 7]) for i in range(3) for j in range(2)), bytes([3, 1, 1]),
        bytes([0, 2, 1, 6]) + text(b"\x01"), bytes([2, 2, 0, 0, 24, 9]), bytes([3, 2, 1]), bytes([4, 2, 0]), bytes([6, 7, 0]))))
    damaged = b"\x00\x02" + bytes([0, 1, 0, 6]) + text(b"") + bytes([2, 1, 0, 0, 24, 7]) + bytes([8, 100, 0, 1]) + b"\x00"
    put("voxlink_decoder", damaged)
    put("voxlink_decoder", b"\x01\x00" + bytes([0, 5, 0, 17]) + text(b"") + b"\x01" + b"\x00" + bytes([0, 6, 5, 17]) + text(b"\x01\x00\xff") + b"\x01")
    put("voxlink_host", bytes([0, 7, 7, 0, 2, 40, 0, 9, 7, 10]) + bytes(80))
    fixed = struct.pack("<IHBBIIIIIIIIIIIHHII", 0, 0x0100, 0x1F, 4, 3, 65536, 1024, 2, 2, 1, 3, 30000, 30000, 30000, 0, 100, 250, 0, 0)
    shape = struct.pack("<BBBBIdddd", 1, 0, 0, 1, 2, 1.0, 1.0, 1.0, 0.0) + struct.pack("<d", 1.0)
    block = bytearray(fixed + shape)
    struct.pack_into("<I", block, 0, len(block))
    put("voxlink_capabilities", bytes(block))
    rotor = struct.pack("<BBBBI", 2, 0, 1, 0, 2) + struct.pack("<ddddddBBBBf", 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    helix = struct.pack("<BBBBIddddddd", 3, 0, 0, 1, 2, 1, 1, 1, 4, 0, 1, 0)
    lattice = struct.pack("<BBBBIddd", 4, 0, 0, 0, 4, 1, 1, 1) + struct.pack("<12d", *range(12))
    for other in (rotor, helix, lattice):
        block = bytearray(fixed + other)
        struct.pack_into("<I", block, 0, len(block))
        put("voxlink_capabilities", bytes(block))


def programs():
    """Writes seeds of programs of expressions, as gpu/implicit/program.h defines them."""
    code = lambda *instructions: [w for op, to, a, b, now in instructions for w in (op | to << 8 | a << 16 | b << 24, now & 0xFFFFFFFF)]
    x, y, constant, pow_i, add, sin = 1, 2, 0, 16, 17, 11
    surface = code((x, 0, 0, 0, 0), (y, 1, 0, 0, 0), (add, 2, 0, 1, 0), (sin, 3, 2, 2, 0), (pow_i, 4, 3, 3, 3))
    wrong = code((x, 0, 0, 0, 0), (pow_i, 1, 0, 0, 2000))
    one = code((constant, 0, 0, 0, 0x3F000000))

    def program(surface, bound, color, by, slots, rings=(), table=()):
        header = [len(surface) // 2, len(bound) // 2, len(color) // 2, by, slots[0], slots[1], 0, 0, 0, len(rings), 0, 0]
        return struct.pack("<%dI" % (12 + len(surface) + len(bound) + len(color) + len(rings) + len(table)), *header, *surface, *bound,
                           *color, *rings, *table)

    for data in (program(surface, [], [], 0, (4, 0)), program(surface, one, one, 1, (4, 0)), program(wrong, [], [], 0, (1, 0)),
                 program(surface, one, one, 2, (4, 0), (), range(256)), program(surface, [], [], 0, (4, 0), (3,))):
        put("expression_program", b"\x03" + data)


def sockets():
    head = (b"GET /volumes HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n")
    put("web_socket", text(head) + b"\x00" + text(b'{"hello": true}') + b"\x00" + text(b"post") + b"\x03\x00\x20")
    put("web_socket", text(head) + b"\x00" + text(b"close") + b"\x05\x01")
    put("web_socket", text(head) + b"\x01\x01" + text(b"frag") + b"\x01\x80" + text(b"ment") + b"\x01\x89" + text(b"ping") + b"\x01\x88" + text(b"\x03\xe8"))
    put("web_socket", text(head.replace(b"13", b"12")) + b"\x00" + text(b"x"))
    say = lambda *messages: b"".join(b"\x03" + text(m.encode()) for m in messages)
    page = say('{"hello": true}', '{"watch": "main", "id": 1}') + b"\x02\x01\x01\x01\x00\x00\x0a" + say(
        '{"shown": 1}', '{"dark": 1}', '{"compare": 1, "without": [{"owner": "1", "layer": "a"}]}') + b"\x00\x30" + say(
            '{"stats": true}', '{"layers": true}', '{"update": {"display": "main", "brightness": 0.5}}',
            '{"clear": {"owner": "1", "layer": "a"}}', '{"unwatch": 1}')
    put("viewer_messages", b"\x00" + page)
    put("viewer_messages", b"\x01" + page)
    advertise = (b'{"op": "advertise", "channels": [{"id": 1, "topic": "/m", "encoding": "protobuf", "schemaName": "foxglove.SceneUpdate", "schema": ""}, '
                 b'{"id": 2, "topic": "/j", "encoding": "json", "schemaName": "foxglove.SceneUpdate"}, {"id": 3, "topic": "/t", "encoding": "cdr", "schemaName": "tf"}]}')
    update = (b'{"deletions": [{"type": 1, "id": "a"}], "entities": [{"id": "a", "timestamp": {"sec": 1, "nsec": 0}, "lifetime": {"sec": 1, "nsec": 5}, '
              b'"arrows": [{"pose": {"position": {"x": 1, "y": 0, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}, "shaft_length": 1, "shaft_diameter": 0.1, '
              b'"head_length": 0.2, "head_diameter": 0.2, "color": {"r": 1, "g": 0, "b": 0, "a": 1}}], "cubes": [{"size": {"x": 1, "y": 1, "z": 1}}], '
              b'"spheres": [{"size": {"x": 1, "y": 2, "z": 1}}], "cylinders": [{"size": {"x": 1, "y": 1, "z": 1}, "bottom_scale": 1, "top_scale": 0.5}], '
              b'"lines": [{"type": 1, "thickness": 0.1, "scale_invariant": true, "points": [{"x": 0, "y": 0, "z": 0}, {"x": 1, "y": 1, "z": 1}], "colors": [], "indices": [0, 1]}], '
              b'"triangles": [{"points": [{"x": 0}, {"x": 1}, {"y": 1}], "indices": [0, 1, 2]}], "texts": [{"text": "hi", "font_size": 1, "billboard": true}], "models": [{"url": "x"}]}]}')
    head = lambda channel: b"\x01" + struct.pack("<IQ", channel, 5)
    put("foxglove", b"\x00" + text(advertise) + b"\x01" + text(head(2) + update) + b"\x04\x20" + b"\x01" + text(head(2) + update) +
        b"\x00" + text(b'{"op": "unadvertise", "channelIds": [1, 2]}'), 8192)
    put("foxglove", b"\x03" + text(update))
    put("foxglove", b"\x00" + text(advertise) + b"\x01" + text(head(1) + b"\x12\x05\x1a\x01a*\x00"))
    preface = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
    frame = lambda kind, flags, stream, body=b"": struct.pack(">I", len(body))[1:] + bytes([kind, flags]) + struct.pack(">I", stream) + body
    call = preface + frame(4, 0, 0) + frame(8, 0, 0, b"\x00\x00\x10\x00") + frame(1, 4, 1, b"\x83\x86")
    put("greeting", b"\x00\x00\x10\x05" + call + frame(0, 1, 1, b"\x00\x00\x00\x00\x03abc"))
    put("greeting", b"\x00\x00\x10\x05" + call + frame(0, 9, 1, b"\x02\x00\x00\x00\x00\x01a\x00\x00"))
    hello = b"\x01\x00\x00\x2c\x03\x03" + bytes(32) + b"\x00\x00\x02\x13\x01\x01\x00\x00\x01" + bytes(1)
    put("greeting", b"\x01\x00\x10\x07\x16\x03\x01" + struct.pack(">H", len(hello)) + hello)
    put("local_packets", bytes([0, 1, 0, 16, 1, 0, 1, 0, 32, 2, 0, 4, 1, 4, 5, 0, 7, 200]))
    put("asset_uploads", bytes([0, 2, 0, 2, 0, 0, 100, 0, 4, 0, 7, 2, 0, 5, 100, 0, 1, 3, 3, 2, 0, 0, 0, 16, 4, 0]))
    open_, segment = bytes([0, 0, 0, 0]), lambda i: bytes([1, i, 0]) + text(b"")
    for shape in range(5):
        target = bytes([3, shape, 0, 0, 0, 0, 0, 0])
        layer = bytes([5, 1, 0, 1, 255, 0, 0, 1, 0, 0, 0, 0, 0]) + bytes(4 * 64)
        geometry = lambda kind, vertices, words=b"": bytes([0, kind, kind, 0x55, 0x01, 96]) + bytes([90] * 8) + bytes([vertices]) + text(words) + bytes(range(40, 40 + 3 * vertices))
        for kind in range(1, 12):
            drawable = bytes([3, kind % 8, kind % 8, 1, 3, 0, 0])
            delta = bytes([4, 2]) + geometry(kind, 16, struct.pack("<6I", 0, 1, 2, 2, 1, 3)) + layer + drawable + bytes([0, 0])
            frame = bytes([6, 1, 1, 0, 0, 2, 0xC0, 0x00]) + bytes([7, 1, 0, 0, 0, 4, 4, 4, 0, 64])
            put("worker_messages", open_ + segment(0) + segment(1) + target + delta + frame + bytes([2, 0, 0, 8, 2, 0]) + text(b"") + bytes([9, 2]))

def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build/test/bin", help="where voxeld and voxelctl are")
    args = parser.parse_args()
    texts()
    request_seeds.requests(put, text)
    session_seeds.sessions(put, text)
    voxlink()
    programs()
    sockets()
    shape_seeds.shapes(put)
    if not (args.bin / "voxeld").exists():
        return print(f"make_seeds: no voxeld in {args.bin}; without its traffic", file=sys.stderr) or 1
    with tempfile.TemporaryDirectory() as folder:
        kept(args.bin, pathlib.Path(folder))
        traffic(args.bin, pathlib.Path(folder))
    for target in sorted(SEEDS.iterdir()):
        print(f"{target.name}: {len(list(target.iterdir()))}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
