"""connect(), and the calls that can block."""
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
    """Drawing never waits; the calls below do."""

    def __enter__(self) -> "Connection":
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], error: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None:
        self.close()

    def wait_connected(self, timeout: Optional[float] = None) -> None:
        """Raises ConnectionLost if no server answers within `timeout`."""
        if not self._transport.wait_until(lambda: self._session.open, timeout):
            raise ConnectionLost(self._transport.last_error or f"no voxeld answered at {self.server} in {timeout} s")

    def flush(self, timeout: Optional[float] = None) -> None:
        """Waits until everything drawn so far has been sent; raises TimeoutError otherwise. It does not report outcomes:
        neither that the server refused a commit, nor that one was too large to be sent (max_message_bytes); frame.wait() and
        wait_shown() raise CommitRefused then."""
        if not self._transport.wait_until(self._session.idle, timeout):
            raise TimeoutError(f"after {timeout} s {self.counts['waiting_commits']} commits still wait to be sent")

    def close(self, timeout: float = 5.0) -> None:
        """Sends what is waiting, within `timeout`, and ends the session; `on_disconnect` decides what happens to its layers."""
        self._close(timeout)

    def displays(self, timeout: Optional[float] = 5.0) -> list[display_pb2.DisplayDescription]:
        return self._queries.displays(timeout)

    def stats(self, timeout: Optional[float] = 5.0) -> display_pb2.Stats:
        return self._queries.stats(timeout)

    def capture(self, display: str = "", *, at_least_snapshot: int = 0, timeout: float = 10.0) -> Volume:
        """Returns the next volume that a display shows (default: the first display), as an eye would see it; with
        `at_least_snapshot` (Accepted.snapshot) one that contains that commit."""
        return self._queries.capture(display, at_least_snapshot, timeout)

    def entities(self, layer: str = "", prefix: str = "", owner: int = 0,
                 timeout: Optional[float] = 5.0) -> list[scene_pb2.EntityInfo]:
        """Returns the scene's entities, of all owners unless `owner` is given."""
        return self._queries.entities(layer, prefix, owner, timeout)

    def layers(self, owner: int = 0, timeout: Optional[float] = 5.0) -> list[scene_pb2.LayerInfo]:
        return self._queries.layers(owner, timeout)

    def upload(self, content: Content, progress: Optional[Callable[[int, int], None]] = None, *, patience: float = 15.0) -> Asset:
        """Uploads a file (its path or its bytes) or an array of samples to the server, unless it is stored already; from then
        on shapes can name it. An interrupted upload continues, unless there is no progress for `patience` seconds. Calls
        `progress(sent, size)` after each piece."""
        return self._queries.upload(content, progress, patience)

    def watch_scene(self, layer: str = "", owner: int = 0, *, contents: bool = False,
                    timeout: Optional[float] = None) -> Watch:
        """Returns the scene's changes as they come; the first holds the whole scene. Its close() ends the call."""
        return self._queries.watch(layer, owner, contents, timeout)


def connect(server: Optional[str] = None, *, name: Optional[str] = None, timeout: float = 5.0, wait: bool = True,
            autocommit: bool = True, flow: str = "reliable", keep_frames: int = 1,
            on_disconnect: Union[str, float] = "clear", strict: bool = False, outcomes: bool = True,
            buffer_bytes: int = 256 << 20, when_full: str = "raise", owner_token: bytes = b"", resume_token: bytes = b"",
            on_issue: Optional[Callable[[Issue], None]] = None,
            credentials: Optional[Credentials] = None) -> Connection:
    """Connects to voxeld at `server`, HOST:PORT, tls:HOST:PORT or unix:PATH; the default is where voxelctl looks.

    wait           wait at most `timeout` seconds for the server's answer; else connect in the background
    flow           which frames are dropped when they come faster than they can be sent: "reliable" none, "latest" all but
                   the newest of each layer, "drop_oldest" all but the `keep_frames` newest. Retained operations always wait
    on_disconnect  what happens to the layers: "clear", "keep", or for how many seconds they linger
    strict         one refused operation refuses its whole commit
    outcomes       whether to receive displays' outcomes, besides whether commits were accepted
    buffer_bytes   how much may wait to be sent; when_full what a call does when that is exceeded: "raise" or "wait"
    owner_token    joins that owner; resume_token resumes that session, if the server still has it
    credentials    your identity, and the authorities that you trust; default: the environment's (voxeld.Credentials)
    on_issue       is called with each refused operation, on a thread of its own; by default it is logged ("voxeld")

    A lost connection is reopened without limit, at growing intervals; the session is resumed, or the scene sent again. The
    connection ends with close(), at the end of a `with`, or when nothing refers to it or one of its handles.
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
