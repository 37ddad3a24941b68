"""The client's side of a stream as a state machine: what to send next, and how to handle answers. Pure: no threads, no sockets;
time is an argument, in ns of any steady clock. The transport calls it under one lock.

A connection outlives its streams. When a stream ends, the next one resumes its session, or at least joins its owner. If the
server kept the session's layers (KEEP), what was sent but not applied is sent again. If they were removed with the stream, or
the server no longer knows the session, the scene as it had been accepted (the mirror) is sent first, in commits of its own;
then everything that had no answer, once more.
"""
from __future__ import annotations

from bisect import bisect_right
from collections import deque
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Callable, Deque, Iterable, Iterator, Optional, Union

from . import operations, wire
from .clock import ClockEstimate
from .mirror import Mirror
from .operations import Unit
from .outbox import DROP_OLDEST, LATEST, RELIABLE, Outbox
from .receipts import Book, Done, Frame, Issue, resolve
from .v1 import scene_pb2 as pb
from .v1 import types_pb2

SECOND_NS = 1_000_000_000
# The first pings are sent at short intervals, for a good clock estimate soon; later ones only correct for drift.
_QUICK_PINGS, _QUICK_NS, _SLOW_NS = 8, SECOND_NS // 20, 10 * SECOND_NS
# A server sends the pending outcomes of a resumed session for 10 s.
OWED_NS = 12 * SECOND_NS
# Size limit of a commit that restores the scene.
_RESTORE_BYTES = 4 << 20
_MOST_ISSUES = 10_000  # limit of issues kept per commit

FLOWS = {RELIABLE: pb.FLOW_POLICY_RELIABLE, LATEST: pb.FLOW_POLICY_LATEST, DROP_OLDEST: pb.FLOW_POLICY_DROP_OLDEST}


@dataclass
class Settings:
    client_name: str = "python"
    on_disconnect: Union[str, float] = "clear"  # "clear", "keep", or for how many seconds the layers linger
    strict: bool = False
    flow: str = RELIABLE
    keep_frames: int = 1                        # of DROP_OLDEST
    outcomes: bool = True
    owner_token: bytes = b""
    resume_token: bytes = b""
    buffer_bytes: int = 256 << 20
    first_frame: int = 1  # commits are numbered from here; above all of the session taken up


