"""Tests the health reports, by gRPC and by http, while a display is lost and returns: an Open Pixel Control controller, which is a socket
here. The path of
voxeld is in VOXELD."""
import contextlib
import json
import os
import socket
import subprocess
import tempfile
import threading
import time
import unittest
import urllib.error
import urllib.request
from typing import Any, Callable

import grpc

from ola_peer_test import free_port

LONG = 60.0
SERVING, NOT_SERVING = b"\x08\x01", b"\x08\x02"  # grpc.health.v1.HealthCheckResponse


class Controller:
    """Accepts whatever it is sent."""

    def __init__(self, port: int) -> None:
        self._listening = socket.create_server(("127.0.0.1", port))
        self._streams: list[socket.socket] = []
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                stream, _ = self._listening.accept()
                self._streams.append(stream)
                threading.Thread(target=self._take, args=(stream,), daemon=True).start()

    @staticmethod
    def _take(stream: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while stream.recv(65536):
                pass

    def close(self) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self._thread.join(LONG)
        for stream in self._streams:
            with contextlib.suppress(OSError):
                stream.shutdown(socket.SHUT_RDWR)
            stream.close()


class Health(unittest.TestCase):
    def until(self, ask: Callable[[], Any], want: Any) -> None:
        deadline = time.monotonic() + LONG
        while (got := ask()) != want and time.monotonic() < deadline:
            time.sleep(0.02)
        self.assertEqual(got, want)

    def test_it_is_well_once_clients_can_connect(self) -> None:
        for _ in range(5):
            http = free_port()
            with tempfile.TemporaryDirectory() as folder:
                daemon = subprocess.Popen([os.environ["VOXELD"], "--listen", f"unix:{folder}/s", "--http", f"127.0.0.1:{http}", "--log-level", "error",
                                           "--engine", "cpu", "--display", "sim=simulated,size=8x8x8,rate=60"])
                try:
                    status = 0
                    deadline = time.monotonic() + LONG
                    while status != 200:
                        self.assertLess(time.monotonic(), deadline)
                        with contextlib.suppress(OSError):  # an answer other than 200 counts too
                            with urllib.request.urlopen(f"http://127.0.0.1:{http}/healthz", timeout=LONG) as answer:
                                status = answer.status
                    with socket.socket(socket.AF_UNIX) as client:
                        client.connect(f"{folder}/s")
                finally:
                    daemon.terminate()
                    self.assertEqual(daemon.wait(LONG), 0)

    def test_a_display_that_is_lost_and_comes_back(self) -> None:
        http, port = free_port(), free_port()
        controller = Controller(port)
        with tempfile.TemporaryDirectory() as folder:
            server = f"unix:{folder}/voxeld.sock"
            daemon = subprocess.Popen(
                [os.environ["VOXELD"], "--listen", server, "--http", f"127.0.0.1:{http}", "--log-level", "error", "--engine", "cpu", "--display",
                 "sim=simulated,size=8x8x8,rate=60", "--display", f"cube=network,address=127.0.0.1:{port},protocol=opc,cube=4x4x4"])
            try:
                with grpc.insecure_channel(server) as channel:
                    check = channel.unary_unary("/grpc.health.v1.Health/Check")

                    def asked(service: bytes = b"") -> bytes:
                        request = b"\x0a" + bytes([len(service)]) + service if service else b""
                        return bytes(check(request, timeout=LONG, wait_for_ready=True))

                    def page() -> tuple[int, list[tuple[str, str]]]:
                        try:
                            with urllib.request.urlopen(f"http://127.0.0.1:{http}/healthz", timeout=LONG) as answer:
                                status, text = answer.status, answer.read()
                        except urllib.error.HTTPError as error:
                            status, text = error.code, error.read()
                        return status, [(reason.get("display", ""), reason["what"]) for reason in json.loads(text)["reasons"] if reason["what"] != "time"]

                    self.until(asked, SERVING)
                    self.until(page, (200, []))
                    controller.close()
                    self.until(asked, NOT_SERVING)
                    self.until(lambda: asked(b"voxeld.v1.SceneService"), NOT_SERVING)
                    self.until(page, (503, [("cube", "lost")]))
                    controller = Controller(port)
                    self.until(asked, SERVING)
                    self.until(lambda: asked(b"voxeld.v1.SceneService"), SERVING)
                    self.until(page, (200, [("cube", "device")]))  # a loss is reported for a minute
            finally:
                daemon.terminate()
                self.assertEqual(daemon.wait(LONG), 0)
                controller.close()
