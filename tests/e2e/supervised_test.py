"""Tests voxeld started by a supervisor."""

import contextlib
import os
import signal
import socket
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

from operate_test import DISPLAY, KILLS, LONG, voxelctl


class Supervised(unittest.TestCase):
    """A supervisor like systemd: it has made the sockets, receives notifications, and runs a watchdog."""

    def setUp(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = f"{self.folder.name}/voxeld.sock"
        self.listening = socket.socket(socket.AF_UNIX)
        self.addCleanup(self.listening.close)
        self.listening.bind(self.path)
        self.listening.listen(128)
        self.notify = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.addCleanup(self.notify.close)
        self.notify.bind(f"{self.folder.name}/notify")
        self.notify.settimeout(LONG)
        self.config = Path(self.folder.name, "voxeld.toml")
        # The address is that of the inherited socket: it is not bound again.
        self.config.write_text(f'[server]\nlisten = ["unix:{self.path}"]\nhttp = "off"\n{DISPLAY}')

    def start(self) -> "subprocess.Popen[bytes]":
        def third() -> None:
            os.dup2(self.listening.fileno(), 3)

        started = subprocess.Popen(
            ["sh", "-c", 'LISTEN_PID=$$ exec "$@"', "sh", os.environ["VOXELD"], "--config", str(self.config), "--state-dir",
             f"{self.folder.name}/state"], preexec_fn=third, pass_fds=(3,), stderr=subprocess.DEVNULL,
            env={**os.environ, "LISTEN_FDS": "1", "NOTIFY_SOCKET": f"{self.folder.name}/notify", "WATCHDOG_USEC": "600000"})
        self.addCleanup(started.wait)
        self.addCleanup(started.kill)
        return started

    def hear(self, prefix: str) -> str:
        while True:
            text = self.notify.recv(4096).decode()
            if text.startswith(prefix):
                return text

    def test_it_is_told_and_watches(self) -> None:
        daemon = self.start()
        self.assertEqual(self.hear("READY=1"), "READY=1\nSTATUS=1 display")
        for _ in range(3):
            self.hear("WATCHDOG=1")
        daemon.send_signal(signal.SIGSTOP)  # simulates a hang
        time.sleep(0.3)
        self.notify.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while True:
                self.notify.recv(4096)
        time.sleep(0.7)  # longer than the watchdog's time
        with self.assertRaises(BlockingIOError):
            self.notify.recv(4096)
        self.notify.settimeout(LONG)
        daemon.send_signal(signal.SIGCONT)
        self.hear("WATCHDOG=1")
        daemon.terminate()
        self.assertEqual(self.hear("STOPPING=1"), "STOPPING=1\nSTATUS=shutting down")
        self.assertEqual(daemon.wait(LONG), 0)
        self.assertTrue(os.path.exists(self.path), "the socket is not its own")

    def test_nobody_is_refused_while_it_starts_anew(self) -> None:
        server = f"unix:{self.path}"
        for _ in range(max(2, KILLS // 10)):
            daemon = self.start()
            self.hear("READY=1")
            self.assertIn("sim", voxelctl("--server", server, "displays").stdout)
            daemon.kill()
            daemon.wait()
            asking = [subprocess.Popen([os.environ["VOXELCTL"], "--server", server, "displays"], stdout=subprocess.PIPE,
                                       stderr=subprocess.PIPE, text=True) for _ in range(5)]
            time.sleep(0.2)
            daemon = self.start()
            for one in asking:
                out, errors = one.communicate(timeout=LONG)
                self.assertEqual(one.returncode, 0, errors)
                self.assertIn("sim", out)
            daemon.kill()
            daemon.wait()

    def test_what_it_was_given_must_listen(self) -> None:
        self.listening.close()
        self.listening = socket.socket(socket.AF_UNIX)
        daemon = self.start()
        self.assertNotEqual(daemon.wait(LONG), 0)


if __name__ == "__main__":
    unittest.main()
