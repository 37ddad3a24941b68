"""The non-blocking part of a connection: drawing, layers, commits. connection.py and aio.py add the calls that wait."""
from __future__ import annotations

import atexit
import logging
import os
import sys
import threading
import time
import weakref
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Callable, Iterator, Mapping, Optional, Sequence, Union

import numpy.typing as npt

from . import address, operations, picture, transforms
from .credentials import Credentials
from .clip import ClipPart
from .draw import Draw, Look, Make, checked_name
from .errors import InvalidValue, VoxelError
from .handles import FrameBlock, Handle, Layer, ObjectBlock
from .pieces import Draft, Pieces
from .queries import Queries
from .receipts import Frame, Issue
from .session import FLOWS, Session, Settings
from .transforms import Matrix
from .transport import Transport
from .v1 import scene_pb2 as pb

log = logging.getLogger("voxeld")

DEFAULT_LAYER = "main"

# Makes a call's operations when its turn has come, because only then the existing pieces are known.
Step = Callable[[Draft], Sequence[operations.Operation]]


class _Batch:
    def __init__(self, connection: "BaseConnection") -> None:
        self.connection: Optional[BaseConnection] = connection  # None: it is at its end
        self.steps: list[Step] = []


# Batches of this thread or task, the innermost last. A task that is created within a batch draws in it while it lasts.
_batches: ContextVar[tuple[_Batch, ...]] = ContextVar("voxeld_batches", default=())

_transports: set[Transport] = set()


@atexit.register
def _close_all() -> None:
    for transport in list(_transports):
        transport.close(2.0)


