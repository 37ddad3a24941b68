"""The exceptions of this package. Every message says what was wrong, the value, and what is expected."""
from __future__ import annotations

from typing import TYPE_CHECKING, Sequence

if TYPE_CHECKING:
    from .receipts import Issue


class VoxelError(Exception):
    """The base class of all exceptions below."""


class InvalidArray(VoxelError, ValueError):
    """An invalid shape, element type or value of an array."""


class InvalidColor(VoxelError, ValueError):
    """An invalid colour."""


class InvalidValue(VoxelError, ValueError):
    """Any other invalid argument."""


class InvalidOption(InvalidValue, TypeError):
    """An argument that a call does not have."""


class ConnectionLost(VoxelError, ConnectionError):
    """The connection failed for good, or something sent on it is lost."""


class BufferFull(VoxelError, BufferError):
    """Too much is waiting to be sent; nothing of this call was accepted."""


class CommitRefused(VoxelError):
    """The server refused a commit; `issues` says why."""

    def __init__(self, message: str, issues: Sequence[Issue] = ()) -> None:
        super().__init__(message)
        self.issues = tuple(issues)


class NotDurable(VoxelError):
    """The commit was carried out, but will not be on the server's disk; `issues` says why."""

    def __init__(self, message: str, issues: Sequence[Issue] = ()) -> None:
        super().__init__(message)
        self.issues = tuple(issues)


class CommitDropped(VoxelError):
    """The flow policy dropped the commit before it was sent; the connection counts it in `client_drops`."""
