"""Tests incoming lights: `voxelctl input` fed by third-party programs (olad for Open Pixel Control, npm's sacn for E1.31, npm's artnet for
Art-Net) and by
DDP packets written out here, and `voxelctl pipe` fed by raw bytes; checks what the display shows, light by light, and that every message is
accounted
for. Paths are in VOXELD, VOXELCTL and NODE_MODULES."""
import contextlib
import json
import os
import random
import shutil
import socket
import struct
import subprocess
import tempfile
import threading
import unittest
import urllib.parse
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import voxeld as voxel

from ola_peer_test import free_port
from polling import LONG, until

X, Y, Z = 8, 6, 5
LIGHTS = X * Y * Z  # two universes: 170 lights and 70


def unread(port: int) -> int:
    """Returns the bytes that the kernel holds for the receiver at this port of 127.0.0.1; a datagram over loopback is counted as soon as it
    is sent."""
    for line in Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]:
        fields = line.split()
        if fields[1] == f"0100007F:{port:04X}":
            return int(fields[4].partition(":")[2], 16)
    raise AssertionError(f"nobody listens at port {port}")


class Reading:
    """A process whose standard output, one JSON document a line, is read as it arrives."""

    def __init__(self, *command: str) -> None:
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.lines: list[dict[str, Any]] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(json.loads(line))

    def stop(self) -> tuple[int, str]:
        self.process.terminate()
        code = self.process.wait(LONG)
        self._reader.join(LONG)
        assert self.process.stderr is not None
        return code, self.process.stderr.read()

    def close(self) -> None:
        self.process.kill()
        self.process.wait(LONG)
        self._reader.join(LONG)
        for stream in (self.process.stdout, self.process.stderr):
            assert stream is not None
            stream.close()


