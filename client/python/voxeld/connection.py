"""connect(), and the calls that wait when asked to."""
from __future__ import annotations

from types import TracebackType
from typing import Callable, Optional, Type, Union

from .assets import Asset, Content
from .base import BaseConnection, settings
from .credentials import Credentials
from .errors import ConnectionLost
from .queries import Watch
from .receipts import Issue
from .v1 import display_pb2, scene_pb2
from .volumes import Volume

class Connection(BaseConnection):
    """Drawing never waits; what is below does."""

    def __enter__(self) -> "Connection":
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], error: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None:
        self.close()

    def wait_connected(self, timeout: Optional[float] = None) -> None:
        """Raises ConnectionLost if nobody answers within `timeout`."""
        if not self._transport.wait_until(lambda: self._session.open, timeout):
            raise ConnectionLost(self._transport.last_error or f"no voxeld answered at {self.server} in {timeout} s")

    def flush(self, timeout: Optional[float] = None) -> None:
        """Until everything drawn so far has been sent. TimeoutError if it was not. What became of it is not told here: not that
        the server refused it, nor that it was too large to be sent (max_message_bytes); frame.wait() and wait_shown() raise
        CommitRefused then."""
        if not self._transport.wait_until(self._session.idle, timeout):
            raise TimeoutError(f"after {timeout} s {self.counts['waiting_commits']} commits still wait to be sent")

    def close(self, timeout: float = 5.0) -> None:
        """Sends what waits, within `timeout`, and ends the session; what becomes of its layers is `on_disconnect`."""
        self._close(timeout)

    def displays(self, timeout: Optional[float] = 5.0) -> list[display_pb2.DisplayDescription]:
        return self._queries.displays(timeout)

    def stats(self, timeout: Optional[float] = 5.0) -> display_pb2.Stats:
        return self._queries.stats(timeout)

    def capture(self, display: str = "", *, at_least_snapshot: int = 0, timeout: float = 10.0) -> Volume:
        """The next volume that a display shows (default: the first display), as an eye would see it; with
        `at_least_snapshot` (Accepted.snapshot) one that has that commit in it."""
        return self._queries.capture(display, at_least_snapshot, timeout)

    def entities(self, layer: str = "", prefix: str = "", owner: int = 0,
                 timeout: Optional[float] = 5.0) -> list[scene_pb2.EntityInfo]:
        """What is in the scene, of everybody unless `owner` is given."""
        return self._queries.entities(layer, prefix, owner, timeout)

    def layers(self, owner: int = 0, timeout: Optional[float] = 5.0) -> list[scene_pb2.LayerInfo]:
        return self._queries.layers(owner, timeout)

    def upload(self, content: Content, progress: Optional[Callable[[int, int], None]] = None, *, patience: float = 15.0) -> Asset:
        """Brings a file (its path or its bytes) or an array of samples to the server, unless it has that already; shapes name it
        from then on. What breaks off goes on, unless nothing more is there after `patience` seconds. `progress(sent, size)` after
        each piece."""
        return self._queries.upload(content, progress, patience)

    def watch_scene(self, layer: str = "", owner: int = 0, *, contents: bool = False,
                    timeout: Optional[float] = None) -> Watch:
        """The scene's changes as they come; the first has all there is. Its close() ends it."""
        return self._queries.watch(layer, owner, contents, timeout)


def connect(server: Optional[str] = None, *, name: Optional[str] = None, timeout: float = 5.0, wait: bool = True,
            autocommit: bool = True, flow: str = "reliable", keep_frames: int = 1,
            on_disconnect: Union[str, float] = "clear", strict: bool = False, outcomes: bool = True,
            buffer_bytes: int = 256 << 20, when_full: str = "raise", owner_token: bytes = b"", resume_token: bytes = b"",
            on_issue: Optional[Callable[[Issue], None]] = None,
            credentials: Optional[Credentials] = None) -> Connection:
    """Connects to voxeld at `server`, HOST:PORT, tls:HOST:PORT or unix:PATH; by default where voxelctl looks.

    wait           until the server has answered, at most `timeout` seconds; else it is tried in the background
    flow           which frames are given up when they come faster than they go: "reliable" none, "latest" all but the
                   newest of each layer, "drop_oldest" all but the `keep_frames` newest. What is retained always waits
    on_disconnect  what becomes of the layers: "clear", "keep", or for how many seconds they linger
    strict         one refused operation refuses its whole commit
    outcomes       whether displays' outcomes are wanted, beside whether commits were accepted
    buffer_bytes   how much may wait to be sent, and when_full what a call does when it is too much: "raise" or "wait"
    owner_token    joins that owner; resume_token takes up that session, if the server knows it still
    credentials    who you are, and whom you trust; by default what the environment says (voxeld.Credentials)
    on_issue       is called with each refused operation, on a thread of its own; by default it is logged ("voxeld")

    A lost connection is tried again for ever, at growing intervals; the session is resumed, or the scene sent anew. It is
    closed by close(), at the end of a `with`, or when nothing holds it or one of its handles any more.
    """
    options = settings(name, flow, keep_frames, on_disconnect, strict, outcomes, buffer_bytes, owner_token, resume_token)
    connection = Connection(server, options, autocommit, when_full, on_issue, credentials)
    if wait:
        try:
            connection.wait_connected(timeout)
        except BaseException:
            connection.close(0)
            raise
    return connection
