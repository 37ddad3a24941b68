"""The asyncio client: drawing calls are the same and never wait; waiting calls are awaited.

    v = await voxeld.aio.connect()
    v.points("cloud", cloud)
    outcomes = await shown(v.commit(), timeout=1.0)
"""
from __future__ import annotations

import asyncio
from concurrent.futures import Future
from types import TracebackType
from typing import AsyncIterator, Callable, Optional, Type, Union

from .assets import Asset, Content
from .base import BaseConnection, settings
from .credentials import Credentials
from .errors import ConnectionLost
from .handles import FrameBlock
from .queries import ChangeSet
from .receipts import Frame, Issue, Outcome
from .v1 import display_pb2, scene_pb2
from .volumes import Volume


async def _within(future: "Future[Frame]", timeout: Optional[float]) -> Frame:
    return await asyncio.wait_for(asyncio.wrap_future(future), timeout)


async def accepted(frame: Union[Frame, FrameBlock], timeout: Optional[float] = None) -> Frame:
    """Waits until the commit is answered. Raises as Frame.wait() does, or asyncio.TimeoutError."""
    ticket = frame if isinstance(frame, Frame) else frame.ticket
    return (await _within(ticket.future(), timeout)).raise_if_failed()


async def shown(frame: Union[Frame, FrameBlock], timeout: Optional[float] = None) -> dict[str, Outcome]:
    """Waits until every display has reported the commit's outcome; returns the outcomes by display name."""
    ticket = frame if isinstance(frame, Frame) else frame.ticket
    return (await _within(ticket.future(shown=True), timeout)).raise_if_failed().outcomes


class Connection(BaseConnection):
    async def __aenter__(self) -> "Connection":
        return self

    async def __aexit__(self, kind: Optional[Type[BaseException]], error: Optional[BaseException],
                        trace: Optional[TracebackType]) -> None:
        await self.close()

    async def wait_connected(self, timeout: Optional[float] = None) -> None:
        if not await asyncio.to_thread(self._transport.wait_until, lambda: self._session.open, timeout):
            raise ConnectionLost(self._transport.last_error or f"no voxeld answered at {self.server} in {timeout} s")

    async def flush(self, timeout: Optional[float] = None) -> None:
        """As voxeld.Connection.flush: waits until everything has been sent, whatever the outcome."""
        if not await asyncio.to_thread(self._transport.wait_until, self._session.idle, timeout):
            raise asyncio.TimeoutError(f"after {timeout} s {self.counts['waiting_commits']} commits still wait to be sent")

    async def close(self, timeout: float = 5.0) -> None:
        await asyncio.to_thread(self._close, timeout)

    async def displays(self, timeout: Optional[float] = 5.0) -> list[display_pb2.DisplayDescription]:
        return await asyncio.to_thread(self._queries.displays, timeout)

    async def stats(self, timeout: Optional[float] = 5.0) -> display_pb2.Stats:
        return await asyncio.to_thread(self._queries.stats, timeout)

    async def capture(self, display: str = "", *, at_least_snapshot: int = 0, timeout: float = 10.0) -> Volume:
        return await asyncio.to_thread(self._queries.capture, display, at_least_snapshot, timeout)

    async def entities(self, layer: str = "", prefix: str = "", owner: int = 0,
                       timeout: Optional[float] = 5.0) -> list[scene_pb2.EntityInfo]:
        return await asyncio.to_thread(self._queries.entities, layer, prefix, owner, timeout)

    async def layers(self, owner: int = 0, timeout: Optional[float] = 5.0) -> list[scene_pb2.LayerInfo]:
        return await asyncio.to_thread(self._queries.layers, owner, timeout)

    async def upload(self, content: Content, progress: Optional[Callable[[int, int], None]] = None, *,
                     patience: float = 15.0) -> Asset:
        """As Connection.upload(); `progress` is called on another thread."""
        return await asyncio.to_thread(self._queries.upload, content, progress, patience)

    async def watch_scene(self, layer: str = "", owner: int = 0, *, contents: bool = False,
                          timeout: Optional[float] = None) -> AsyncIterator[ChangeSet]:
        """Yields the scene's changes as they come; the first holds the whole scene. For `async for`; leaving the loop ends the
        call."""
        changes = self._queries.watch(layer, owner, contents, timeout)
        try:
            while (change := await asyncio.to_thread(changes.next)) is not None:
                yield change
        finally:
            changes.close()


async def connect(server: Optional[str] = None, *, name: Optional[str] = None, timeout: float = 5.0, wait: bool = True,
                  autocommit: bool = True, flow: str = "reliable", keep_frames: int = 1,
                  on_disconnect: Union[str, float] = "clear", strict: bool = False, outcomes: bool = True,
                  buffer_bytes: int = 256 << 20, owner_token: bytes = b"", resume_token: bytes = b"",
                  on_issue: Optional[Callable[[Issue], None]] = None,
                  credentials: Optional[Credentials] = None) -> Connection:
    """As voxeld.connect(). A full buffer raises BufferFull; flush() waits for room."""
    options = settings(name, flow, keep_frames, on_disconnect, strict, outcomes, buffer_bytes, owner_token, resume_token)
    connection = Connection(server, options, autocommit, "raise", on_issue, credentials)
    if wait:
        try:
            await connection.wait_connected(timeout)
        except BaseException:
            await connection.close(0)
            raise
    return connection
