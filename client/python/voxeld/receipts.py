"""What becomes of commits: a Frame for each, and the book that the answers are entered into."""
from __future__ import annotations

from collections import OrderedDict, deque
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from dataclasses import dataclass, fields
from typing import Callable, Deque, Iterable, Optional

from .errors import CommitDropped, CommitRefused, ConnectionLost
from .v1 import scene_pb2 as pb
from .v1 import types_pb2

# Frames kept open at once. A server owes fewer (Limits.max_riding_commits); beyond, the oldest are given up.
MAX_OPEN = 65536


@dataclass(frozen=True)
class Stages:
    """When a commit passed what, in ns of the server's monotonic clock; 0: not known."""

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
        return Stages(*(getattr(stages, f.name) for f in fields(Stages)))

    def durations_ms(self) -> dict[str, float]:
        """How long each stage took, from the stage before that is known: {"received": 0.1, …}."""
        result: dict[str, float] = {}
        last = 0
        for field in fields(self):
            at = int(getattr(self, field.name))
            if at and last:
                result[field.name[:-3]] = (at - last) / 1e6
            last = at or last
        return result

    def total_ms(self) -> Optional[float]:
        """From the first stage known to the last; None if fewer than two are."""
        known = [at for at in (int(getattr(self, f.name)) for f in fields(self)) if at]
        return (known[-1] - known[0]) / 1e6 if len(known) > 1 else None


@dataclass(frozen=True)
class Accepted:
    """The commit is in the scene. `displays`: those that will say what became of it."""

    snapshot: int
    refused_operations: int
    applied_time_ns: int
    displays: tuple[str, ...]
    late: bool
    dropped_frames: int
    stages: Stages


@dataclass(frozen=True)
class Outcome:
    """What became of a commit on one display. `kind`: "presented", "unchanged", "superseded", "lost" or "not_shown"."""

    display: str
    kind: str
    volume: int = 0             # presented, unchanged
    time_ns: int = 0            # presented: the server's monotonic clock
    reported: bool = False      # presented: the device said so; else it is an estimate
    by_frame_id: int = 0        # superseded
    reason: str = ""            # lost, not_shown
    stages: Stages = Stages()   # presented

    @property
    def seen(self) -> bool:
        """The display shows what the commit asked for."""
        return self.kind in ("presented", "unchanged")

    @staticmethod
    def of(outcome: pb.Outcome) -> "Outcome":
        kind = outcome.WhichOneof("what") or "lost"
        if kind == "presented":
            p = outcome.presented
            return Outcome(outcome.display, kind, p.volume, p.time_ns, p.evidence == pb.EVIDENCE_DEVICE,
                           stages=Stages.of(p.stages))
        if kind == "unchanged":
            return Outcome(outcome.display, kind, outcome.unchanged.volume)
        if kind == "superseded":
            return Outcome(outcome.display, kind, by_frame_id=outcome.superseded.by_frame_id)
        if kind == "not_shown":
            return Outcome(outcome.display, kind, reason=pb.NotShown.Why.Name(outcome.not_shown.why).lower())
        return Outcome(outcome.display, kind, reason=outcome.lost.reason)


@dataclass(frozen=True)
class Issue:
    """A refused operation: which, what was wrong, what would be right."""

    layer: str
    id: str
    field: str
    reason: str
    message: str
    sequence: int = 0

    def __str__(self) -> str:
        where = "/".join(part for part in (self.layer, self.id) if part)
        return f"{where or 'commit'}: {self.field} {self.message} ({self.reason.lower()})"

    @staticmethod
    def of(issue: pb.Issue) -> "Issue":
        try:
            reason = types_pb2.Reason.Name(issue.reason)[len("REASON_"):]
        except ValueError:
            reason = str(int(issue.reason))
        return Issue(issue.layer, issue.id, issue.field, reason, issue.message, issue.sequence)


class Frame:
    """One commit on its way. Its fields fill as answers come; nothing here blocks but the methods that wait."""

    def __init__(self, frame_id: int, wants_outcomes: bool = True) -> None:
        self.id = frame_id
        # "waiting" (here), "sent", "accepted", "refused", "dropped" (by the flow policy, unsent) or "lost"
        self.state = "waiting"
        self.accepted: Optional[Accepted] = None
        self.issues: tuple[Issue, ...] = ()
        self.outcomes: dict[str, Outcome] = {}
        self.client_dropped_frames = 0  # immediate frames of it that the flow policy gave up unsent
        self.reason = ""                # refused, dropped, lost: why
        self.scheduled_ns = 0           # a timed commit: when it will be applied, by the server's clock
        self._wants_outcomes = wants_outcomes
        self._done = False
        self._watchers: list[tuple[Callable[[Frame], bool], Future[Frame]]] = []

    def __repr__(self) -> str:
        told = ", ".join(f"{o.display}: {o.kind}" for o in self.outcomes.values())
        return f"<Frame {self.id} {self.state}{' (' + told + ')' if told else ''}>"

    @property
    def answered(self) -> bool:
        """It is known whether the scene has it."""
        return self.state not in ("waiting", "sent")

    @property
    def complete(self) -> bool:
        """Nothing more will be told."""
        return self._done

    @property
    def seen(self) -> bool:
        """A display shows it, or something that looks the same."""
        return any(o.seen for o in self.outcomes.values())

    def latency_ms(self) -> dict[str, float]:
        """Each stage's duration in ms, of the first display that presented it, or as far as it has come."""
        for outcome in self.outcomes.values():
            if outcome.kind == "presented":
                return outcome.stages.durations_ms()
        return self.accepted.stages.durations_ms() if self.accepted else {}

    def raise_if_failed(self) -> "Frame":
        if self.state == "refused":
            raise CommitRefused("; ".join([self.reason, *map(str, self.issues)]), self.issues)
        if self.state == "dropped":
            raise CommitDropped(self.reason)
        if self.state == "lost":
            raise ConnectionLost(self.reason)
        return self

    def future(self, *, shown: bool = False) -> "Future[Frame]":
        """Is done when the commit is answered, or with `shown` when every display has said what became of it."""
        future: Future[Frame] = Future()
        self._watchers.append(((lambda f: f._done) if shown else (lambda f: f.answered), future))
        self._tell()
        return future

    def wait(self, timeout: Optional[float] = None) -> "Frame":
        """Until it is answered. Raises CommitRefused, CommitDropped, ConnectionLost, or TimeoutError."""
        return self._wait(timeout, False).raise_if_failed()

    def wait_shown(self, timeout: Optional[float] = None) -> dict[str, Outcome]:
        """Until every display has said what became of it: that, by the display's name. Raises as wait() does."""
        return self._wait(timeout, True).raise_if_failed().outcomes

    def _wait(self, timeout: Optional[float], shown: bool) -> "Frame":
        try:
            return self.future(shown=shown).result(timeout)
        except FutureTimeout:
            missing = "an answer"
            if self.accepted is not None:
                missing = "the outcome on " + ", ".join(d for d in self.accepted.displays if d not in self.outcomes)
            raise TimeoutError(f"frame {self.id} is {self.state} and {missing} has not come in {timeout} s") from None

    def _tell(self) -> None:
        # Lists are replaced whole, so that a thread that asks and one that answers never undo each other's change.
        for watcher in list(self._watchers):
            ready, future = watcher
            if ready(self):
                try:
                    self._watchers.remove(watcher)
                except ValueError:
                    continue  # the other thread has it
                if future.set_running_or_notify_cancel():
                    future.set_result(self)


