"""A daemon for tests of voxelctl alone. Paths are in VOXELD and VOXELCTL."""
import os
import subprocess
import tempfile
from pathlib import Path

from polling import LONG, until

VOXELCTL = os.environ["VOXELCTL"]


class QuickDaemon:
    """The daemon is ready when the constructor returns. It has two displays, `stack` and `rotor`."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self.folder = Path(self._folder.name)
        self.server = f"unix:{self.folder}/s"
        self.environment = {**os.environ, "VOXELD_SERVER": self.server, "HOME": self._folder.name}
        self.environment.pop("XDG_CONFIG_HOME", None)
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen(
            [os.environ["VOXELD"], "--listen", self.server, "--http", "off", "--log-level", "warn",
             "--display", "stack=simulated,geometry=planar,size=16x16x16", "--display", "rotor=simulated,geometry=rotor,size=16x16,slices=60"],
            env=self.environment)
        until(self._listens, "voxeld, listening")

    def _listens(self) -> bool:
        assert self.process.poll() is None, "voxeld has ended"
        return self.voxelctl("displays").returncode == 0

    def voxelctl(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([VOXELCTL, *arguments], env=self.environment, capture_output=True, text=True, timeout=LONG)

    def close(self) -> None:
        self.process.kill()
        self.process.wait(LONG)
        self._folder.cleanup()
