"""A connection as far as nothing blocks: drawing, layers, commits. connection.py and aio.py add what waits."""
from __future__ import annotations

import logging
import os
import sys
import threading
import time
from contextlib import contextmanager
from typing import Any, Callable, Iterator, Optional, Sequence, Union

import numpy.typing as npt

from . import address, operations, picture, transforms, wire
from .draw import Draw, Look, Make, checked_name
from .errors import InvalidValue, VoxelError
from .handles import FrameBlock, Handle, Layer, ObjectBlock, put_parts
from .queries import Queries
from .receipts import Frame, Issue
from .session import FLOWS, Session, Settings
from .transforms import Matrix
from .transport import Transport
from .v1 import scene_pb2 as pb

log = logging.getLogger("voxeld")

DEFAULT_LAYER = "main"


def settings(name: Optional[str], flow: str, keep_frames: int, on_disconnect: Union[str, float], strict: bool,
             outcomes: bool, buffer_bytes: int, owner_token: bytes, resume_token: bytes) -> Settings:
    """Checked."""
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
    """What is drawn on the connection itself lands in the layer "main".

    Any thread may draw. Autocommit: outside of `with v.batch()`, every call is a commit of its own (a frame or an object
    is one call, made at the end of its `with`). With `autocommit` off nothing takes effect until commit().
    """

    def __init__(self, server: Optional[str], options: Settings, autocommit: bool, when_full: str,
                 on_issue: Optional[Callable[[Issue], None]]) -> None:
        if when_full not in ("raise", "wait"):
            raise InvalidValue(f"when_full is {when_full!r}; give 'raise' or 'wait'")
        self.server = address.choose(server)
        self.autocommit = autocommit
        self._waits = when_full == "wait"
        self._staging = threading.Lock()
        self._local = threading.local()
        self._staged: list[operations.Operation] = []
        self._pieces: dict[tuple[str, str], int] = {}  # how many a name stands for, if not one
        self._session = Session(options)
        self._transport = Transport(self.server, self._session, on_issue or (lambda issue: log.warning("%s", issue)))
        self._queries = Queries(self.server)

    def __repr__(self) -> str:
        state = "connected" if self.connected else "not connected"
        return f"<voxeld {self.server}, {state}, {self._session.book.counts['commits']} commits>"

    # ---------------------------------------------------------------------------------------------------- drawing

    def _draw(self, name: str, make: Make, args: tuple[Any, ...], options: dict[str, Any], look: Look) -> Handle:
        return Handle(self, DEFAULT_LAYER, checked_name(name, "name"), make, args, options, look)._put()

    def layer(self, name: str, *, visible: Optional[bool] = None, opacity: Optional[float] = None,
              order: Optional[int] = None, blend: Optional[str] = None, transform: Optional[npt.ArrayLike] = None,
              clip: Optional[Sequence[npt.ArrayLike]] = None,
              region: Optional[tuple[npt.ArrayLike, npt.ArrayLike]] = None, mask: Optional[str] = None) -> Layer:
        """The layer of that name, to draw in; it is made when it is first drawn in or set. See Layer.set()."""
        layer = Layer(self, name)
        given = (visible, opacity, order, blend, transform, clip, region, mask)
        if any(value is not None for value in given):
            layer.set(visible=visible, opacity=opacity, order=order, blend=blend, transform=transform, clip=clip,
                      region=region, mask=mask)
        return layer

    def frame(self, layer: str = DEFAULT_LAYER, *, present_in: Optional[float] = None, must_show: bool = False) -> FrameBlock:
        """`with v.frame("layer") as f: f.points(…)`: replaces what the layer held, whole."""
        return FrameBlock(self, layer, present_in, must_show)

    def object(self, name: str) -> ObjectBlock:
        """`with v.object("wheel") as o: o.cylinder(…)`; then v.instance("left", "wheel", transform=…)."""
        return ObjectBlock(self, name)

    def remove_object(self, name: str, *, cascade: bool = False) -> Optional[Frame]:
        """`cascade`: its instances too; else having some is an issue."""
        return self._stage([operations.undefine(checked_name(name, "object"), cascade)])

    def clear(self, layer: Optional[str] = None) -> Optional[Frame]:
        """Takes out everything of this connection's, or of one layer."""
        with self._staging:
            self._forget_pieces(layer)
        return self._stage([operations.clear_all() if layer is None else operations.clear_layer(layer)])

    # --------------------------------------------------------------------------------------------------- commits

    @contextmanager
    def batch(self, *, present_in: Optional[float] = None, must_show: bool = False) -> Iterator[list[Frame]]:
        """This thread's calls within take effect together, at the end: one commit, whose Frame is then in the list that
        the `with` gives. If the block raises, none does. Inside another batch it is part of that one."""
        if self._batched() is not None:
            yield []
            return
        with self._staging:
            pieces = dict(self._pieces)
        operations_: list[operations.Operation] = []
        frames: list[Frame] = []
        self._local.batch = operations_
        try:
            yield frames
        except BaseException:
            with self._staging:
                self._pieces = pieces
            raise
        finally:
            self._local.batch = None
        frame = self._stage(operations_, present_in, must_show)
        if frame is not None:
            frames.append(frame)

    def _batched(self) -> Optional[list[operations.Operation]]:
        batch: Optional[list[operations.Operation]] = getattr(self._local, "batch", None)
        return batch

    def commit(self, *, present_in: Optional[float] = None, present_at_ns: int = 0, must_show: bool = False) -> Frame:
        """Everything drawn since the last one takes effect together. Without anything drawn it tells when all that came
        before has been shown. `present_in`: seconds from now until it is to be shown; `present_at_ns`: when, by the
        server's monotonic clock. `must_show`: later commits wait until the displays have shown this one."""
        if self._batched() is not None:
            raise InvalidValue("commit() within v.batch(): a batch is committed at its end")
        with self._staging:
            staged, self._staged = self._staged, []
        try:
            return self._submit(staged, present_in, present_at_ns, must_show)
        except VoxelError:
            with self._staging:
                self._staged = staged + self._staged  # to be tried again
            raise

    def _submit(self, staged: Sequence[operations.Operation], present_in: Optional[float], present_at_ns: int,
                must_show: bool) -> Frame:
        options = pb.Commit(present_at_ns=present_at_ns, must_show=must_show)
        if present_in is not None:
            options.present_at_ns = self.server_time_ns() + int(present_in * 1e9)
        return self._transport.submit(lambda frame: operations.Unit(frame, staged, options), self._waits)

    def _stage(self, added: Sequence[operations.Operation], present_in: Optional[float] = None,
               must_show: bool = False) -> Optional[Frame]:
        batch = self._batched()
        if batch is not None:
            batch += added
        elif self.autocommit:
            return self._submit(added, present_in, 0, must_show)
        else:
            with self._staging:
                self._staged += added
        return None

    def _put(self, layer: str, name: str, shape: Sequence[wire.Packed], look: Look) -> Optional[Frame]:
        puts = put_parts(layer, name, shape, look)
        stay = {put.id for put in puts.puts}
        with self._staging:
            gone = [operations.delete_id(layer, id) for id in self._ids(layer, name) if id not in stay]
            self._count(layer, name, len(shape))
        return self._stage([*gone, puts])

    def _immediate(self, layer: str, puts: Sequence[tuple[str, operations.Puts]], present_in: Optional[float],
                   must_show: bool) -> Optional[Frame]:
        with self._staging:
            self._forget_pieces(layer)
            for name, one in puts:
                self._count(layer, name, len(one.puts))
        return self._stage([operations.Immediate(layer, [one for _, one in puts])], present_in, must_show)

    def _move(self, layer: str, name: str, matrix: Matrix) -> Optional[Frame]:
        numbers = list(transforms.to_wire(matrix).m)
        with self._staging:
            ids = self._ids(layer, name)
        return self._stage([operations.move(layer, id, numbers) for id in ids])

    def _remove(self, layer: str, name: str) -> Optional[Frame]:
        with self._staging:
            ids = self._ids(layer, name)
            self._count(layer, name, 1)
        return self._stage([operations.delete_id(layer, id) for id in ids])

    def _define(self, name: str, parts: Sequence[wire.Packed]) -> Optional[Frame]:
        definition = operations.define(name, parts)
        info = self._session.info
        most = info.limits.max_message_bytes if info is not None else 0
        if most and definition.size() > most:
            raise InvalidValue(
                f"the object {name!r} has {definition.size()} bytes and the server takes {most}; make several")
        return self._stage([definition])

    def _forget_pieces(self, layer: Optional[str]) -> None:
        self._pieces = {k: n for k, n in self._pieces.items() if layer is not None and k[0] != layer}

    def _ids(self, layer: str, name: str) -> list[str]:
        pieces = self._pieces.get((layer, name), 1)
        return [name] if pieces == 1 else [f"{name}/{i}" for i in range(pieces)]

    def _count(self, layer: str, name: str, pieces: int) -> None:
        if pieces == 1:
            self._pieces.pop((layer, name), None)
        else:
            self._pieces[layer, name] = pieces

    # ------------------------------------------------------------------------------------------------- what is so

    @property
    def connected(self) -> bool:
        return self._session.open

    @property
    def info(self) -> pb.Opened:
        """What the server said when the stream was opened: session, displays, limits."""
        if self._session.info is None:
            raise VoxelError(f"not connected to {self.server} yet")
        return self._session.info

    @property
    def resume_token(self) -> bytes:
        """By which connect() can take up this session after this process. Each new stream has a new one."""
        return self._session.resume_token

    @property
    def owner_token(self) -> bytes:
        """By which other connections may share this one's objects."""
        return self.info.owner_token

    @property
    def issues(self) -> list[Issue]:
        """The last 100."""
        return list(self._session.book.recent_issues)

    @property
    def counts(self) -> dict[str, int]:
        """Sums since connect(): commits and what became of them, what was dropped here (client_drops) and there
        (server_drops), and what waits."""
        with self._transport.lock:
            session = self._session
            return {**session.book.counts, "client_drops": session.outbox.dropped_frames,
                    "merged_operations": session.outbox.merged_operations, "waiting_commits": len(session.outbox),
                    "waiting_bytes": session.outbox.bytes, "streams_opened": session.streams_opened,
                    "resumed": session.resumed}

    def server_time_ns(self) -> int:
        """The server's monotonic clock, now, by the last pings. VoxelError before the first answer."""
        now = time.monotonic_ns()
        with self._transport.lock:
            offset = self._session.clock.offset_ns(now)
        if offset is None:
            raise VoxelError("the server's clock is not known yet: it answers no pings, or none has come back; try again")
        return now + offset

    @property
    def clock_error_ns(self) -> Optional[int]:
        """server_time_ns() is right to ± this; None: not known."""
        with self._transport.lock:
            return self._session.clock.error_ns(time.monotonic_ns())

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        """For notebooks: what the first display shows."""
        bundle: dict[str, Any] = {"text/plain": repr(self)}
        try:
            bundle["image/png"] = picture.png(self._queries.capture(timeout=5.0).picture())
        except VoxelError as error:
            bundle["text/plain"] = f"{self!r}\n(no picture: {error})"
        return bundle
