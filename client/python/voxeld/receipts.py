"""The progress of commits: a Frame for each, and the book that records the answers."""
from __future__ import annotations

import threading
from collections import OrderedDict, deque
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from dataclasses import dataclass, fields
from typing import Callable, Deque, Iterable, Optional

from .errors import CommitDropped, CommitRefused, ConnectionLost, NotDurable
from .v1 import scene_pb2 as pb
from .v1 import types_pb2

# Limit of accepted commits whose outcomes are pending. A server has fewer (Limits.max_riding_commits); beyond it the oldest are
# given up.
MAX_OWED = 65536

# An outcome that will never be reported, and one of a kind that this client does not know.
UNTOLD = "untold"


@dataclass(frozen=True)
class Stages:
    """When a commit passed each stage, in ns of the server's monotonic clock; 0: unknown."""

    sent_ns: int = 0
    received_ns: int = 0
    decoded_ns: int = 0
    applied_ns: int = 0
    drawing_ns: int = 0
    assembled_ns: int = 0
    sliced_ns: int = 0
    transferred_ns: int = 0
    shown_ns: int = 0

    @staticmethod
    def of(stages: pb.Stages) -> "Stages":
        return Stages(*(getattr(stages, name) for name in _STAGES))

    def durations_ms(self) -> dict[str, float]:
        """How long each stage took, since the previous known stage: {"received": 0.1, …}."""
        result: dict[str, float] = {}
        last = 0
        for name in _STAGES:
            at = int(getattr(self, name))
            if at and last:
                result[name[:-3]] = (at - last) / 1e6
            last = at or last
        return result

    def total_ms(self) -> Optional[float]:
        """Time from the first known stage to the last; None if fewer than two are known."""
        known = [at for at in (int(getattr(self, name)) for name in _STAGES) if at]
        return (known[-1] - known[0]) / 1e6 if len(known) > 1 else None


_STAGES = tuple(field.name for field in fields(Stages))


@dataclass(frozen=True)
class Accepted:
    """The commit is in the scene. `displays`: those that will report its outcome."""

    snapshot: int
    refused_operations: int
    applied_time_ns: int
    displays: tuple[str, ...]
    late: bool
    dropped_frames: int
    stages: Stages
    durable: bool = False  # the server will say when it is on its disk


@dataclass(frozen=True)
class Outcome:
    """The outcome of a commit on one display. `kind`: "presented", "unchanged", "superseded", "lost" or "not_shown"; or
    "untold" if it is unknown and will remain so."""

    display: str
    kind: str
    volume: int = 0             # presented, unchanged
    time_ns: int = 0            # presented: the server's monotonic clock
    reported: bool = False      # presented: the device said so; else it is an estimate
    by_frame_id: int = 0        # superseded
    reason: str = ""            # lost, not_shown, untold
    stages: Stages = Stages()   # presented

    def __repr__(self) -> str:
        more = f", volume {self.volume}" if self.seen else f" by frame {self.by_frame_id}" if self.by_frame_id else ""
        return f"<Outcome on {self.display!r}: {self.kind}{more}{': ' + self.reason if self.reason else ''}>"

    @property
    def seen(self) -> bool:
        """Whether the display shows what the commit requested."""
        return self.kind in ("presented", "unchanged")

    @staticmethod
    def of(outcome: pb.Outcome) -> "Outcome":
        kind = outcome.WhichOneof("what")
        if kind == "presented":
            p = outcome.presented
            return Outcome(outcome.display, kind, p.volume, p.time_ns, p.evidence == pb.EVIDENCE_DEVICE,
                           stages=Stages.of(p.stages))
        if kind == "unchanged":
            return Outcome(outcome.display, kind, outcome.unchanged.volume)
        if kind == "superseded":
            return Outcome(outcome.display, kind, by_frame_id=outcome.superseded.by_frame_id)
        if kind == "not_shown":
            return Outcome(outcome.display, kind, reason=_why(outcome.not_shown.why))
        if kind == "lost":
            return Outcome(outcome.display, kind, reason=outcome.lost.reason)
        return Outcome(outcome.display, UNTOLD, reason="the server is newer, and told it in words that are not known here")