def settings(name: Optional[str], flow: str, keep_frames: int, on_disconnect: Union[str, float], strict: bool,
             outcomes: bool, buffer_bytes: int, owner_token: bytes, resume_token: bytes) -> Settings:
    """Returns the settings, after checking them."""
    if flow not in FLOWS:
        raise InvalidValue(f"flow is {flow!r}; give one of {', '.join(map(repr, FLOWS))}")
    if not (isinstance(keep_frames, int) and keep_frames >= 1):
        raise InvalidValue(f"keep_frames is {keep_frames!r}; give a whole number from 1")
    if isinstance(on_disconnect, str) and on_disconnect not in ("clear", "keep") or (
            not isinstance(on_disconnect, str) and not on_disconnect >= 0):
        raise InvalidValue(f"on_disconnect is {on_disconnect!r}; give 'clear', 'keep' or for how many seconds layers linger")
    if buffer_bytes < 1 << 20:
        raise InvalidValue(f"buffer_bytes is {buffer_bytes}; give at least {1 << 20}")
    label = name if name is not None else os.path.basename(sys.argv[0]) or "python"
    return Settings(label.encode()[:128].decode(errors="ignore"), on_disconnect, strict, flow, keep_frames, outcomes,
                    owner_token, resume_token, buffer_bytes, time.time_ns() // 1000 if resume_token else 1)


class BaseConnection(Draw[Handle]):
    """Drawing calls on the connection itself draw in the layer "main".

    Any thread may draw. Autocommit: outside of `with v.batch()`, every call is a commit of its own (a frame or an object
    counts as one call, made at the end of its `with`). With `autocommit` off nothing takes effect until commit().
    """

    def __init__(self, server: Optional[str], options: Settings, autocommit: bool, when_full: str,
                 on_issue: Optional[Callable[[Issue], None]], credentials: Optional[Credentials]) -> None:
        if when_full not in ("raise", "wait"):
            raise InvalidValue(f"when_full is {when_full!r}; give 'raise' or 'wait'")
        self.server = address.choose(server)
        self.autocommit = autocommit
        self._waits = when_full == "wait"
        self._staging = threading.Lock()
        self._staged: list[Step] = []
        self._pieces = Pieces()  # under the transport's lock
        self._session = Session(options)
        who = Credentials.from_environment() if credentials is None else credentials
        self._transport = Transport(self.server, who, self._session, on_issue or (lambda issue: log.warning("%s", issue)))
        self._queries = Queries(self.server, who)
        _transports.add(self._transport)
        # Otherwise its threads would continue, and its drawings would stay visible.
        self._abandoned = weakref.finalize(self, _abandon, self._transport, self._queries)
        self._abandoned.atexit = False

    def _close(self, timeout: float) -> None:
        self._abandoned.detach()
        self._transport.close(timeout)
        _transports.discard(self._transport)
        self._queries.close()

    def __repr__(self) -> str:
        state = "connected" if self.connected else "not connected"
        return f"<voxeld {self.server}, {state}, {self._session.book.counts['commits']} commits>"

    # ---------------------------------------------------------------------------------------------------- drawing

    def _draw(self, name: str, make: Make, args: tuple[Any, ...], options: dict[str, Any], look: Look) -> Handle:
        return Handle(self, DEFAULT_LAYER, checked_name(name, "name"), make, args, options, look)._put()

    def layer(self, name: str, *, visible: Optional[bool] = None, opacity: Optional[float] = None,
              order: Optional[int] = None, blend: Optional[str] = None, transform: Optional[npt.ArrayLike] = None,
              clip: Optional[Sequence[ClipPart]] = None,
              region: Optional[tuple[npt.ArrayLike, npt.ArrayLike]] = None, mask: Optional[str] = None) -> Layer:
        """Returns the layer of that name, to draw in; it is created when first drawn in or set. See Layer.set()."""
        layer = Layer(self, name)
        given = (visible, opacity, order, blend, transform, clip, region, mask)
        if any(value is not None for value in given):
            layer.set(visible=visible, opacity=opacity, order=order, blend=blend, transform=transform, clip=clip,
                      region=region, mask=mask)
        return layer

    def frame(self, layer: str = DEFAULT_LAYER, *, present_in: Optional[float] = None, must_show: bool = False) -> FrameBlock:
        """`with v.frame("layer") as f: f.points(…)`: replaces everything that the layer held."""
        return FrameBlock(self, layer, present_in, must_show)

    def object(self, name: str) -> ObjectBlock:
        """`with v.object("wheel") as o: o.cylinder(…)`; then v.instance("left", "wheel", transform=…)."""
        return ObjectBlock(self, name)

    def remove_object(self, name: str, *, cascade: bool = False) -> Optional[Frame]:
        """`cascade` removes the object's instances too; otherwise existing instances are an issue."""
        return self._stage_ready([operations.undefine(checked_name(name, "object"), cascade)])

    def clear(self, layer: Optional[str] = None) -> Optional[Frame]:
        """Removes everything of this connection, or of one layer."""
        clear = operations.clear_all() if layer is None else operations.clear_layer(layer)

        def step(draft: Draft) -> Sequence[operations.Operation]:
            draft.clear(layer)
            return [clear]

        return self._stage(step)

    # --------------------------------------------------------------------------------------------------- commits

    @contextmanager
    def batch(self, *, present_in: Optional[float] = None, must_show: bool = False) -> Iterator[list[Frame]]:
        """The calls inside, of this thread or asyncio task, take effect together at the end, as one commit, whose Frame is
        then in the list that the `with` yields. If the block raises, none takes effect. Inside another batch it becomes part
        of that one."""
        if self._batched() is not None:
            yield []
            return
        batch = _Batch(self)
        frames: list[Frame] = []
        _batches.set((*_batches.get(), batch))
        try:
            yield frames
        finally:
            batch.connection = None
            _batches.set(tuple(one for one in _batches.get() if one is not batch))
        frame = self._stage(lambda draft: _all(batch.steps, draft), present_in, must_show)
        if frame is not None:
            frames.append(frame)

    def _batched(self) -> Optional[_Batch]:
        for batch in _batches.get():
            if batch.connection is self:
                return batch
        return None

    def commit(self, *, present_in: Optional[float] = None, present_at_ns: int = 0, must_show: bool = False,
               durable: bool = False) -> Frame:
        """Commits everything drawn since the last commit; it takes effect together. If nothing was drawn, the Frame reports
        when all earlier commits have been shown. `present_in`: seconds from now until it should be shown; `present_at_ns`:
        when, by the server's monotonic clock. `must_show`: later commits wait until the displays have shown this one.
        `durable`: frame.wait_durable() then waits until it is on the server's disk."""
        if self._batched() is not None:
            raise InvalidValue("commit() within v.batch(): a batch is committed at its end")
        with self._staging:
            staged, self._staged = self._staged, []
        try:
            return self._submit(lambda draft: _all(staged, draft), present_in, present_at_ns, must_show, durable)
        except VoxelError:
            with self._staging:
                self._staged = staged + self._staged  # to be tried again
            raise

    def _submit(self, step: Step, present_in: Optional[float], present_at_ns: int, must_show: bool,
                durable: bool = False) -> Frame:
        options = pb.Commit(present_at_ns=present_at_ns, must_show=must_show, durable=durable)
        if present_in is not None:
            options.present_at_ns = self.server_time_ns() + int(present_in * 1e9)

        def make(frame: Frame) -> tuple[operations.Unit, Callable[[], None]]:
            draft = self._pieces.draft()
            unit = operations.Unit(frame, step(draft), options)

            def taken() -> None:
                unit.on_accepted = draft.keep()

            return unit, taken

        return self._transport.submit(make, self._waits)

    def _stage(self, step: Step, present_in: Optional[float] = None, must_show: bool = False) -> Optional[Frame]:
        batch = self._batched()
        if batch is not None:
            batch.steps.append(step)
        elif self.autocommit:
            return self._submit(step, present_in, 0, must_show)
        else:
            with self._staging:
                self._staged.append(step)
        return None

    def _stage_ready(self, ready: Sequence[operations.Operation]) -> Optional[Frame]:
        return self._stage(lambda draft: ready)

    def _put(self, layer: str, name: str, puts: operations.Puts) -> Optional[Frame]:
        return self._stage(lambda draft: [
            *(operations.delete_id(layer, id) for id in draft.put(layer, name, len(puts.puts))), puts])

    def _immediate(self, layer: str, puts: Mapping[str, operations.Puts], present_in: Optional[float],
                   must_show: bool) -> Optional[Frame]:
        def step(draft: Draft) -> Sequence[operations.Operation]:
            draft.clear(layer)
            for name, one in puts.items():
                draft.put(layer, name, len(one.puts))
            return [operations.Immediate(layer, list(puts.values()))]

        return self._stage(step, present_in, must_show)

    def _move(self, layer: str, name: str, matrix: Matrix) -> Optional[Frame]:
        numbers = list(transforms.to_wire(matrix).m)
        return self._stage(lambda draft: [operations.move(layer, id, numbers) for id in draft.now(layer, name)])

    def _remove(self, layer: str, name: str) -> Optional[Frame]:
        return self._stage(lambda draft: [operations.delete_id(layer, id) for id in draft.remove(layer, name)])

    # ------------------------------------------------------------------------------------------------------- state

    @property
    def connected(self) -> bool:
        return self._session.open

    @property
    def info(self) -> pb.Opened:
        """The server's description from when the stream was opened: session, displays, limits."""
        if self._session.info is None:
            raise VoxelError(f"not connected to {self.server} yet")
        return self._session.info

    @property
    def resume_token(self) -> bytes:
        """Token with which connect() can resume this session after this process has ended. Each new stream has a new one."""
        return self._session.resume_token

    @property
    def owner_token(self) -> bytes:
        """Token with which other connections can share this one's objects."""
        return self.info.owner_token

    @property
    def issues(self) -> list[Issue]:
        """The last 100 issues."""
        return list(self._session.book.recent_issues)

    @property
    def counts(self) -> dict[str, int]:
        """Totals since connect(): commits and their outcomes, drops by the client (client_drops) and by the server
        (server_drops), and what is waiting."""
        with self._transport.lock:
            session = self._session
            return {**session.book.counts, "client_drops": session.outbox.dropped_frames,
                    "merged_operations": session.outbox.merged_operations, "waiting_commits": len(session.outbox),
                    "waiting_bytes": session.outbox.bytes, "streams_opened": session.streams_opened,
                    "resumed": session.resumed, "restored": session.restored}

    def server_time_ns(self) -> int:
        """Returns the current time of the server's monotonic clock, by the last pings. Raises VoxelError before the first
        answer."""
        now = time.monotonic_ns()
        with self._transport.lock:
            offset = self._session.clock.offset_ns(now)
        if offset is None:
            raise VoxelError("the server's clock is not known yet: it answers no pings, or none has come back; try again")
        return now + offset

    @property
    def clock_error_ns(self) -> Optional[int]:
        """server_time_ns() is accurate to ± this; None: unknown."""
        with self._transport.lock:
            return self._session.clock.error_ns(time.monotonic_ns())

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        """Shows the first display's volume in notebooks."""
        bundle: dict[str, Any] = {"text/plain": repr(self)}
        try:
            bundle["image/png"] = picture.png(self._queries.capture(timeout=5.0).picture())
        except VoxelError as error:
            bundle["text/plain"] = f"{self!r}\n(no picture: {error})"
        return bundle


def _all(steps: Sequence[Step], draft: Draft) -> Sequence[operations.Operation]:
    return [operation for step in steps for operation in step(draft)]


def _abandon(transport: Transport, queries: Queries) -> None:
    # Runs on any thread at any time; perhaps at interpreter exit, when all connections are closed already.
    def closed() -> None:
        queries.close()
        _transports.discard(transport)

    if not transport.stopped:
        transport.abandon(closed)
