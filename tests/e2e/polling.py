"""Waiting for what nothing tells: another program's state, asked for again and again."""
import time
from typing import Callable, TypeVar

LONG = 60.0
Found = TypeVar("Found")


def until(right: Callable[[], Found], what: str, patience: float = LONG) -> Found:
    """The first answer that is true; what is asked takes its own time."""
    deadline = time.monotonic() + patience
    while not (found := right()):
        if time.monotonic() > deadline:
            raise AssertionError(f"not in {patience:.0f} s: {what}")
        time.sleep(0.01)
    return found