def _why(why: int) -> str:
    try:
        return pb.NotShown.Why.Name(why).lower()
    except ValueError:
        return str(why)


@dataclass(frozen=True)
class Issue:
    """A refused operation, or one that was carried out in another way than requested (`applied`): which one, what was wrong,
    and what is expected."""

    layer: str
    id: str
    field: str
    reason: str
    message: str
    sequence: int = 0
    applied: bool = False

    def __str__(self) -> str:
        where = "/".join(part for part in (self.layer, self.id) if part)
        what = " ".join(part for part in (self.field, self.message) if part)
        return f"{where or 'commit'}: {what} ({self.reason.lower()})"

    def is_told_in(self, refusal: str) -> bool:
        """Whether a refusal's text contains this issue: it quotes the first as "layer/id, field: message", the commit's own by
        its message alone."""
        if not self.message:
            return False
        whose = "/".join(part for part in (self.layer, self.id) if part)
        where = ", ".join(part for part in (whose, self.field) if part)
        return (f"{where}: {self.message}" if whose else self.message) in refusal

    @staticmethod
    def of(issue: pb.Issue) -> "Issue":
        try:
            reason = types_pb2.Reason.Name(issue.reason)[len("REASON_"):]
        except ValueError:
            reason = str(int(issue.reason))
        return Issue(issue.layer, issue.id, issue.field, reason, issue.message, issue.sequence, issue.applied)


Done = Callable[["Future[Frame]", "Frame"], None]

# Guards the lists of waiters of all frames; held for a few instructions.
_waiting = threading.Lock()


def resolve(future: "Future[Frame]", frame: "Frame") -> None:
    if future.set_running_or_notify_cancel():
        future.set_result(frame)


