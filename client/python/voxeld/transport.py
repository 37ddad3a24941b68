"""Streams over gRPC: connecting, reconnecting, and the two threads that write and read a stream.

The caller's threads only put commits into the session's outbox and wake the sender. gRPC takes requests from an iterator
of ours on a thread of its own, as bytes that are sent unchanged; a second thread reads answers, and users' callbacks run
on a third. A stream that ends is reopened after a pause that grows from BACKOFF_FIRST_S to BACKOFF_MOST_S, drawn at random
from its upper half; it is reset once a commit was answered, or a stream has lasted for as long as the longest pause.
"""
from __future__ import annotations

import logging
import random
import threading
import time
from typing import Callable, Iterator, Optional

import grpc

from . import credentials
from .callbacks import Callbacks
from .credentials import Credentials
from .errors import BufferFull, ConnectionLost, InvalidValue
from .operations import Unit
from .receipts import Frame, Issue
from .session import Session
from .v1 import scene_pb2 as pb

log = logging.getLogger("voxeld")

STREAM = "/voxeld.v1.SceneService/Stream"
BACKOFF_FIRST_S, BACKOFF_MOST_S = 0.1, 5.0
# How long waiting commits may still be sent after the last reference to the connection is gone.
ABANDONED_S = 2.0

CHANNEL_OPTIONS = [
    ("grpc.max_send_message_length", -1),
    ("grpc.max_receive_message_length", -1),
    # A new channel must not wait for the previous channel's backoff.
    ("grpc.use_local_subchannel_pool", 1),
    ("grpc.keepalive_time_ms", 20_000),
    ("grpc.keepalive_timeout_ms", 10_000),
    ("grpc.http2.write_buffer_size", 1 << 20),
]

# Retrying would bring the same answer.
_FINAL = (grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.PERMISSION_DENIED, grpc.StatusCode.UNAUTHENTICATED,
          grpc.StatusCode.UNIMPLEMENTED, grpc.StatusCode.FAILED_PRECONDITION, grpc.StatusCode.NOT_FOUND,
          grpc.StatusCode.ABORTED)  # another stream has taken the session up


def backoff_s(attempt: int, draw: Callable[[], float]) -> float:
    """Returns the pause before attempt number `attempt` (0 is the first after a loss); `draw` returns 0 to 1."""
    most = min(BACKOFF_FIRST_S * 2.0 ** min(attempt, 16), BACKOFF_MOST_S)
    return most * (0.5 + 0.5 * draw())


