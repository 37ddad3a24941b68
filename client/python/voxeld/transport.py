"""Streams over gRPC: connecting, connecting again, and the two threads that feed and read a stream.

The caller's threads only put commits into the session's outbox and wake whoever sends. gRPC takes requests from an iterator
of ours on a thread of its own, as bytes that go out as they are; another thread reads answers. A stream that ends is begun
anew after a pause that grows from BACKOFF_FIRST_S to BACKOFF_MOST_S, drawn at random from its upper half.
"""
from __future__ import annotations

import logging
import random
import threading
import time
from collections import deque
from typing import Callable, Deque, Iterator, Optional

import grpc

from . import address
from .errors import BufferFull, ConnectionLost
from .operations import Unit
from .receipts import Frame, Issue
from .session import Session
from .v1 import scene_pb2 as pb

log = logging.getLogger("voxeld")

STREAM = "/voxeld.v1.SceneService/Stream"
BACKOFF_FIRST_S, BACKOFF_MOST_S = 0.1, 5.0

CHANNEL_OPTIONS = [
    ("grpc.max_send_message_length", -1),
    ("grpc.max_receive_message_length", -1),
    # A new channel must not wait out the pauses of the one before.
    ("grpc.use_local_subchannel_pool", 1),
    ("grpc.keepalive_time_ms", 20_000),
    ("grpc.keepalive_timeout_ms", 10_000),
    ("grpc.http2.write_buffer_size", 1 << 20),
]

# To begin again would bring the same answer.
_FINAL = (grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.PERMISSION_DENIED, grpc.StatusCode.UNAUTHENTICATED,
          grpc.StatusCode.UNIMPLEMENTED, grpc.StatusCode.FAILED_PRECONDITION, grpc.StatusCode.NOT_FOUND,
          grpc.StatusCode.ABORTED)  # another stream has taken the session up


def backoff_s(attempt: int, draw: Callable[[], float]) -> float:
    """The pause before attempt number `attempt` (0 is the first after a loss); `draw` gives 0 to 1."""
    most = min(BACKOFF_FIRST_S * 2.0 ** min(attempt, 16), BACKOFF_MOST_S)
    return most * (0.5 + 0.5 * draw())