class Frame:
    """One commit in progress. Its fields are filled as answers come; only the methods that wait block. `done` resolves the
    futures of waiters."""

    def __init__(self, frame_id: int, wants_outcomes: bool = True, done: Done = resolve) -> None:
        self.id = frame_id
        # "waiting" (here), "sent", "accepted", "refused", "dropped" (by the flow policy, unsent), "lost" (it will not be
        # applied) or "unknown" (the connection was lost before its answer, and the server cannot be asked)
        self.state = "waiting"
        self.accepted: Optional[Accepted] = None
        self.issues: tuple[Issue, ...] = ()
        self.outcomes: dict[str, Outcome] = {}
        self.client_dropped_frames = 0  # immediate frames of it that the flow policy gave up unsent
        self.reason = ""                # refused, dropped, lost, unknown: why
        self.durable = False            # it is on the server's disk
        self.scheduled_ns = 0           # a timed commit: when it will be applied, by the server's clock
        self._wants_outcomes = wants_outcomes
        self._done = False
        self._resolve = done
        self._futures: list[tuple[bool, Future[Frame], Done]] = []  # for outcomes?, what waits, who resolves it

    def __repr__(self) -> str:
        told = ", ".join(f"{o.display}: {o.kind}" for o in self.outcomes.values())
        return f"<Frame {self.id} {self.state}{' (' + told + ')' if told else ''}>"

    @property
    def answered(self) -> bool:
        """Whether it is known if the scene contains the commit."""
        return self.state not in ("waiting", "sent")

    @property
    def complete(self) -> bool:
        """Whether no more answers will come."""
        return self._done

    @property
    def seen(self) -> bool:
        """Whether a display shows it, or something that looks the same."""
        return any(o.seen for o in self.outcomes.values())

    def latency_ms(self) -> dict[str, float]:
        """Returns each stage's duration in ms, on the first display that presented it, or as far as it has come."""
        for outcome in self.outcomes.values():
            if outcome.kind == "presented":
                return outcome.stages.durations_ms()
        return self.accepted.stages.durations_ms() if self.accepted else {}

    def raise_if_failed(self) -> "Frame":
        if self.state == "refused":
            more = [str(issue) for issue in self.issues if not issue.is_told_in(self.reason)]
            raise CommitRefused("; ".join([self.reason, *more]), self.issues)
        if self.state == "dropped":
            raise CommitDropped(self.reason)
        if self.state in ("lost", "unknown"):
            raise ConnectionLost(self.reason)
        return self

    def future(self, *, shown: bool = False) -> "Future[Frame]":
        """Returns a future that is done when the commit is answered, or with `shown` when every display has reported its
        outcome. Its callbacks run on a thread of the connection that does nothing else; they may draw and wait."""
        return self._future(shown, self._resolve)

    def _future(self, shown: bool, done: Done) -> "Future[Frame]":
        future: Future[Frame] = Future()
        with _waiting:
            ready = self._done if shown else self.answered
            if not ready:
                self._futures.append((shown, future, done))
        if ready:
            resolve(future, self)  # nobody has it yet
        return future

    def wait(self, timeout: Optional[float] = None) -> "Frame":
        """Waits until the commit is answered. Raises CommitRefused, CommitDropped, ConnectionLost, or TimeoutError."""
        return self._wait(timeout, False).raise_if_failed()

    def wait_shown(self, timeout: Optional[float] = None) -> dict[str, Outcome]:
        """Waits until every display has reported the outcome; returns the outcomes by display name. Raises as wait() does."""
        return self._wait(timeout, True).raise_if_failed().outcomes

    def wait_durable(self, timeout: Optional[float] = None) -> "Frame":
        """Waits until the commit is on the server's disk, as commit(durable=True) requested. Raises as wait() does, and
        NotDurable if it was carried out but will not be stored: the server stores nothing (it has no --state-dir), or the
        session's layers end with it (on_disconnect)."""
        frame = self.wait(timeout)
        if frame.accepted is not None and not frame.accepted.durable:
            why = [issue for issue in frame.issues if issue.field == "commit.durable"]
            told = "; ".join(issue.message for issue in why) or "it was committed without durable=True"
            raise NotDurable(f"the commit was carried out, and is not on the server's disk: {told}", why)
        return self._wait(timeout, True)

    def _wait(self, timeout: Optional[float], shown: bool) -> "Frame":
        try:
            return self._future(shown, resolve).result(timeout)
        except FutureTimeout:
            missing = "an answer"
            if self.accepted is not None:
                displays = ", ".join(d for d in self.accepted.displays if d not in self.outcomes)
                missing = f"the outcome on {displays}" if displays else "word that it is on the server's disk"
            raise TimeoutError(f"frame {self.id} is {self.state} and {missing} has not come in {timeout} s") from None

    def _tell(self) -> None:
        """Wakes waiters after a change."""
        with _waiting:
            ready = [one for one in self._futures if self._done or not one[0] and self.answered]
            self._futures = [one for one in self._futures if one not in ready]
        for _, future, done in ready:
            done(future, self)


