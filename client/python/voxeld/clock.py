"""Estimates the server's monotonic clock."""
from __future__ import annotations

from collections import deque
from typing import Deque, NamedTuple, Optional

# How fast two clocks may drift apart, as a fraction of the time since a sample.
DRIFT = 200e-6
KEPT = 16


class Sample(NamedTuple):
    offset_ns: int  # server − client
    error_ns: int   # half the round trip: the offset is off by no more
    at_ns: int      # client's clock


class ClockEstimate:
    """Uses the sample with the least error among the last ones, including drift since then. Clocks are in nanoseconds."""

    def __init__(self) -> None:
        self._samples: Deque[Sample] = deque(maxlen=KEPT)

    def add(self, sent_ns: int, received_ns: int, answered_ns: int, back_ns: int) -> None:
        """Adds a ping that was sent at `sent_ns`, received and answered by the server's clock, and returned at `back_ns`.
        Impossible times are ignored."""
        inside = answered_ns - received_ns
        trip = back_ns - sent_ns - inside
        drifted = int(DRIFT * (back_ns - sent_ns)) + 1
        if inside < 0 or trip < -drifted:
            return
        trip = max(trip, 0)
        # The server received between sent_ns and back_ns − inside: the middle is off by at most half the trip, plus the drift of
        # the clocks meanwhile.
        offset = ((received_ns - sent_ns) + (answered_ns - back_ns)) // 2
        self._samples.append(Sample(offset, trip // 2 + 1 + drifted, back_ns))

    def _best(self, now_ns: int) -> Optional[Sample]:
        if not self._samples:
            return None
        return min(self._samples, key=lambda s: s.error_ns + DRIFT * (now_ns - s.at_ns))

    def known(self) -> bool:
        return bool(self._samples)

    def offset_ns(self, now_ns: int) -> Optional[int]:
        """Returns server − client; None before the first answer."""
        best = self._best(now_ns)
        return None if best is None else best.offset_ns

    def error_ns(self, now_ns: int) -> Optional[int]:
        """Returns the maximum error of the offset."""
        best = self._best(now_ns)
        return None if best is None else best.error_ns + int(DRIFT * (now_ns - best.at_ns))

    def forget(self) -> None:
        """Forgets all samples, because the server may be another one."""
        self._samples.clear()
