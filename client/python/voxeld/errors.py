"""What can go wrong, as exceptions. Every message says what was wrong, the value, and what would be right."""
from __future__ import annotations

from typing import TYPE_CHECKING, Sequence

if TYPE_CHECKING:
    from .receipts import Issue


class VoxelError(Exception):
    """All of the below."""


class InvalidArray(VoxelError, ValueError):
    """An array's shape, element type or values."""


class InvalidColor(VoxelError, ValueError):
    """A colour that is none."""


class InvalidValue(VoxelError, ValueError):
    """Any other argument."""


class InvalidOption(InvalidValue, TypeError):
    """An argument that a call does not have."""


class ConnectionLost(VoxelError, ConnectionError):
    """There is no connection, and none will come; or what was sent on it is lost."""


class BufferFull(VoxelError, BufferError):
    """More waits to be sent than may; nothing of this call was taken."""


class CommitRefused(VoxelError):
    """The server refused a commit; `issues` says why."""

    def __init__(self, message: str, issues: Sequence[Issue] = ()) -> None:
        super().__init__(message)
        self.issues = tuple(issues)


class NotDurable(VoxelError):
    """The commit was carried out, and will not be on the server's disk; `issues` says why."""

    def __init__(self, message: str, issues: Sequence[Issue] = ()) -> None:
        super().__init__(message)
        self.issues = tuple(issues)


class CommitDropped(VoxelError):
    """The flow policy gave up the commit before it was sent; the connection counts it in `client_drops`."""