class Book:
    """All frames with pending answers, and the totals. For one thread at a time."""

    def __init__(self) -> None:
        self._open: OrderedDict[int, Frame] = OrderedDict()
        self._owed: OrderedDict[int, Frame] = OrderedDict()  # of these, the accepted
        self.counts = {name: 0 for name in (
            "commits", "accepted", "refused", "dropped", "given_up", "unknown", "refused_operations", "server_drops",
            "presented", "unchanged", "superseded", "lost", "not_shown", UNTOLD)}
        self.recent_issues: Deque[Issue] = deque(maxlen=100)

    def __len__(self) -> int:
        return len(self._open)

    def add(self, frame: Frame) -> None:
        self.counts["commits"] += 1
        self._open[frame.id] = frame

    def _close(self, frame: Frame) -> None:
        frame._done = True
        self._open.pop(frame.id, None)
        self._owed.pop(frame.id, None)

    def _end(self, frame: Frame, state: str, reason: str, count: str) -> None:
        frame.reason, frame.state = reason, state
        self.counts[count] += 1
        self._close(frame)
        frame._tell()

    def drop(self, frame: Frame, reason: str) -> None:
        """The flow policy dropped the commit before it was sent."""
        self._end(frame, "dropped", reason, "dropped")

    def unknown(self, frame: Frame, reason: str) -> None:
        """It is unknown whether the commit was applied."""
        self._end(frame, "unknown", reason, "unknown")

    def refuse(self, frame: Frame, reason: str, issues: Iterable[Issue] = (), operations: int = 0) -> None:
        frame.issues = tuple(issues)
        self.counts["refused_operations"] += operations
        self._end(frame, "refused", reason, "refused")

    def give_up(self, frames: Iterable[Frame], reason: str) -> None:
        """Ends the waiting for these frames. An accepted one stays accepted, and its missing outcomes are "untold"."""
        for frame in list(frames):
            if not frame.answered:
                self._end(frame, "lost", reason, "given_up")
                continue
            if frame.accepted is not None and not frame._done:
                for display in frame.accepted.displays:
                    if display not in frame.outcomes:
                        frame.outcomes[display] = Outcome(display, UNTOLD, reason=reason)
                        self.counts[UNTOLD] += 1
            self._close(frame)
            frame._tell()

    def open_frames(self) -> list[Frame]:
        return list(self._open.values())

    def owed(self) -> list[Frame]:
        """Returns the accepted frames that lack some of their outcomes."""
        return list(self._owed.values())

    def applied_unseen(self, frame: Frame, displays: Iterable[str]) -> None:
        """The commit was applied, though its receipt was lost with a connection."""
        self.accept(frame, Accepted(0, 0, 0, tuple(displays), False, 0, Stages()))

    def accept(self, frame: Frame, accepted: Accepted, issues: Iterable[Issue] = ()) -> None:
        if frame.answered:
            return
        frame.issues = tuple(issues)
        frame.accepted, frame.state = accepted, "accepted"
        self.counts["accepted"] += 1
        self.counts["refused_operations"] += accepted.refused_operations
        self.counts["server_drops"] += accepted.dropped_frames
        if self._is_complete(frame):
            self._close(frame)
        else:
            self._owed[frame.id] = frame
            while len(self._owed) > MAX_OWED:
                self.give_up([next(iter(self._owed.values()))], "too many commits wait for outcomes")
        frame._tell()

    @staticmethod
    def _is_complete(frame: Frame) -> bool:
        a = frame.accepted
        if a is None or a.durable and not frame.durable:
            return False
        return not frame._wants_outcomes or all(d in frame.outcomes for d in a.displays)

    def receipt(self, receipt: pb.Receipt, issues: Iterable[Issue] = ()) -> Optional[Frame]:
        """Records a receipt, with the issues of its commit. Returns the frame that it belongs to, if that is open."""
        frame = self._open.get(receipt.frame_id)
        if frame is None:
            return None
        what = receipt.WhichOneof("what")
        if what == "accepted":
            a = receipt.accepted
            self.accept(frame, Accepted(a.snapshot, a.refused_operations, a.applied_time_ns, tuple(a.displays), a.late,
                                        a.dropped_frames, Stages.of(a.stages), a.durable), issues)
        elif what == "refused":
            self.refuse(frame, receipt.refused.message, issues, receipt.refused.refused_operations)
        elif what == "outcome":
            outcome = Outcome.of(receipt.outcome)
            if outcome.display not in frame.outcomes:
                frame.outcomes[outcome.display] = outcome
                self.counts[outcome.kind] += 1
            if self._is_complete(frame):
                self._close(frame)
            frame._tell()
        elif what == "durable":
            frame.durable = True
            if self._is_complete(frame):
                self._close(frame)
            frame._tell()
        elif what == "scheduled":
            frame.scheduled_ns = receipt.scheduled.present_at_ns
        return frame