class Lights(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = self.enterContext(tempfile.TemporaryDirectory())
        self.server = f"unix:{self.folder}/voxeld.sock"
        self.controller = self.enterContext(contextlib.closing(socket.socket(type=socket.SOCK_DGRAM)))
        self.controller.bind(("127.0.0.1", 0))
        port = self.controller.getsockname()[1]
        self.daemon = self.enterContext(subprocess.Popen(
            [os.environ["VOXELD"], "--listen", self.server, "--http", "off", "--log-level", "warn", "--engine", "cpu",
             # With another wiring than the senders: light n of those that feed it is its nth pixel.
             "--display", f"cube=network,address=127.0.0.1:{port},protocol=ddp,cube={X}x{Y}x{Z},order=zyx,serpentine=rows,dither=none",
             "--display", f"box=simulated,size={2 * X}x{2 * Y}x{2 * Z},rate=100"]))
        self.addCleanup(self.daemon.wait, LONG)
        self.addCleanup(self.daemon.terminate)
        self.v = self.enterContext(voxel.connect(self.server, timeout=LONG))

    def input(self, protocol: str, *options: str, port: int = 0) -> tuple[Reading, int]:
        reading = Reading(os.environ["VOXELCTL"], "--server", self.server, "--json", "input", protocol, "--listen", f"127.0.0.1:{port}",
                          *options)
        self.addCleanup(reading.close)
        until(lambda: bool(reading.lines) or reading.process.poll() is not None, "voxelctl input is ready")
        self.assertIsNone(reading.process.poll(), "voxelctl input ended")
        self.assertEqual(reading.lines[0]["event"], "ready")
        return reading, int(reading.lines[0]["listen"].rsplit(":", 1)[1])

    def tally(self, reading: Reading) -> dict[str, Any]:
        """Ends the process, and returns its counts."""
        code, errors = reading.stop()
        self.assertEqual((code, errors), (0, ""))
        tally = reading.lines[-1]
        kinds = ("set", "shows", "ended", "other", "outside", "outranked", "stale", "malformed")
        self.assertEqual(tally["messages"], sum(tally[kind] for kind in kinds), tally)
        self.assertEqual(tally["pictures"], tally["superseded"] + tally["waiting"] + tally["committed"], tally)
        self.assertEqual((tally["accepted"], tally["refused"]), (tally["committed"], 0), tally)
        return tally

    def lit(self, display: str = "cube") -> np.ndarray:
        return self.v.capture(display, timeout=LONG).rgb.reshape(-1, 3)

    def shows(self, values: np.ndarray) -> None:
        until(lambda: np.array_equal(self.lit(), values), "the display shows what was sent")

    def picture(self, seed: int) -> np.ndarray:
        return np.random.default_rng(seed).integers(1, 256, (LIGHTS, 3), dtype=np.uint8)

    def test_opc_from_olad(self) -> None:
        reading, port = self.input("opc")
        config = Path(self.folder, "ola")
        config.mkdir(mode=0o777)
        config.chmod(0o777)
        Path(self.folder).chmod(0o755)
        target = f"127.0.0.1:{port}"
        files = {"openpixelcontrol": f"enabled = true\ntarget = {target}\ntarget_{target}_channel = 0\n",
                 **dict.fromkeys("dummy espnet ftdidmx gpio karate kinet milinst opendmx osc pathport renard sandnet shownet spi artnet e131 "
                                 "stageprofi uartdmx usbdmx usbserial".split(), "enabled = false\n")}
        for name, text in files.items():
            Path(config, f"ola-{name}.conf").write_text(text, encoding="utf-8")
        http = free_port()
        user: dict[str, Any] = {"user": "nobody", "group": "nogroup", "extra_groups": []} if os.geteuid() == 0 else {}
        self.assertIsNotNone(shutil.which("olad"), "olad not found; run tools/setup --test")
        with Path(self.folder, "olad.log").open("wb") as log:
            olad = subprocess.Popen(["olad", "--config-dir", str(config), "--http-port", f"{http}", "--rpc-port", f"{free_port()}", "--no-http-quit",
                                     "--no-register-with-dns-sd", "--log-level", "3"], stdout=log, stderr=log, **user)
        self.addCleanup(olad.wait, LONG)
        self.addCleanup(olad.kill)

        def ask(path: str, **form: str) -> Any:
            data = urllib.parse.urlencode(form).encode() if form else None
            try:
                with urllib.request.urlopen(f"http://127.0.0.1:{http}{path}", data, timeout=LONG) as answer:
                    return answer.read().decode()
            except OSError:
                return ""

        until(lambda: "OPC" in ask("/json/get_ports") or "Open Pixel" in ask("/json/get_ports"), "olad has its port")
        ports = json.loads(ask("/json/get_ports"))
        output = next(p["id"] for p in ports if p["is_output"])
        until(lambda: '"ok": true' in ask("/new_universe", id="1", name="lights", add_ports=output), "olad has its universe")
        for seed in range(3):
            picture = self.picture(seed)
            picture[170:] = 0  # a universe of 512 values
            text = ",".join(str(value) for value in picture.reshape(-1)[:510])
            until(lambda: ask("/set_dmx", u="1", d=text) == "ok", "olad takes the values")
            self.shows(picture)
        tally = self.tally(reading)
        self.assertGreaterEqual(tally["set"], 3)
        self.assertEqual((tally["malformed"], tally["connections"]), (0, 1))

    def feed(self, protocol: str, port: int, first: int) -> None:
        """Uses a third-party sender."""
        sender = subprocess.Popen(["node", str(Path(__file__).with_name("send_lights.js")), os.environ["NODE_MODULES"], protocol, f"{port}"],
                                  stdin=subprocess.PIPE, text=True)
        self.addCleanup(sender.wait, LONG)
        self.addCleanup(sender.kill)
        assert sender.stdin is not None
        with sender.stdin:
            for seed in range(3):
                picture = self.picture(seed)
                values = picture.reshape(-1).tolist()
                for universe in range(2):
                    print(json.dumps([first + universe, values[510 * universe:510 * (universe + 1)]]), file=sender.stdin, flush=True)
                self.shows(picture)

    def test_e131_from_sacn(self) -> None:
        reading, port = self.input("e131", "--universe", "7")
        self.feed("e131", port, 7)
        tally = self.tally(reading)
        self.assertEqual((tally["set"], tally["lost"], tally["malformed"]), (6, 0, 0))

    def test_art_net_from_artnet(self) -> None:
        reading, port = self.input("artnet", "--universe", "3")
        self.feed("artnet", port, 3)
        tally = self.tally(reading)
        self.assertGreaterEqual(tally["set"], 6)
        self.assertEqual(tally["malformed"], 0)

    def test_ddp(self) -> None:
        reading, port = self.input("ddp")
        with socket.socket(type=socket.SOCK_DGRAM) as sender:
            for seed in range(5):
                picture = self.picture(seed)
                data = picture.tobytes()
                for part, at in enumerate(range(0, len(data), 300)):
                    last = at + 300 >= len(data)
                    head = struct.pack(">BBBBIH", 0x41 if last else 0x40, (seed * 3 + part) % 15 + 1, 0x0B, 1, at, len(data[at:at + 300]))
                    sender.sendto(head + data[at:at + 300], ("127.0.0.1", port))
                self.shows(picture)
        tally = self.tally(reading)
        self.assertEqual((tally["set"], tally["pictures"], tally["lost"]), (15, 5, 0))

    def test_every_message_of_a_flood_is_accounted_for(self) -> None:
        reading, port = self.input("opc")
        count, senders = 50_000, 4
        last = self.picture(9)
        dark = struct.pack(">BBH", 0, 0, LIGHTS * 3) + bytes(LIGHTS * 3)

        def flood() -> None:
            with socket.create_connection(("127.0.0.1", port)) as stream:
                for _ in range(count // 100):
                    stream.sendall(dark * 100)

        threads = [threading.Thread(target=flood) for _ in range(senders)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(LONG)
        until(lambda: reading.lines[-1].get("messages") == count * senders, "all have been read")
        with socket.create_connection(("127.0.0.1", port)) as stream:
            stream.sendall(struct.pack(">BBH", 0, 0, LIGHTS * 3) + last.tobytes())
            self.shows(last)  # the newest
            stream.sendall(b"\0\0\0")  # and half a message
        tally = self.tally(reading)
        self.assertEqual((tally["set"], tally["pictures"]), (count * senders + 1,) * 2)
        self.assertGreater(tally["superseded"], 0)

    def test_what_is_no_packet_does_no_harm(self) -> None:
        reading, port = self.input("e131", "--universe", "1")
        chance = random.Random(4)
        with socket.socket(type=socket.SOCK_DGRAM) as sender:
            for _ in range(300):
                sender.sendto(chance.randbytes(chance.randrange(700)), ("127.0.0.1", port))
        until(lambda: reading.lines[-1].get("messages") == 300, "all have been read")
        self.feed("e131", port, 1)
        tally = self.tally(reading)
        self.assertEqual((tally["malformed"], tally["set"]), (300, 6))
        self.assertNotEqual(tally["malformed_last"], "")

    def test_people_are_told_why_a_message_was_malformed(self) -> None:
        told = subprocess.Popen([os.environ["VOXELCTL"], "--server", self.server, "input", "ddp", "--listen", "127.0.0.1:0"],
                                stderr=subprocess.PIPE, text=True)
        assert told.stderr is not None
        first = told.stderr.readline()
        port = int(first.split(" on 127.0.0.1:")[1].split(" ")[0])
        with socket.socket(type=socket.SOCK_DGRAM) as sender:
            sender.sendto(b"no", ("127.0.0.1", port))
            until(lambda: unread(port) == 0, "the message has been read")
        told.terminate()
        _, words = told.communicate(timeout=LONG)
        self.assertEqual(told.returncode, 0, words)
        self.assertRegex(words, r"^1 message, 0 pictures: 0 put up, 0 superseded, 1 malformed \(.+\)\n$")

    def test_it_goes_on_after_the_daemon_came_back(self) -> None:
        reading, port = self.input("opc", "--display", "box", "--size", f"{X}x{Y}x{Z}")
        with socket.create_connection(("127.0.0.1", port)) as stream:
            def send(value: int) -> None:
                stream.sendall(struct.pack(">BBH", 0, 0, LIGHTS * 3) + bytes([value]) * (LIGHTS * 3))

            send(100)
            # Each light fills eight voxels.
            until(lambda: np.all(self.lit("box") == 100), "the box is lit")
            self.v.close()
            self.daemon.terminate()
            self.daemon.wait(LONG)
            send(150)  # nothing shows it
            self.daemon = self.enterContext(subprocess.Popen(
                [os.environ["VOXELD"], "--listen", self.server, "--http", "off", "--log-level", "warn", "--engine", "cpu",
                 "--display", f"box=simulated,size={2 * X}x{2 * Y}x{2 * Z},rate=100"]))
            self.addCleanup(self.daemon.wait, LONG)
            self.addCleanup(self.daemon.terminate)
            with voxel.connect(self.server, timeout=LONG) as self.v:
                until(lambda: np.all(self.lit("box") == 150), "the newest picture comes back")
                send(200)
                until(lambda: np.all(self.lit("box") == 200), "it goes on")
        code, errors = reading.stop()
        self.assertEqual((code, errors), (0, ""))

    def pipe(self, data: bytes, *options: str) -> subprocess.CompletedProcess[bytes]:
        return subprocess.run([os.environ["VOXELCTL"], "--server", self.server, "--json", "pipe", *options], input=data, capture_output=True,
                              timeout=LONG)

    def test_pipe(self) -> None:
        pictures = [self.picture(seed) for seed in range(20)]
        done = self.pipe(b"".join(picture.tobytes() for picture in pictures), "--size", f"{X}x{Y}x{Z}", "--display", "box", "--keep")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout), {"pictures": 20, "accepted": 20, "refused": 0})
        # Light (x, y, z) is voxel (2x, 2y, 2z) and the seven beside it.
        last = pictures[-1].reshape(Z, Y, X, 3)
        big = last.repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2).reshape(-1, 3)
        until(lambda: np.array_equal(self.lit("box"), big), "the last picture is up")

    def test_pipe_says_what_is_wrong(self) -> None:
        cut = self.pipe(b"\xff" * (LIGHTS * 3 + 5))
        self.assertEqual(cut.returncode, 1)
        self.assertIn(f"ended within a picture: 5 bytes of {LIGHTS * 3}".encode(), cut.stderr)
        self.assertEqual(json.loads(cut.stdout)["pictures"], 1)
        for options, words in ((("--size", "8x8"), b"--size 8x8 is no box of lights"), (("--display", "none"), b"there is no display"),
                               (("--display", "box"), b"give --size WxHxD, or --layout FILE"),
                               (("--layout", f"{self.folder}/none.json"), b"cannot be read")):
            wrong = self.pipe(b"", *options)
            self.assertNotEqual(wrong.returncode, 0)
            self.assertIn(words, wrong.stderr)

    def test_layout(self) -> None:
        # Four lights of a square, and a number without a light.
        layout = Path(self.folder, "layout.json")
        layout.write_text(json.dumps([{"point": [0, 0, 0]}, {"point": [1, 0, 0]}, None, {"point": [0, 1, 0]}, {"point": [1, 1, 0]}]))
        colors = np.array([[255, 0, 0], [0, 255, 0], [9, 9, 9], [0, 0, 255], [255, 255, 0]], np.uint8)
        done = self.pipe(colors.tobytes(), "--layout", str(layout), "--display", "box", "--keep")
        self.assertEqual(done.returncode, 0, done.stderr)

        def four() -> bool:
            shown = self.lit("box")
            at = np.flatnonzero(shown.any(axis=1))
            return sorted(map(tuple, shown[at].tolist())) == sorted(map(tuple, colors[[0, 1, 3, 4]].tolist()))

        until(four, "the four are lit")
