"""Tests what docs/security/advisories.toml says was tried: sends the requests of advisories about gRPC to the real voxeld. Its path is in VOXELD."""
import os
import re
import socket
import subprocess
import tempfile
import unittest
from pathlib import Path

from polling import LONG, until

ROOT = Path(__file__).resolve().parent.parent.parent
PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
DATA, HEADERS, SETTINGS, GOAWAY = 0, 1, 4, 7
END_STREAM, ACK, END_HEADERS = 1, 1, 4
MOST_METADATA = 8192  # the limit in the daemon's SETTINGS


def frame(kind: int, flags: int, stream: int, payload: bytes = b"") -> bytes:
    return len(payload).to_bytes(3, "big") + bytes([kind, flags]) + stream.to_bytes(4, "big") + payload


def field(name: bytes, value: bytes) -> bytes:
    """Returns a literal header field that is not indexed (RFC 7541, 6.2.2)."""
    def length(size: int) -> bytes:
        if size < 127:
            return bytes([size])
        out, size = [127], size - 127
        while size >= 128:
            out.append(size % 128 + 128)
            size //= 128
        return bytes([*out, size])
    return b"\0" + length(len(name)) + name + length(len(value)) + value


def call(stream: int, *, scheme: bytes = b"http", te: bytes = b"trailers", more: bytes = b"") -> bytes:
    """Returns a call that asks for the daemon's health, which needs no authorisation."""
    headers = (field(b":method", b"POST") + field(b":scheme", scheme) + field(b":path", b"/grpc.health.v1.Health/Check")
               + field(b":authority", b"voxeld") + field(b"content-type", b"application/grpc") + field(b"te", te) + more)
    return frame(HEADERS, END_HEADERS, stream, headers) + frame(DATA, END_STREAM, stream, bytes(5))


class Peer:
    """A connection, and the frames that arrive on it."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=LONG)
        self.received = b""

    def read(self) -> tuple[int, int, int, bytes] | None:
        """Returns kind, flags, stream and payload; None at the end."""
        while True:
            if len(self.received) >= 9:
                size = int.from_bytes(self.received[:3], "big")
                if len(self.received) >= 9 + size:
                    head, payload = self.received[:9], self.received[9:9 + size]
                    self.received = self.received[9 + size:]
                    return head[3], head[4], int.from_bytes(head[5:9], "big"), payload
            try:
                more = self.socket.recv(1 << 16)
            except ConnectionResetError:
                return None
            if not more:
                return None
            self.received += more

    def answer(self, stream: int) -> bytes:
        """Returns the header blocks of a stream until the stream ends, or all that arrived before the connection ended."""
        blocks = b""
        while (read := self.read()) is not None:
            kind, flags, where, payload = read
            if where == stream and kind == HEADERS:
                blocks += payload
                if flags & END_STREAM:
                    break
        return blocks


class Headers(unittest.TestCase):
    """CVE-2023-1428 and similar ones: headers that gRPC's parser fails on."""

    def setUp(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.log = Path(self.folder.name, "log")
        with self.log.open("wb") as log:
            self.daemon = subprocess.Popen([os.environ["VOXELD"], "--listen", "127.0.0.1:0", "--http", "off",
                                            "--display", "d=simulated,geometry=planar,size=8x8x8"], stdout=log, stderr=log)
        self.addCleanup(self.daemon.wait, LONG)
        self.addCleanup(self.daemon.kill)
        until(self.ready, "voxeld, listening")
        self.port = int(re.search(r" ready listen=127\.0\.0\.1:(\d+)", self.log.read_text())[1])  # type: ignore[index]

    def ready(self) -> bool:
        self.assertIsNone(self.daemon.poll(), self.log.read_text())
        return " ready " in self.log.read_text()

    def begin(self) -> Peer:
        """Starts a connection whose first call was answered and that has received the daemon's SETTINGS, which gRPC enforces from then on."""
        peer = Peer(self.port)
        peer.socket.sendall(PREFACE + frame(SETTINGS, 0, 0))
        # The listener's own SETTINGS arrive first, gRPC's with its first answer.
        first = peer.read()
        assert first is not None and first[0] == SETTINGS
        peer.socket.sendall(call(1))
        self.assertIn(b"grpc-status", peer.answer(1))
        peer.socket.sendall(frame(SETTINGS, ACK, 0) * 2)
        return peer

    def test_unknown_values_before_too_many_headers(self) -> None:
        much = field(b"a", b"b" * MOST_METADATA)
        for name, request in (("te", call(3, te=b"x", more=much)), ("scheme", call(3, scheme=b"x", more=much)),
                              ("grpclb_client_stats", call(3, more=field(b"grpclb_client_stats", b"x") + much)),
                              ("none of them", call(3, more=much))):
            with self.subTest(name):
                peer = self.begin()
                peer.socket.sendall(request)
                answer = peer.answer(3)
                # The refusal for its size shows that it reached the code with the advisory's error.
                self.assertIn(b"metadata size exceeds limit", answer)
                peer.socket.close()
                self.assertIsNone(self.daemon.poll(), self.log.read_text())
        peer = self.begin()
        peer.socket.sendall(call(3))
        self.assertNotEqual(peer.answer(3), b"", "nobody is served any more")
        peer.socket.close()


class Sources(unittest.TestCase):
    def test_nobody_asks_for_sending_without_copies(self) -> None:
        """CVE-2024-11407 is about GRPC_ARG_TCP_TX_ZEROCOPY_ENABLED and its name."""
        seen = 0
        for folder in ("daemon", "client", "tools"):
            for path in (ROOT / folder).rglob("*"):
                if path.suffix in (".cc", ".h", ".py"):
                    text = path.read_text()
                    seen += "GRPC_ARG_" in text
                    self.assertNotRegex(text, r"ZEROCOPY_ENABLED|tcp_tx_zero_copy", str(path))
        self.assertGreater(seen, 1, "the sources that set gRPC's arguments were not found")


class Statement(unittest.TestCase):
    def test_is_what_its_source_says_and_names_what_exists(self) -> None:
        checked = subprocess.run([ROOT / "tools/advisories.py", "--check"], capture_output=True, text=True)
        self.assertEqual(checked.returncode, 0, checked.stderr)


if __name__ == "__main__":
    unittest.main()
