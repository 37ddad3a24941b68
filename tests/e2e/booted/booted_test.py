"""The daemon as installed by its package, under systemd itself: what kills or stops it, and how long clients wait then. Runs as root in the
container
that `run` boots. Each test prints what it measured."""
import os
import re
import signal
import subprocess
import time
import unittest
import urllib.request
from pathlib import Path

import numpy as np
import voxeld as voxel

from polling import LONG, until

SERVER = "unix:/run/voxeld/voxeld.sock"
WATCHDOG = 3.0  # seconds in this test; the unit has 30
STOPS = 10.0  # its TimeoutStopSec
CONFIG = ('[[display]]\nname = "sim"\ndriver = "simulated"\nsize = "16x16x12"\nrate = 60\n'
          '[[display]]\nname = "other"\ndriver = "simulated"\nsize = "8x8x8"\nrate = 60\n')


def systemctl(*arguments: str) -> str:
    return subprocess.run(["systemctl", *arguments], check=True, capture_output=True, text=True).stdout.strip()


def shows(what: str) -> str:
    return systemctl("show", "--value", "-p", what, "voxeld.service")


def health() -> str:
    with urllib.request.urlopen("http://127.0.0.1:8088/healthz", timeout=LONG) as answer:
        return str(answer.read().decode())


class Booted(unittest.TestCase):
    def setUp(self) -> None:
        Path("/etc/voxeld").mkdir(exist_ok=True)
        Path("/etc/voxeld/voxeld.toml").write_text(CONFIG, encoding="utf-8")
        drop_in = Path("/run/systemd/system/voxeld.service.d/test.conf")
        drop_in.parent.mkdir(parents=True, exist_ok=True)
        drop_in.write_text(f"[Service]\nWatchdogSec={WATCHDOG:.0f}\n", encoding="utf-8")
        systemctl("daemon-reload")
        systemctl("restart", "voxeld.socket", "voxeld.service")
        self.addCleanup(systemctl, "stop", "voxeld.service", "voxeld.socket")
        self.restarts = int(shows("NRestarts"))
        self.pid = int(shows("MainPID"))
        v = voxel.connect(SERVER, timeout=LONG, name="keeps", on_disconnect="keep")
        v.layer("stays").box("box", size=(1, 1, 1), color="white", fill="solid")
        self.assertTrue(v.commit(durable=True).wait_durable(LONG).durable)
        v.close(LONG)

    def back(self, began: float, most: float, what: str) -> None:
        """Checks that a client that calls at once is served, by another process, and that what was durable is shown."""
        with voxel.connect(SERVER, timeout=LONG) as v:
            names = [entity.key.id for entity in v.entities(timeout=LONG)]
            served = time.monotonic() - began
            self.assertIn("box", names)
            until(lambda: bool(np.any(v.capture("sim", timeout=LONG).rgb)), "what is kept is shown")
        print(f"{what}: served again after {served:.2f} s", flush=True)
        self.assertLess(served, most)
        self.assertNotEqual(int(shows("MainPID")), self.pid)
        self.assertEqual(int(shows("NRestarts")), self.restarts + 1)

    def test_killed(self) -> None:
        for number in (signal.SIGKILL, signal.SIGSEGV):
            began = time.monotonic()
            os.kill(self.pid, number)
            self.back(began, 5, signal.Signals(number).name)  # RestartSec=1, and the time to start
            self.pid, self.restarts = int(shows("MainPID")), int(shows("NRestarts"))

    def play_confined(self, without: str) -> "tuple[str, str]":
        """Plays a file in a service confined like voxeld.service, as the daemon does with a file that a page sends. Lines of the unit that match
        `without` are left out. Returns: the result of that service, and its output."""
        unit = Path("/lib/systemd/system/voxeld.service").read_text(encoding="utf-8")
        lines = [line for line in unit.splitlines()
                 if re.match("(User|Group|UMask|Capability|Lock|NoNew|Private|Protect|Remove|Restrict|SystemCall)", line) and not re.search(without, line)]
        folder = Path("/opt/booted/sent")
        folder.mkdir(exist_ok=True)
        (folder / "a.stl").write_text("solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n",
                                      encoding="utf-8")
        output = folder / "output"
        output.unlink(missing_ok=True)
        service = ["[Service]", "Type=oneshot", f"StandardOutput=file:{output}", "StandardError=inherit",
                   f"ExecStart=/usr/bin/voxelctl --server {SERVER} play --other-files none {folder}/a.stl", *lines]
        Path("/run/systemd/system/reader.service").write_text("\n".join(service) + "\n", encoding="utf-8")
        systemctl("daemon-reload")
        subprocess.run(["systemctl", "start", "reader.service"], check=False, capture_output=True)
        self.addCleanup(subprocess.run, ["systemctl", "reset-failed", "reader.service"], check=False, capture_output=True)
        return systemctl("show", "--value", "-p", "Result", "reader.service"), output.read_text(encoding="utf-8")

    def test_files_of_strangers_are_read_in_the_units_confinement(self) -> None:
        result, output = self.play_confined(without="^$")
        if "Landlock" in output:
            self.skipTest(output)  # this kernel does not support it
        self.assertEqual(result, "success", output)
        self.assertIn("1 presented", output)
        # Where the unit forbids Landlock's calls, files are refused, with the reason.
        result, output = self.play_confined(without="landlock")
        self.assertEqual(result, "exit-code", output)
        self.assertIn("Landlock", output)

    def test_stopped_for_longer_than_its_watchdog(self) -> None:
        began = time.monotonic()
        os.kill(self.pid, signal.SIGSTOP)
        until(lambda: int(shows("NRestarts")) > self.restarts, "the watchdog")
        self.back(began, WATCHDOG + STOPS + 5, f"SIGSTOP, a watchdog of {WATCHDOG:.0f} s")

    def test_stopped_for_less(self) -> None:
        os.kill(self.pid, signal.SIGSTOP)
        time.sleep(WATCHDOG / 3)  # it stays stopped for that long
        os.kill(self.pid, signal.SIGCONT)
        with voxel.connect(SERVER, timeout=LONG) as v:
            v.sphere("ball", radius=0.3, color="green")
            self.assertEqual(len(v.commit().wait_shown(timeout=LONG)), 2)
        self.assertEqual((int(shows("MainPID")), int(shows("NRestarts"))), (self.pid, self.restarts))

    def test_reloads_and_ends(self) -> None:
        systemctl("reload", "voxeld.service")
        self.assertIn('"status":"ok"', health())
        self.assertEqual(int(shows("MainPID")), self.pid)
        began = time.monotonic()
        systemctl("stop", "voxeld.service")
        print(f"stopped in {time.monotonic() - began:.2f} s", flush=True)
        self.assertEqual((shows("Result"), shows("ExecMainStatus")), ("success", "0"))
        # Its socket still exists, and a client that connects starts the daemon.
        with voxel.connect(SERVER, timeout=LONG) as v:
            self.assertIn("box", [entity.key.id for entity in v.entities(timeout=LONG)])


if __name__ == "__main__":
    unittest.main()