class Session:
    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._resume_token = settings.resume_token
        self._owner_token = settings.owner_token  # once there was a stream: of the owner that it had
        self.outbox = Outbox(settings.flow, settings.keep_frames, settings.buffer_bytes)
        self.mirror = Mirror()
        self.book = Book()
        self.clock = ClockEstimate()
        self.info: Optional[pb.Opened] = None  # of the newest stream
        self.open = False                      # a stream stands, and its Opened has come
        self.streams_opened = 0
        self.resumed = 0
        self.restored = 0                      # how often the scene was sent again
        self.answered = 0                      # commits; commits that send the scene again do not count
        self.on_issue: Callable[[Issue], None] = lambda issue: None  # called with what is refused, here or there
        self.done: Done = resolve              # resolves the futures that others have of frames
        self._next_frame = settings.first_frame
        self._again: Deque[Unit] = deque()    # to be sent before what waits in the outbox
        self._current: Optional[Unit] = None  # being sent
        self._restore_due = False             # the stream ended while the scene was being sent again
        self._owed: list[Frame] = []          # accepted before the session was taken up, without their outcomes
        self._owed_until_ns = 0
        self._begin_stream()

    def _begin_stream(self) -> None:
        self._sent = 0       # bytes since this stream's Open, with it
        self._credit = 0     # may be sent in all; 0: the server does not say, and there is no pacing
        self._sequence = 0   # of the last request
        self._messages: Iterator[bytes] = iter(())  # of the current unit
        self._pings = 0
        self._next_ping_ns = 0
        self._pings_known = False
        self._taken_up = False
        self._on_way: Deque[Unit] = deque()   # sent whole, not answered
        self._begun: list[tuple[int, Unit]] = []  # with their first sequences; some that are not on their way any more
        self._must_show: dict[int, Frame] = {}    # accepted, by their commits' sequences

    # ----------------------------------------------------------------------------------------------------- sending

    def new_frame(self) -> Frame:
        frame = Frame(self._next_frame, self._settings.outcomes, self._done)
        self._next_frame += 1
        return frame

    def _done(self, future: "Future[Frame]", frame: Frame) -> None:
        self.done(future, frame)

    def submit(self, unit: Unit) -> bool:
        """Queues a commit for sending. False: there was not enough room, and nothing was queued."""
        too_large = self._too_large(unit)
        if too_large:
            self.book.add(unit.frame)
            self._refuse(unit, too_large)
            return True
        gone = self.outbox.push(unit, newest_only=not self.open)
        if gone is None:
            return False
        self.book.add(unit.frame)
        for one in gone:
            self.book.drop(one.frame, "newer frames of its layer came before it could be sent (flow policy)")
        return True

    @property
    def most_bytes(self) -> int:
        """Size limit of a message: the last server's, or none."""
        return (self.info.limits.max_message_bytes if self.info is not None else 0) or 1 << 62

    def _too_large(self, unit: Unit) -> str:
        """Returns why the server would end the stream because of this unit; empty: it would not."""
        if unit.largest <= self.most_bytes:
            return ""
        return (f"an operation of the commit has {unit.largest} bytes and the server takes messages of at most "
                f"{self.most_bytes} (max_message_bytes); nothing of the commit was sent; make several things of it")

    def _refuse(self, unit: Unit, reason: str) -> None:
        """Refuses a commit that would exceed the server's limits without sending it; it is reported like the server's
        refusals."""
        self.book.refuse(unit.frame, reason)
        self.on_issue(Issue("", "", "", "QUOTA_EXCEEDED", reason))

    def open_request(self) -> bytes:
        """Returns the first message of a stream."""
        s = self._settings
        request = pb.StreamRequest(open=pb.Open(
            client_name=s.client_name, strict=s.strict, resume_token=self._resume_token, flow=FLOWS[s.flow],
            drop_oldest_frames=s.keep_frames if s.flow == DROP_OLDEST else 0, no_outcomes=not s.outcomes,
            owner_token=b"" if self._resume_token else self._owner_token))
        if s.on_disconnect == "keep":
            request.open.on_disconnect = pb.DISCONNECT_POLICY_KEEP
        elif s.on_disconnect != "clear":
            request.open.on_disconnect = pb.DISCONNECT_POLICY_LINGER
            request.open.linger_ns = int(float(s.on_disconnect) * SECOND_NS)
        self._begin_stream()
        self._taken_up = bool(self._resume_token)
        return self._count(request.SerializeToString())

    def forget_token(self) -> bool:
        """Call when the server does not know the token of the last Open. True: opening with less may succeed."""
        if self._resume_token:
            self._resume_token = b""
            return True
        if self._owner_token and self.streams_opened:
            self._owner_token = b""  # the owner has gone, and all that it had
            return True
        return False

    def _count(self, message: bytes) -> bytes:
        self._sent += len(message)
        # Pings and commits are sent with their numbers; in between the server counts by itself, which saves a copy of bulk data.
        self._sequence += 1
        return message

    def _has_credit(self) -> bool:
        return self._credit == 0 or self._sent < self._credit

    def next_request(self, now_ns: int) -> Optional[bytes]:
        """Returns the next message, if one is waiting and may be sent now."""
        self._give_up_owed(now_ns)
        if not self.open or not self._has_credit():
            return None
        if self._pings_known and now_ns >= self._next_ping_ns:
            self._pings += 1
            self._next_ping_ns = now_ns + (_QUICK_NS if self._pings < _QUICK_PINGS else _SLOW_NS)
            return self._count(pb.StreamRequest(
                sequence=self._sequence + 1, ping=pb.Ping(client_time_ns=now_ns)).SerializeToString())
        unit = self._current
        if unit is None:
            unit = self._next_unit()
            if unit is None:
                return None
            self._current = unit
            self._begun.append((self._sequence + 1, unit))
            self._messages = unit.requests(min(wire.BATCH_BYTES, self.most_bytes))
        for message in self._messages:
            self._count(message)
            unit.sequences.append(self._sequence)
            return message
        unit.drops += self.outbox.take_unreported()
        request = pb.StreamRequest(sequence=self._sequence + 1, commit=unit.commit)
        request.commit.frame_id = unit.frame.id
        request.commit.send_time_ns = now_ns
        request.commit.client_drops = unit.drops
        message = self._count(request.SerializeToString())
        unit.commit_sequence = self._sequence
        self._on_way.append(unit)
        self._current = None
        return message

    def _next_unit(self) -> Optional[Unit]:
        """Returns the next unit that can be sent; units for which the server would end the stream are refused here."""
        while True:
            unit = self._again.popleft() if self._again else self.outbox.pop()
            if unit is None:
                return None
            too_large = self._too_large(unit)
            if not too_large:
                if unit.frame.state == "waiting":
                    unit.frame.state = "sent"
                return unit
            self.outbox.unreported_drops += unit.drops
            self._refuse(unit, too_large)

    def next_due_ns(self) -> Optional[int]:
        """Returns when to call again even if nothing else happens."""
        due = [self._next_ping_ns] if self.open and self._pings_known else []
        if self._owed:
            due.append(self._owed_until_ns)
        return min(due, default=None)

    def idle(self) -> bool:
        """Whether everything that was submitted, or had to be sent again, has been sent."""
        return self._current is None and not self._again and not len(self.outbox)

    # --------------------------------------------------------------------------------------------------- receiving

    def answer(self, response: pb.StreamResponse, now_ns: int) -> None:
        if response.HasField("opened"):
            self._opened(response.opened, now_ns)
        self._credit = max(self._credit, response.credit_bytes)
        if response.HasField("pong"):
            pong = response.pong
            answered = pong.server_time_ns or response.server_time_ns
            self.clock.add(pong.client_time_ns, pong.received_time_ns, answered, now_ns)
        for issue in response.issues:
            self._issue(Issue.of(issue))
        for receipt in response.receipts:
            self._receipt(receipt, now_ns)
        self._give_up_owed(now_ns)

    def _issue(self, issue: Issue) -> None:
        """Assigns an issue by its sequence: to a commit without an answer yet, or to one that must be shown and was not."""
        at = bisect_right(self._begun, issue.sequence, key=lambda one: one[0]) - 1
        unit = self._begun[at][1] if at >= 0 else None
        frame = self._must_show.get(issue.sequence)
        if frame is not None:
            frame.issues += (issue,)
        elif unit is not None and (not unit.commit_sequence or issue.sequence <= unit.commit_sequence):
            if len(unit.issues) < _MOST_ISSUES:
                unit.issues.append(issue)
        self.book.recent_issues.append(issue)
        self.on_issue(issue)

    def _receipt(self, receipt: pb.Receipt, now_ns: int) -> None:
        what = receipt.WhichOneof("what")
        unit = self._answered(receipt.sequence) if what in ("accepted", "refused") else None
        if unit is not None:
            if unit.restores:
                if what == "refused":
                    self._tell_of_restore(receipt.refused.message)
                return
            self.answered += 1
            if what == "accepted":
                unit.apply(self.mirror, now_ns)
                if unit.on_accepted is not None:
                    unit.on_accepted()
                if unit.commit.must_show:
                    self._must_show = {s: f for s, f in self._must_show.items() if not f.complete}
                    self._must_show[receipt.sequence] = unit.frame
        self.book.receipt(receipt, () if unit is None else unit.issues)

    def _tell_of_restore(self, why: str) -> None:
        issue = Issue("", "", "commit", "REFUSED",
                      f"what was up before the connection was lost is not put up again: {why}")
        self.book.recent_issues.append(issue)
        self.on_issue(issue)

    def _answered(self, sequence: int) -> Optional[Unit]:
        # Usually the oldest; timed commits are answered when they are due, and others overtake them.
        for unit in self._on_way:
            if unit.commit_sequence == sequence:
                self._on_way.remove(unit)
                if len(self._begun) > 2 * len(self._on_way) + 64:
                    waiting = set(map(id, self._on_way))
                    self._begun = [one for one in self._begun if id(one[1]) in waiting or one[1] is self._current]
                return unit
        return None

    def _opened(self, opened: pb.Opened, now_ns: int) -> None:
        first = self.streams_opened == 0
        self.info = opened
        self.open = True
        self.streams_opened += 1
        self._resume_token, self._owner_token = opened.resume_token, opened.owner_token or self._owner_token
        self._credit = opened.credit_bytes
        self._pings_known = opened.credit_bytes != 0  # a server without the one is from before there was either
        if self._taken_up:
            self.resumed += 1
        elif not first:
            self.clock.forget()
            self.book.give_up(self.book.owed(), "the connection was lost, and the server did not keep the session")
        if first:
            return
        kept = self._taken_up and self._settings.on_disconnect == "keep" and not self._restore_due
        if self._taken_up:
            applied = opened.last_frame_id if opened.HasField("last_frame_id") else 0
            self._again = deque(self._after_resume(self._again, applied, opened, kept, now_ns))
            self._owed, self._owed_until_ns = self.book.owed(), now_ns + OWED_NS
        for unit in self._again:
            unit.forget_sending()
        if not kept:
            self._restore(opened.limits, now_ns)

    def _after_resume(self, units: Iterable[Unit], applied: int, opened: pb.Opened, kept: bool,
                      now_ns: int) -> Iterator[Unit]:
        """Yields the units to send again, of those without an answer when the stream ended. `applied`: the last one that was
        applied."""
        for unit in units:
            frame = unit.frame
            if not unit.commit_sequence or frame.id > applied:
                yield unit
            elif not kept:
                # If it was applied, its drops were counted; its effects were lost with the layers.
                if frame.id == applied or not unit.timed and not self._settings.strict:
                    unit.drops = 0
                yield unit
            elif frame.id != applied and unit.timed:
                # It was waiting for its time when the stream ended, and was dropped; or it was applied before that.
                if unit.commit.present_at_ns > opened.server_time_ns:
                    yield unit
                else:
                    self.book.unknown(
                        frame, "the connection was lost about when its time came; whether it was shown is not known")
            elif frame.id != applied and self._settings.strict:
                self.book.unknown(
                    frame, "the connection was lost before its answer came; whether the server refused it is not known")
            else:
                unit.issues = []
                unit.apply(self.mirror, now_ns)
                if unit.on_accepted is not None:
                    unit.on_accepted()
                self.book.applied_unseen(frame, opened.displays)

    def _restore(self, limits: types_pb2.Limits, now_ns: int) -> None:
        self.restored += 1
        scene: list[Optional[operations.Operation]] = []
        for operation in operations.restoring(self.mirror, now_ns):
            if operation is None or operation.largest() <= self.most_bytes:
                scene.append(operation)
            else:
                self._tell_of_restore(f"it has {operation.largest()} bytes, and the server takes messages of at most "
                                      f"{self.most_bytes} (max_message_bytes)")
        most = min(_RESTORE_BYTES, limits.max_uncommitted_bytes // 2 or _RESTORE_BYTES)
        self._again.extendleft(reversed([
            Unit(Frame(0, False), commit, pb.Commit(), restores=True)
            for commit in operations.parted(scene, most, limits.max_operations_per_commit or 1 << 62)]))
        self._restore_due = False

    def _give_up_owed(self, now_ns: int) -> None:
        if self._owed and now_ns >= self._owed_until_ns:
            self.book.give_up([frame for frame in self._owed if not frame.complete],
                              "the server did not say after the connection was lost")
            self._owed = []
        elif self._owed and self._owed[-1].complete:
            self._owed = [frame for frame in self._owed if not frame.complete]

    def lost(self) -> None:
        """The stream has ended."""
        self.open = False
        units = [*self._on_way, *([self._current] if self._current is not None else []), *self._again]
        self._on_way.clear()
        self._current = None
        # The next stream makes its own restore of the scene.
        self._restore_due = self._restore_due or any(unit.restores for unit in units)
        # Keep the order of sending: units in flight are older than those that are sent again after them.
        self._again = deque(unit for unit in units if not unit.restores)

    def fail(self, reason: str) -> None:
        """Ends the session: no other stream will follow."""
        self.open = False
        while self.outbox.pop() is not None:
            pass
        self._begin_stream()
        self._again.clear()
        self._current = None
        self._owed = []
        self.book.give_up(self.book.open_frames(), reason)

    @property
    def resume_token(self) -> bytes:
        return self._resume_token