class Transport:
    """`on_issue` is called on the reading thread, without any lock; it may draw, but not wait."""

    def __init__(self, server: str, session: Session, on_issue: Callable[[Issue], None]) -> None:
        self.server = server
        self.last_error = ""
        self._target = address.target(server)
        self._session = session
        self._issues: Deque[Issue] = deque()
        self._on_issue = on_issue
        session.on_issue = self._issues.append
        # Reentrant, for whoever draws from a future's callback.
        self._lock = threading.RLock()
        self._changed = threading.Condition(self._lock)
        self._closing = False   # send what is there, then half-close
        self._stopped = False   # nothing more
        self._stream = 0        # which stream is the current one
        self._call: Optional[grpc.StreamStreamCall[bytes, pb.StreamResponse]] = None
        self._thread = threading.Thread(target=self._run, name="voxeld", daemon=True)
        self._thread.start()

    # ------------------------------------------------------------------------------------------- callers' threads

    @property
    def lock(self) -> threading.RLock:
        """Of the session."""
        return self._lock

    def submit(self, make: Callable[[Frame], Unit], wait_for_room: bool) -> Frame:
        """`make` gets the commit's frame. BufferFull unless `wait_for_room`."""
        with self._changed:
            while True:
                if self._stopped:
                    raise ConnectionLost(self.last_error or "the connection is closed")
                unit = make(self._session.new_frame())
                if self._session.submit(unit):
                    self._changed.notify_all()
                    return unit.frame
                if not wait_for_room:
                    raise BufferFull(
                        f"{self._session.outbox.bytes} bytes wait to be sent and {unit.bytes} more are too many; "
                        "v.flush() waits for room, connect(flow='latest') drops old frames, connect(when_full='wait') blocks")
                self._changed.wait()

    def wait_until(self, ready: Callable[[], bool], timeout: Optional[float]) -> bool:
        """Until `ready`, which is asked under the lock. Raises ConnectionLost when there is no hope."""
        with self._changed:
            self._changed.wait_for(lambda: self._stopped or ready(), timeout)
            if ready():
                return True
            if self._stopped:
                raise ConnectionLost(self.last_error or "the connection is closed")
            return False

    def close(self, timeout: float) -> None:
        """Sends what waits and half-closes, within `timeout`; then ends whatever is left. May be called again."""
        end = time.monotonic() + timeout
        with self._changed:
            # What waits for a connection to come back may still go.
            self._changed.wait_for(lambda: self._stopped or self._session.open or self._session.idle(), timeout)
            self._closing = True
            if not self._session.open:
                self._stop("the connection was closed before what waited could be sent")
            self._changed.notify_all()
        self._thread.join(max(end - time.monotonic(), 0))
        with self._changed:
            self._stop("the connection was closed")
        self._thread.join(5)

    def _stop(self, reason: str) -> None:
        if not self._stopped:
            self._stopped = True
            self.last_error = self.last_error or reason
            self._session.fail(reason)
            if self._call is not None:
                self._call.cancel()
        self._changed.notify_all()

    # ------------------------------------------------------------------------------------------------ our threads

    def _requests(self, stream: int) -> Iterator[bytes]:
        """On gRPC's thread: what to send, as it may be sent. Nothing after Open before its answer."""
        with self._changed:
            first = self._session.open_request()
        yield first
        while True:
            with self._changed:
                while True:
                    if self._stream != stream or self._stopped:
                        return
                    message = self._session.next_request(time.monotonic_ns())
                    if message is not None:
                        break
                    if self._session.open and self._session.idle():
                        self._changed.notify_all()  # whoever flushes
                        if self._closing:
                            return
                    ping = self._session.next_ping_ns()
                    self._changed.wait(None if ping is None else max(ping - time.monotonic_ns(), 0) / 1e9 + 1e-4)
            yield message

    def _run(self) -> None:
        attempt = 0
        while True:
            opened_before = self._session.streams_opened
            error = self._one_stream()
            with self._changed:
                self._stream += 1
                self._call = None
                self._session.lost()
                if self._closing or self._stopped:
                    self._stop("the connection was closed")
                    return
                if self._session.streams_opened > opened_before:
                    attempt = 0
                code = error.code() if error is not None else grpc.StatusCode.UNAVAILABLE
                self.last_error = _words(self.server, error, self._session.streams_opened > opened_before)
                if code == grpc.StatusCode.NOT_FOUND and self._session.forget_resume():
                    self._changed.notify_all()
                    continue
                if code in _FINAL:
                    self._stop(self.last_error)
                    return
                self._changed.notify_all()
                pause = backoff_s(attempt, random.random)
                if attempt == 0 and self._session.streams_opened:
                    log.warning("%s; connecting again", self.last_error)
                attempt += 1
                self._changed.wait_for(lambda: self._stopped or self._closing, pause)
                if self._stopped or self._closing:
                    self._stop("the connection was closed")
                    return

    def _one_stream(self) -> Optional[grpc.RpcError]:
        """Reads one stream to its end."""
        channel = grpc.insecure_channel(self._target, options=CHANNEL_OPTIONS)
        try:
            stream_call: grpc.StreamStreamMultiCallable[bytes, pb.StreamResponse] = channel.stream_stream(
                STREAM, request_serializer=None, response_deserializer=pb.StreamResponse.FromString)
            with self._changed:
                if self._stopped:
                    return None
                call = self._call = stream_call(self._requests(self._stream))
            for response in call:
                now = time.monotonic_ns()
                with self._changed:
                    self._session.answer(response, now)
                    self._changed.notify_all()
                while self._issues:
                    self._tell(self._issues.popleft())
        except grpc.RpcError as error:
            return error
        finally:
            channel.close()
        return None

    def _tell(self, issue: Issue) -> None:
        try:
            self._on_issue(issue)
        except Exception:  # whatever it is, it must not end the stream
            log.exception("on_issue failed with %s", issue)


def _words(server: str, error: Optional[grpc.RpcError], stood: bool) -> str:
    if error is None:
        return f"voxeld at {server} ended the stream"
    code, details = error.code(), error.details()
    if code == grpc.StatusCode.UNAVAILABLE and stood:
        return f"the connection to voxeld at {server} was lost ({details})"
    if code == grpc.StatusCode.UNAVAILABLE:
        return (f"no voxeld answers at {server} ({details}); is it running? Where it listens is said by connect('…') or "
                "VOXELD_SERVER")
    return f"voxeld at {server}: {code.name}: {details}"