class Book:
    """Every frame that something is still owed to, and the sums. Of one thread at a time."""

    def __init__(self) -> None:
        self._open: OrderedDict[int, Frame] = OrderedDict()
        self.counts = {name: 0 for name in (
            "commits", "accepted", "refused", "dropped", "given_up", "refused_operations", "server_drops",
            "presented", "unchanged", "superseded", "lost", "not_shown")}
        self.recent_issues: Deque[Issue] = deque(maxlen=100)
        self._issues: list[Issue] = []  # of the commit whose receipt has not come

    def __len__(self) -> int:
        return len(self._open)

    def add(self, frame: Frame) -> None:
        self.counts["commits"] += 1
        self._open[frame.id] = frame
        while len(self._open) > MAX_OPEN:
            self.give_up([next(iter(self._open.values()))], "too many commits without an outcome")

    def _close(self, frame: Frame) -> None:
        frame._done = True
        self._open.pop(frame.id, None)

    def drop(self, frame: Frame, reason: str) -> None:
        """The flow policy gave it up unsent."""
        frame.reason, frame.state = reason, "dropped"
        self.counts["dropped"] += 1
        self._close(frame)
        frame._tell()

    def give_up(self, frames: Iterable[Frame], reason: str) -> None:
        """No more will be known of these. One that was accepted stays so."""
        for frame in list(frames):
            if not frame.answered:
                frame.reason, frame.state = reason, "lost"
                self.counts["given_up"] += 1
            self._close(frame)
            frame._tell()

    def open_frames(self) -> list[Frame]:
        return list(self._open.values())

    def applied_unseen(self, frame: Frame, displays: Iterable[str]) -> None:
        """It was applied, though its receipt was lost with a connection."""
        self.enter_accepted(frame, Accepted(0, 0, 0, tuple(displays), False, 0, Stages()))

    def enter_accepted(self, frame: Frame, accepted: Accepted) -> None:
        if frame.answered:
            return
        frame.issues, self._issues = tuple(self._issues), []
        frame.accepted, frame.state = accepted, "accepted"
        self.counts["accepted"] += 1
        self.counts["refused_operations"] += accepted.refused_operations
        self.counts["server_drops"] += accepted.dropped_frames
        if not frame._wants_outcomes or all(d in frame.outcomes for d in accepted.displays):
            self._close(frame)
        frame._tell()

    def issue(self, issue: pb.Issue) -> Issue:
        told = Issue.of(issue)
        self._issues.append(told)
        del self._issues[:-1000]
        self.recent_issues.append(told)
        return told

    def receipt(self, receipt: pb.Receipt) -> Optional[Frame]:
        """Enters it. The frame it belongs to, if that is open."""
        frame = self._open.get(receipt.frame_id)
        what = receipt.WhichOneof("what")
        if frame is None:
            if what in ("accepted", "refused"):
                self._issues = []
            return None
        if what == "accepted":
            a = receipt.accepted
            self.enter_accepted(frame, Accepted(a.snapshot, a.refused_operations, a.applied_time_ns, tuple(a.displays),
                                                a.late, a.dropped_frames, Stages.of(a.stages)))
        elif what == "refused":
            frame.issues, self._issues = tuple(self._issues), []
            frame.reason, frame.state = receipt.refused.message, "refused"
            self.counts["refused"] += 1
            self.counts["refused_operations"] += receipt.refused.refused_operations
            self._close(frame)
            frame._tell()
        elif what == "outcome":
            outcome = Outcome.of(receipt.outcome)
            if outcome.display not in frame.outcomes:
                frame.outcomes[outcome.display] = outcome
                self.counts[outcome.kind] += 1
            if frame.accepted is not None and all(d in frame.outcomes for d in frame.accepted.displays):
                self._close(frame)
            frame._tell()
        elif what == "scheduled":
            frame.scheduled_ns = receipt.scheduled.present_at_ns
        return frame
