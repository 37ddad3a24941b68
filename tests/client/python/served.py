"""The plain server behind a real socket, and connections to it."""
import os
import tempfile
import threading
import unittest
from concurrent import futures
from typing import Any, Iterator, Optional

import grpc
from plain_server import PlainServer, TooLarge, pb

import voxeld as voxel

LONG = 60.0


class Served:
    """The plain server at a unix socket."""

    def __init__(self, path: str, plain: Optional[PlainServer] = None) -> None:
        self.plain = plain or PlainServer()
        self.address = f"unix:{path}"
        self.cut = threading.Event()           # the next request ends its stream
        self.refuse: Optional[grpc.StatusCode] = None
        self.credit = threading.Event()        # cleared: no credit is given beyond the initial one
        self.credit.set()
        self.insert: list[bytes] = []          # answers that belong to no request, to be sent first
        self.ended = threading.Semaphore(0)    # counts ended streams
        self._server = grpc.server(futures.ThreadPoolExecutor(4))
        handler = grpc.stream_stream_rpc_method_handler(self._stream)
        self._server.add_generic_rpc_handlers(
            [grpc.method_handlers_generic_handler("voxeld.v1.SceneService", {"Stream": handler})])
        self._server.add_insecure_port(self.address)
        self._server.start()

    def stop(self) -> None:
        self._server.stop(None).wait(LONG)

    def _stream(self, requests: Iterator[bytes], context: Any) -> Iterator[bytes]:
        if self.refuse is not None:
            context.abort(self.refuse, "not you")
        self.plain.begin()
        context.add_callback(self.ended.release)
        for message in requests:
            yield from self.insert
            self.insert = []
            if self.cut.is_set():
                self.cut.clear()
                context.abort(grpc.StatusCode.UNAVAILABLE, "cut")
            try:
                answers = self.plain.receive(message)
            except LookupError:
                context.abort(grpc.StatusCode.NOT_FOUND, "no such session")
            except TooLarge:
                context.abort(grpc.StatusCode.RESOURCE_EXHAUSTED, "the message is too large")
            # A ping that used up the credit is still answered. Otherwise the client would never send what the test wants to block.
            is_ping = pb.StreamRequest.FromString(message).HasField("ping")
            if self.plain.window and self.plain.received >= self.plain.credit and not is_ping:
                self.credit.wait(LONG)
            for answer in answers + self.plain.give_credit():
                yield answer.SerializeToString()


class Case(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = os.path.join(folder.name, "v.sock")

    def serve(self, plain: Optional[PlainServer] = None) -> Served:
        served = Served(self.path, plain)
        self.addCleanup(served.stop)
        return served

    def connect(self, **options: Any) -> voxel.Connection:
        connection = voxel.connect(f"unix:{self.path}", timeout=LONG, **options)
        self.addCleanup(connection.close)
        return connection

    def ids(self, served: Served, layer: str = "main") -> list[str]:
        assert served.plain.session is not None
        return sorted(served.plain.session.scene.get(layer, {}))

    def stuck(self, **options: Any) -> tuple[Served, voxel.Connection]:
        """A server that has no more credit to give, and one message on its way."""
        served = self.serve(PlainServer(window=64))
        v = self.connect(**options)
        served.credit.clear()
        self.addCleanup(served.credit.set)
        with v.frame("filler") as frame:
            frame.sphere("s", label="x" * 200)
        v._transport.wait_until(lambda: frame.ticket.state == "sent", LONG)
        return served, v