class Transport:
    """`on_issue` is called on a thread that does nothing else, without any lock held; it may draw and wait."""

    def __init__(self, server: str, who: Credentials, session: Session, on_issue: Callable[[Issue], None]) -> None:
        self.server = server
        self.last_error = ""
        self._credentials = who
        self._metadata = credentials.metadata(server, who)
        # Report errors of the credential files at once. Each stream reads them again.
        credentials.open_channel(server, who, CHANNEL_OPTIONS).close()
        self._session = session
        self._callbacks = Callbacks(on_issue)
        session.on_issue, session.done = self._callbacks.issue, self._callbacks.done
        # Reentrant: a signal handler or a finaliser may draw at any time.
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
        """The session's lock."""
        return self._lock

    @property
    def stopped(self) -> bool:
        """Whether nothing more will be sent."""
        return self._stopped

    def submit(self, make: Callable[[Frame], tuple[Unit, Callable[[], None]]], wait_for_room: bool) -> Frame:
        """Calls `make` under the lock with the commit's frame; it returns the commit, and a function to call, also under the
        lock, once the commit was queued. Raises BufferFull if it does not fit, unless `wait_for_room`."""
        with self._changed:
            while True:
                if self._stopped:
                    raise ConnectionLost(self.last_error or "the connection is closed")
                unit, taken = make(self._session.new_frame())
                if self._session.submit(unit):
                    taken()
                    self._changed.notify_all()
                    return unit.frame
                if not wait_for_room:
                    raise BufferFull(
                        f"{self._session.outbox.bytes} bytes wait to be sent and {unit.bytes} more are too many; "
                        "v.flush() waits for room, connect(flow='latest') drops old frames, connect(when_full='wait') blocks")
                self._changed.wait()

    def wait_until(self, ready: Callable[[], bool], timeout: Optional[float]) -> bool:
        """Waits until `ready`, which is called under the lock, returns true. Raises ConnectionLost when the connection has
        failed for good."""
        with self._changed:
            self._changed.wait_for(lambda: self._stopped or ready(), timeout)
            if ready():
                return True
            if self._stopped:
                raise ConnectionLost(self.last_error or "the connection is closed")
            return False

    def close(self, timeout: float) -> None:
        """Sends what is waiting and half-closes, within `timeout`; then ends whatever is left. May be called again."""
        end = time.monotonic() + timeout
        with self._changed:
            # Commits that wait for a reconnect may still be sent.
            self._changed.wait_for(lambda: self._stopped or self._session.open or self._session.idle(), timeout)
            self._closing = True
            if not self._session.open:
                self._stop("the connection was closed before what waited could be sent")
            self._changed.notify_all()
        self._thread.join(max(end - time.monotonic(), 0))
        with self._changed:
            self._stop("the connection was closed")
        self._thread.join(5)
        self._callbacks.drain(max(end - time.monotonic(), 1.0))

    def abandon(self, closed: Callable[[], None]) -> None:
        """Closes without waiting, as close() does, and then calls `closed`. For finalisers: it takes no lock itself."""

        def close() -> None:
            self.close(ABANDONED_S)
            closed()

        threading.Thread(target=close, name="voxeld close", daemon=True).start()

    def _stop(self, reason: str) -> None:
        if not self._stopped:
            self._stopped = True
            self.last_error = self.last_error or reason
            self._session.fail(reason)
            if self._call is not None:
                self._call.cancel()
        self._changed.notify_all()

    # ------------------------------------------------------------------------------------------------- own threads

    def _requests(self, stream: int) -> Iterator[bytes]:
        """Yields what to send, when it may be sent, on gRPC's thread. Sends nothing after Open before its answer."""
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
                    due = self._session.next_due_ns()
                    self._changed.wait(None if due is None else max(due - time.monotonic_ns(), 0) / 1e9 + 1e-4)
            yield message

    def _run(self) -> None:
        try:
            self._streams()
        except BaseException as error:
            log.exception("voxeld's thread failed")
            with self._changed:
                self._stop(f"the connection failed: {error!r}")

    def _streams(self) -> None:
        attempt = 0
        while True:
            opened_before, answered_before = self._session.streams_opened, self._session.answered
            began = time.monotonic()
            error = self._one_stream()
            with self._changed:
                self._stream += 1
                self._call = None
                self._session.lost()
                if self._closing or self._stopped:
                    self._stop("the connection was closed")
                    return
                stood = self._session.streams_opened > opened_before
                if self._session.answered > answered_before or stood and time.monotonic() - began >= BACKOFF_MOST_S:
                    attempt = 0
                self.last_error = _words(self.server, error, stood)
                code = error.code() if isinstance(error, grpc.RpcError) else None
                self._changed.notify_all()
                if code == grpc.StatusCode.NOT_FOUND and not stood and self._session.forget_token():
                    continue
                if code in _FINAL:
                    self._stop(self.last_error)
                    return
                pause = backoff_s(attempt, random.random)
                if attempt == 0 and self._session.streams_opened:
                    log.warning("%s; connecting again", self.last_error)
                attempt += 1
                self._changed.wait_for(lambda: self._stopped or self._closing, pause)
                if self._stopped or self._closing:
                    self._stop("the connection was closed")
                    return

    def _one_stream(self) -> Optional[Exception]:
        """Reads one stream until it ends."""
        try:
            channel = credentials.open_channel(self.server, self._credentials, CHANNEL_OPTIONS)
            self._metadata = credentials.metadata(self.server, self._credentials)
        except InvalidValue as error:
            return error
        try:
            stream_call: grpc.StreamStreamMultiCallable[bytes, pb.StreamResponse] = channel.stream_stream(
                STREAM, request_serializer=None, response_deserializer=pb.StreamResponse.FromString)
            with self._changed:
                if self._stopped:
                    return None
                call = self._call = stream_call(self._requests(self._stream), metadata=self._metadata)
            for response in call:
                now = time.monotonic_ns()
                with self._changed:
                    self._session.answer(response, now)
                    self._changed.notify_all()
        except grpc.RpcError as error:
            return error
        except Exception as error:  # an answer that cannot be understood ends its stream, and no more
            log.exception("an answer of voxeld at %s could not be taken", self.server)
            return error
        finally:
            channel.close()
        return None


def _words(server: str, error: Optional[Exception], stood: bool) -> str:
    if error is None:
        return f"voxeld at {server} ended the stream"
    if isinstance(error, InvalidValue):
        return f"no connection to voxeld at {server} can be made: {error}"
    if not isinstance(error, grpc.RpcError):
        return f"an answer of voxeld at {server} could not be taken: {error!r}"
    code, details = error.code(), error.details()
    if code == grpc.StatusCode.UNAVAILABLE and stood:
        return f"the connection to voxeld at {server} was lost ({details})"
    if code == grpc.StatusCode.UNAVAILABLE:
        return (f"no voxeld answers at {server} ({details}); is it running? Where it listens is said by connect('…') or "
                "VOXELD_SERVER")
    return f"voxeld at {server}: {code.name}: {details}"
