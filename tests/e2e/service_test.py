"""Tests voxeld as systemd runs it, and events in the life of a long-running daemon: engines that another process starts, assets that
outlive it, a
configuration that changes. Paths are in VOXELD and VOXELCTL."""
import contextlib
import hashlib
import json
import os
import signal
import subprocess
import tempfile
import unittest
from pathlib import Path
from typing import Any

import numpy as np
import voxeld as voxel

from operate_test import DISPLAY, LONG, Daemon, voxelctl
from polling import until

ACTIVATE = "/usr/bin/systemd-socket-activate"


class Service(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.socket = f"unix:{self.folder}/voxeld.sock"

    def daemon(self, config: str = "", *options: str) -> Daemon:
        daemon = Daemon(f'[server]\nlisten = ["{self.socket}"]\nhttp = "off"\n{config}{DISPLAY}', *options)
        self.addCleanup(daemon.__exit__, None, None, None)
        return daemon

    def connect(self, **options: Any) -> voxel.Connection:
        v = voxel.connect(self.socket, timeout=LONG, **options)
        self.addCleanup(v.close)
        return v

    def picture(self, v: voxel.Connection, radius: float) -> voxel.Volume:
        with v.frame("l") as frame:
            frame.sphere("ball", radius=radius)
        accepted = frame.wait(LONG).accepted
        assert accepted is not None
        return v.capture(at_least_snapshot=accepted.snapshot, timeout=LONG)

    def engines(self, manager: int) -> list[int]:
        """Returns the processes that the manager of the socket has started."""
        found = []
        for child in Path(f"/proc/{manager}/task/{manager}/children").read_text(encoding="ascii").split():
            with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # it has exited in the meantime
                if "voxeld-engine" in Path(f"/proc/{child}/comm").read_text(encoding="ascii"):
                    found.append(int(child))
        return found

    def test_an_engine_that_a_service_manager_starts(self) -> None:
        path = self.folder / "engine.sock"
        engine = Path(os.environ["VOXELD"]).parent / "voxeld-engine"
        manager = subprocess.Popen([ACTIVATE, "--accept", "--seqpacket", f"--listen={path}", str(engine)], stderr=subprocess.DEVNULL)
        self.addCleanup(manager.wait, LONG)
        self.addCleanup(manager.kill)
        until(path.exists, "the socket")
        apart = f'[engine]\nkind = "cpu"\nin_worker = true\nworker = "unix:{path}"\n'
        with self.daemon(apart):
            v = self.connect()
            shown = self.picture(v, 0.7)
            first = self.engines(manager.pid)
            self.assertEqual(len(first), 1)
            os.kill(first[0], signal.SIGKILL)
            self.assertFalse(np.array_equal(self.picture(v, 0.4).rgb, shown.rgb), "the daemon draws by itself meanwhile")
            until(lambda: len(self.engines(manager.pid)) == 1 and self.engines(manager.pid) != first, "another engine")
            again = self.picture(v, 0.7)
            self.assertTrue(np.array_equal(again.rgb, shown.rgb))
            self.assertIn("cpu", json.loads(voxelctl("--server", self.socket, "--json", "stats").stdout)["displays"][0]["engine"])
        until(lambda: not self.engines(manager.pid), "the engine's end")
        with self.daemon('[engine]\nkind = "cpu"\n'):
            self.assertTrue(np.array_equal(self.picture(self.connect(), 0.7).rgb, shown.rgb))

    def test_assets_outlive_the_daemon(self) -> None:
        big, small = self.folder / "big.raw", self.folder / "small.raw"
        big.write_bytes(np.random.default_rng(5).bytes(3_000_000))
        small.write_bytes(b"small")
        digest = hashlib.sha256(big.read_bytes()).hexdigest()
        state = ("--state-dir", f"{self.folder}/state")
        with self.daemon("", *state):
            made = voxelctl("--server", self.socket, "assets", str(big), str(small))
            self.assertEqual(made.returncode, 0, made.stderr)
            self.assertEqual(made.stdout.splitlines()[0], f"{digest}  {big}")
            missing = voxelctl("--server", self.socket, "assets", str(self.folder / "none"))
            self.assertEqual(missing.returncode, 1)
            self.assertIn("none\" cannot be read", missing.stderr)
        with self.daemon("[limits]\nmax_assets_bytes = 3000004\n", *state):
            listed = json.loads(voxelctl("--server", self.socket, "--json", "assets").stdout)
            self.assertEqual([(one["sha256"], one["stored"], one["complete"]) for one in listed["assets"]],
                             [(hashlib.sha256(b"small").hexdigest(), 5, True)], "the older one went, as there is less room")
            text = voxelctl("--server", self.socket, "assets").stdout
            self.assertRegex(text, r"(?m)^[0-9a-f]{64} +5 B +whole")
            again = voxelctl("--server", self.socket, "assets", str(big))
            self.assertEqual(again.returncode, 0, again.stderr)
            empty = self.folder / "empty.raw"
            empty.touch()
            refused = voxelctl("--server", self.socket, "assets", str(empty))
            self.assertEqual(refused.returncode, 1)
            self.assertIn("an asset has 1 byte at least", refused.stderr)

    def test_what_runs_is_configured_anew(self) -> None:
        config = self.folder / "voxeld.toml"
        text = f'[server]\nlisten = ["{self.socket}"]\nhttp = "off"\n[log]\nlevel = "info"\n{DISPLAY}'
        config.write_text(text, encoding="utf-8")
        process = subprocess.Popen([os.environ["VOXELD"], "--config", str(config), "--log-format", "json"], stderr=subprocess.PIPE,
                                   text=True)
        self.addCleanup(process.wait, LONG)
        self.addCleanup(process.kill)
        assert process.stderr is not None
        self.addCleanup(process.stderr.close)

        def next_line(event: str) -> dict[str, str]:
            assert process.stderr is not None
            for line in process.stderr:
                fields: dict[str, str] = json.loads(line)
                if fields["event"] == event:
                    return fields
            raise AssertionError(f"it ended before {event!r}")

        def view() -> str:
            return str(json.loads(voxelctl("--server", self.socket, "--json", "displays").stdout)["displays"][0]["view"])

        next_line("ready")
        before = view()
        config.write_text(text + 'view = "voxels"\n', encoding="utf-8")
        process.send_signal(signal.SIGHUP)
        next_line("asked to read its files again")
        until(lambda: view() != before, "the new view")
        after = view()
        config.write_text(text + "view = 7\n", encoding="utf-8")
        process.send_signal(signal.SIGHUP)
        next_line("asked to read its files again")
        stats = until(lambda: json.loads(voxelctl("--server", self.socket, "--json", "stats").stdout).get("connections", {}).get("config_trouble"),
                      "word of the trouble")
        self.assertIn("view", stats)
        self.assertEqual(view(), after, "nothing of a wrong file is taken")


if __name__ == "__main__":
    unittest.main()
