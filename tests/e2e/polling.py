"""Waits for events that nothing signals, by querying the state of another program repeatedly."""
import time
from typing import Callable, TypeVar

LONG = 60.0
Found = TypeVar("Found")


def until(right: Callable[[], Found], what: str, patience: float = LONG) -> Found:
    """Returns the first answer that is true; the time of the query itself is not limited."""
    deadline = time.monotonic() + patience
    while not (found := right()):
        if time.monotonic() > deadline:
            raise AssertionError(f"not in {patience:.0f} s: {what}")
        time.sleep(0.01)
    return found
