"""A network that can be degraded: forwards connections from a port of its own to another address."""
import contextlib
import socket
import threading


class Relay:
    """`stalled`: nothing passes. `half`: the first half of each received piece passes, and the connection ends. cut(): all connections end."""

    def __init__(self, to: tuple[str, int]) -> None:
        self._to = to
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listening.getsockname()[1])
        self.going = threading.Event()
        self.going.set()
        self.half = False
        self.held = self.halved = 0  # bytes that were delayed; pieces of which only half passed
        self._mutex = threading.Lock()
        self._open: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def stall(self) -> None:
        self.going.clear()

    def go_on(self) -> None:
        self.half = False
        self.going.set()

    def cut(self) -> int:
        """Ends all connections. Returns how many there were."""
        with self._mutex:
            ended, self._open = self._open, []
        for each in ended:
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
        return len(ended) // 2

    def close(self) -> None:
        self.go_on()
        with contextlib.suppress(OSError):
            self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self.cut()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listening.accept()
                try:
                    far = socket.create_connection(self._to)
                except OSError:
                    near.close()
                    continue
                with self._mutex:
                    self._open += [near, far]
                for one, other in ((near, far), (far, near)):
                    threading.Thread(target=self._forward, args=(one, other), daemon=True).start()

    def _forward(self, one: socket.socket, other: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := one.recv(65536):
                if not self.going.is_set():
                    self.held += len(data)
                self.going.wait()
                if self.half:
                    self.halved += 1
                    other.sendall(data[:len(data) // 2])
                    break
                other.sendall(data)
        for each in (one, other):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
