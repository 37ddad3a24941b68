"""Tests what voxeld sends by E1.31 and Art-Net, as read by a third-party receiver: olad, the daemon of the Open Lighting Architecture. A
lattice of more
lights than fit into a universe is sent to olad at 127.0.0.1; olad is asked for every slot of both its universes, and its answers are
compared with
those computed here from wiring and colours: in the dark, with a colour of its own in each light, after changes in one universe and in both,
and after
voxeld has exited. The path of voxeld is in VOXELD."""
import contextlib
import http.client
import json
import os
import pwd
import shutil
import socket
import subprocess
import tempfile
import time
import unittest
from pathlib import Path
from typing import Any, Callable, ClassVar

import voxeld as voxel

LONG = 60.0
X, Y, Z = 8, 6, 5  # 240 lights: 170 in the first universe, 70 in the second
SLOTS = 510        # in a universe
NET, SUBNET = 5, 9
E131, ARTNET = 40001, NET << 8 | SUBNET << 4 | 3  # the first universe of each
PORTS = {"E1.31": 5568, "Art-Net": 6454}         # olad uses no other ports

CONFIG = {
    "port": f"11-1-I-0 = {E131}\n11-1-I-1 = {E131 + 1}\n2-1-I-0 = {ARTNET}\n2-1-I-1 = {ARTNET + 1}\n",  # plugin-device-I-input
    # It needs an interface for multicast, which cannot be the loopback; packets sent to the machine itself arrive all the same.
    "e131": "enabled = true\ninput_ports = 2\noutput_ports = 0\n",
    "artnet": f"enabled = true\nip = 127.0.0.1\nuse_loopback = true\nnet = {NET}\nsubnet = {SUBNET}\noutput_ports = 0\n",
    **dict.fromkeys("dummy espnet ftdidmx gpio karate kinet milinst opendmx openpixelcontrol osc pathport renard sandnet "
                    "shownet spi stageprofi uartdmx usbdmx usbserial".split(), "enabled = false\n")}

Lit = dict[tuple[int, int, int], tuple[int, int, int]]  # places, and their red, green and blue


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Olad:
    def __init__(self, folder: str) -> None:
        for protocol, port in PORTS.items():
            with socket.socket(type=socket.SOCK_DGRAM) as probe:
                try:
                    probe.bind(("", port))
                except OSError as error:
                    raise AssertionError(f"olad cannot have UDP port {port}, {protocol}'s: {error.strerror}; "
                                         "does another olad run, or a service of that name?") from error
        for name, text in CONFIG.items():
            Path(folder, f"ola-{name}.conf").write_text(text, encoding="utf-8")
        assert shutil.which("olad"), "olad not found; run tools/setup --test"
        user: dict[str, Any] = {}
        if os.geteuid() == 0:  # olad does not run as root
            nobody = pwd.getpwnam("nobody")
            user = {"user": nobody.pw_uid, "group": nobody.pw_gid, "extra_groups": []}
            for path in (Path(folder), *Path(folder).iterdir()):
                os.chown(path, nobody.pw_uid, nobody.pw_gid)
        self._http, self.log = free_port(), Path(folder, "olad.log")
        with self.log.open("wb") as log:
            self._process = subprocess.Popen(
                ["olad", "--config-dir", folder, "--http-port", f"{self._http}", "--rpc-port", f"{free_port()}",
                 "--no-http-quit", "--no-register-with-dns-sd", "--log-level", "3"], stdout=log, stderr=log, **user)

    def stop(self) -> None:
        self._process.kill()
        self._process.wait(LONG)

    def get(self, path: str) -> Any:
        connection = http.client.HTTPConnection("127.0.0.1", self._http, timeout=LONG)
        try:
            connection.request("GET", path)
            return json.load(connection.getresponse())
        except ConnectionRefusedError:
            return None  # not yet
        finally:
            connection.close()

    def until(self, right: Callable[[Any], Any], ask: Callable[[], Any]) -> Any:
        """Returns the first answer that is right, or the first one after the deadline."""
        deadline = time.monotonic() + LONG
        while True:
            with contextlib.suppress(subprocess.TimeoutExpired):
                raise AssertionError(f"olad ended with {self._process.wait(0.01)}:\n{self.log.read_text()}")
            if right(answer := ask()) or time.monotonic() > deadline:
                return answer


def universes(lit: Lit) -> list[list[int]]:
    """Rows of lights run along y, every second one backwards, side by side along x; a light takes green, red, blue."""
    slots = [0] * (2 * SLOTS)
    for (x, y, z), (red, green, blue) in lit.items():
        light = (z * X + x) * Y + (y if x % 2 == 0 else Y - 1 - y)
        slots[3 * light:3 * light + 3] = green, red, blue
    return [slots[:SLOTS], slots[SLOTS:]]


class OlaPeer(unittest.TestCase):
    olad: ClassVar[Olad]

    @classmethod
    def setUpClass(cls) -> None:
        cls.olad = Olad(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.addClassCleanup(cls.olad.stop)
        has = cls.olad.until(lambda has: has and has["plugins"], lambda: cls.olad.get("/json/universe_plugin_list"))
        active = [plugin["name"] for plugin in has["plugins"] if plugin["active"]] if has else "none"
        assert active == ["ArtNet", "E1.31 (sACN)"], f"of olad's plugins {active} run:\n{cls.olad.log.read_text()}"

    def test_e131(self) -> None:
        self.shows_all("e131", E131)

    def test_art_net(self) -> None:
        self.shows_all("artnet", ARTNET)

    def shows_all(self, protocol: str, first: int) -> None:
        def shows(lit: Lit) -> None:
            want = universes(lit)
            got = self.olad.until(lambda got: got == want,
                                  lambda: [self.olad.get(f"/get_dmx?u={first + i}")["dmx"] for i in range(2)])
            for universe in range(2):
                self.assertEqual(got[universe], want[universe], f"universe {first + universe}")

        def draw(lit: Lit) -> None:
            with v.frame() as frame:
                frame.voxels("lights", list(lit), colors=list(lit.values()))
            frame.wait_shown(LONG)
            shows(lit)

        server = f"unix:{self.enterContext(tempfile.TemporaryDirectory())}/voxeld.sock"
        daemon = self.enterContext(subprocess.Popen(
            [os.environ["VOXELD"], "--listen", server, "--http", "off", "--log-level", "warn", "--engine", "cpu", "--display",
             f"cube=network,address=127.0.0.1,protocol={protocol},universe={first},cube={X}x{Y}x{Z},order=yxz,"
             "serpentine=rows,color_order=grb,dither=none,view=voxels"]))
        self.addCleanup(daemon.kill)
        with voxel.connect(server, timeout=LONG, on_disconnect="keep") as v:
            shows({})
            places = [(x, y, z) for x in range(X) for y in range(Y) for z in range(Z)]
            own = {place: (n, 7 * n % 256, 255 - n) for n, place in enumerate(places)}
            draw(own)
            draw({**own, (7, 0, 4): (255, 0, 0)})                       # the last light, in the second universe
            draw({(0, 0, 0): (255, 128, 1), (7, 0, 4): (0, 0, 255)})    # the first light and the last
            draw({(4, 1, 3): (0, 255, 0), (4, 2, 3): (255, 255, 255)})  # the last of one universe, the first of the other
            self.assertEqual(v.issues, [])
        daemon.terminate()
        self.assertEqual(daemon.wait(LONG), 0)
        shows({})
