"""A daemon under a load, and a client beside it that must not notice a fault (fault_matrix_test). The paths are in VOXELD and PYTHONPATH."""
import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import urllib.error
import urllib.request
from pathlib import Path
from typing import Optional

import numpy as np
import voxeld as voxel

from life import free_port
from polling import LONG, until
from programs import ENDS_WITH_US, program

DISPLAYS = 'driver = "simulated"\nsize = "16x16x12"\nrate = 60\n'
HERE = Path(__file__).parent


class Cell:
    """A daemon under a load."""

    def __init__(self, test: unittest.TestCase, clients: int, hurt: str = "", engine: str = 'kind = "cpu"\n', environment: Optional[dict[str, str]] = None, tls: bool = False) -> None:
        self.test = test
        self.folder = tempfile.mkdtemp(prefix="voxeld-faults-")
        self.server = f"unix:{self.folder}/s"
        self.port, self.http = free_port(), free_port()
        listen = f'"{self.server}", "127.0.0.1:{self.port}"'
        security = ""
        if tls:
            self.certificate("first")
            self.install("first")
            listen = f'"{self.server}", "tls:127.0.0.1:{self.port}"'
            security = (f'[security]\ntls_certificate = "{self.folder}/server.pem"\ntls_key = "{self.folder}/server.key"\n'
                        f'tls_client_ca = "{self.folder}/first.pem"\ngrants = "{self.folder}/grants.toml"\n')
            grants = Path(self.folder, "grants.toml")
            grants.write_text('[[certificate]]\nname = "all"\nsubject = "first"\nscopes = ["view", "draw"]\n', encoding="utf-8")
            grants.chmod(0o600)
        Path(self.folder, "voxeld.toml").write_text(
            f'[server]\nlisten = [{listen}]\nhttp = "127.0.0.1:{self.http}"\n[state]\ndir = "{self.folder}/state"\n{security}'
            f'[engine]\n{engine}[[display]]\nname = "hurt"\n{DISPLAYS}{hurt}[[display]]\nname = "well"\n{DISPLAYS}', encoding="utf-8")
        self.environment = {**os.environ, **(environment or {})}
        self.told = ""  # what /healthz says, sampled now and then
        self.moved: set[str] = set()  # metrics that a fault has already seen change
        self.goes_on: Optional["GoesOn"] = None
        self.start()
        test.addCleanup(self.close)
        self.via = self.server
        self.clients = clients
        self.load: Optional[subprocess.Popen[str]] = None

    def start(self) -> None:
        self.log = open(f"{self.folder}/log", "a", encoding="utf-8")
        self.daemon = subprocess.Popen([*ENDS_WITH_US, program("VOXELD", "the daemon"), "--config", f"{self.folder}/voxeld.toml", "--log-level", "info"],
                                       stdin=subprocess.DEVNULL, stdout=self.log, stderr=subprocess.STDOUT, env=self.environment)
        until(self.reachable, f"a daemon: {self.said()[-2000:]}")

    def reachable(self) -> bool:
        assert self.daemon.poll() is None, self.said()[-2000:]
        with contextlib.suppress(OSError, urllib.error.URLError):
            return "status" in (health := self.health()) and '"starting"' not in health
        return False

    def said(self) -> str:
        return Path(f"{self.folder}/log").read_text(encoding="utf-8", errors="replace")

    def health(self, timeout: float = LONG) -> str:
        """Returns the text that /healthz answers, whether with 200 or 503."""
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self.http}/healthz", timeout=timeout) as answer:
                return str(answer.read().decode())
        except urllib.error.HTTPError as error:
            return str(error.read().decode())

    def metrics(self) -> dict[str, float]:
        """Returns the samples only; the descriptions of the metrics are the same in every answer."""
        with urllib.request.urlopen(f"http://127.0.0.1:{self.http}/metrics", timeout=LONG) as answer:
            lines = answer.read().decode().splitlines()
        return {line.rpartition(" ")[0]: float(line.rpartition(" ")[2]) for line in lines if line and not line.startswith("#")}

    def watch_health(self, seconds: float, says: str = "") -> None:
        """Records what /healthz says in the meantime; a stopped daemon says nothing. With `says`, goes on (for LONG at most) until it has
        said that."""
        end = time.monotonic() + seconds
        last = end + LONG if says else end
        while time.monotonic() < end or time.monotonic() < last and self.daemon.poll() is None and not re.search(says, self.told):
            with contextlib.suppress(OSError, urllib.error.URLError):
                self.told += self.health(max(0.05, end - time.monotonic())) + "\n"
            time.sleep(0.05)  # the interval between queries

    def certificate(self, name: str) -> None:
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2", "-subj", f"/CN={name}",
                        "-addext", "subjectAltName=DNS:display.example", "-keyout", f"{self.folder}/{name}.key", "-out", f"{self.folder}/{name}.pem"],
                       check=True, capture_output=True)

    def install(self, name: str, key: str = "") -> None:
        for end in ("key", "pem"):
            path = Path(self.folder, f"server.{end}.new")
            path.write_bytes(Path(self.folder, f"{key or name if end == 'key' else name}.{end}").read_bytes())
            path.chmod(0o600)
            path.rename(Path(self.folder, f"server.{end}"))

    def begin_load(self, *more: str) -> None:
        if self.clients == 0:
            return
        self.load = subprocess.Popen([sys.executable, str(HERE / "clients.py"), self.via, str(self.clients), "20" if self.clients == 1 else "4", *more],
                                     stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.load.stdout is not None
        self.test.assertEqual(self.load.stdout.readline(), "ready\n")

    def end_load(self) -> dict[str, int]:
        """Ends the load and returns the outcomes of its commits; what was drawn stays visible until close()."""
        if self.load is None:
            return {}
        assert self.load.stdin is not None and self.load.stdout is not None
        self.load.stdin.write("stop\n")
        self.load.stdin.flush()
        sums: dict[str, int] = json.loads(self.load.stdout.readline())
        self.test.assertEqual(sums["clients"], self.clients)
        self.test.assertEqual(sums["missing"], 0, sums)
        return sums

    def close(self) -> None:
        if self.load is not None:
            with contextlib.suppress(ProcessLookupError):
                self.load.send_signal(signal.SIGCONT)
            self.load.kill()
            self.load.communicate()
        if self.daemon.poll() is None:
            self.daemon.send_signal(signal.SIGCONT)
            self.daemon.terminate()
            try:
                self.daemon.wait(LONG)
            except subprocess.TimeoutExpired:
                self.daemon.kill()
                self.daemon.wait()
        self.log.close()
        subprocess.run(["rm", "-rf", self.folder], check=True)


class GoesOn:
    """A client that must not notice anything: each of its commits is shown on the healthy display."""

    def __init__(self, cell: Cell) -> None:
        self.commits, self.wrong = 0, ""
        self.stop = threading.Event()
        self.v = voxel.connect(cell.server, name="goes on", timeout=LONG)
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self) -> None:
        try:
            while not self.stop.is_set():
                self.v.layer("goes on").sphere("ball", radius=0.1 + self.commits % 9 / 20, color="green")
                outcome = self.v.commit().wait_shown(timeout=LONG)["well"]
                self.commits += 1
                if outcome.kind not in ("presented", "unchanged", "superseded"):
                    self.wrong = f"commit {self.commits}: {outcome}"
                self.stop.wait(0.03)
        except (voxel.VoxelError, TimeoutError, KeyError) as error:
            self.wrong = f"after {self.commits}: {type(error).__name__}: {error}"

    def end(self) -> None:
        self.stop.set()
        self.thread.join(2 * LONG)
        assert not self.thread.is_alive()


def same_light(cell: Cell) -> None:
    """Checks that both displays show the same, and that they are not dark."""
    with voxel.connect(cell.server, name="last", timeout=LONG) as v:
        v.layer("last").box("box", size=(0.4, 0.4, 0.4), color="white", fill="solid")
        accepted = v.commit().wait(LONG).accepted
        assert accepted is not None
        snapshot = accepted.snapshot

        def alike() -> bool:
            with contextlib.suppress(voxel.VoxelError):
                hurt, well = (v.capture(name, at_least_snapshot=snapshot, timeout=LONG).rgb for name in ("hurt", "well"))
                return bool(np.array_equal(hurt, well) and well.any())
            return False

        until(alike, "the same light on both displays")
