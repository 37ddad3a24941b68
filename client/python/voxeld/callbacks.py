"""The thread that runs users' callbacks, so that they delay neither drawing nor the stream."""
from __future__ import annotations

import logging
import threading
import time
from collections import deque
from concurrent.futures import Future
from typing import Callable, Deque, Optional

from .receipts import Frame, Issue, resolve

log = logging.getLogger("voxeld")

# Limit of issues that wait for delivery; beyond it the newest are dropped, and their number is reported.
MOST_ISSUES = 10_000
# The thread ends after it has been idle for this long.
IDLE_S = 2.0


class Callbacks:
    """Thread-safe; only drain() blocks."""

    def __init__(self, on_issue: Callable[[Issue], None]) -> None:
        self._on_issue = on_issue
        self._lock = threading.Lock()
        self._changed = threading.Condition(self._lock)
        self._waiting: Deque[Callable[[], None]] = deque()
        self._issues = 0    # of those
        self._left_out = 0  # issues
        self._thread: Optional[threading.Thread] = None
        self._busy = False

    def issue(self, issue: Issue) -> None:
        with self._changed:
            if self._issues >= MOST_ISSUES:
                self._left_out += 1
                return
            self._issues += 1
            self._put(lambda: self._tell(issue))

    def done(self, future: "Future[Frame]", frame: Frame) -> None:
        with self._changed:
            self._put(lambda: resolve(future, frame))

    def drain(self, timeout: float) -> None:
        """Waits at most `timeout` until everything has been delivered; returns at once on the callback thread itself."""
        with self._changed:
            if threading.current_thread() is not self._thread:
                self._changed.wait_for(lambda: not self._waiting and not self._busy, timeout)

    def _put(self, call: Callable[[], None]) -> None:
        self._waiting.append(call)
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="voxeld callbacks", daemon=True)
            self._thread.start()
        self._changed.notify_all()

    def _tell(self, issue: Issue) -> None:
        with self._lock:
            self._issues -= 1
            left_out = 0
            if not self._issues:
                left_out, self._left_out = self._left_out, 0
        self._on_issue(issue)
        if left_out:
            log.warning("on_issue is slow: %d more refused operations were not told", left_out)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._busy = False
                self._changed.notify_all()
                end = time.monotonic() + IDLE_S
                while not self._waiting:
                    if not self._changed.wait(end - time.monotonic()) and time.monotonic() >= end and not self._waiting:
                        self._thread = None
                        return
                call = self._waiting.popleft()
                self._busy = True
            try:
                call()
            except Exception:  # whatever it is, it must not end the stream
                log.exception("a function that voxeld called failed")
            del call  # with what it holds
