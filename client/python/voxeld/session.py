"""The client's side of a stream as a state machine: what to send next, and what answers mean. Pure: no threads, no sockets;
time is an argument, in ns of any steady clock. The transport calls it under one lock.

A connection outlives its streams. When one ends, the next takes its session up. Where the server kept the session's layers
(KEEP), what was sent and not applied is sent again. Where they went with the stream, or the server does not know the session
any more, the mirror's whole scene comes first, in one commit; what was on its way is in that and gets its receipts.
"""
from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Callable, Deque, Iterator, Optional, Union

from .clock import ClockEstimate
from .mirror import Mirror
from .operations import Unit
from .outbox import DROP_OLDEST, LATEST, RELIABLE, Outbox
from .receipts import Book, Frame, Issue
from .v1 import scene_pb2 as pb

SECOND_NS = 1_000_000_000
# The first pings come close together, for a clock that is soon known well; then now and then, against drift.
_QUICK_PINGS, _QUICK_NS, _SLOW_NS = 8, SECOND_NS // 20, 10 * SECOND_NS

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
        self.outbox = Outbox(settings.flow, settings.keep_frames, settings.buffer_bytes)
        self.mirror = Mirror()
        self.book = Book()
        self.clock = ClockEstimate()
        self.info: Optional[pb.Opened] = None  # of the newest stream
        self.open = False                      # a stream stands, and its Opened has come
        self.streams_opened = 0
        self.resumed = 0
        self.on_issue: Callable[[Issue], None] = lambda issue: None  # called from answer()
        self._next_frame = settings.first_frame
        self._begin_stream()
        self._on_way: Deque[Unit] = deque()   # sent whole, not answered
        self._again: Deque[Unit] = deque()    # to be sent again, before anything else
        self._current: Optional[Unit] = None  # being sent
        self._rebuilding = False              # the server's session began with the mirror
        self._rebuilt: list[Frame] = []       # were on their way then: the commit of the mirror is theirs
        self._unsure: list[Frame] = []        # accepted before a resume; whether an outcome comes is not known

    def _begin_stream(self) -> None:
        self._sent = 0       # bytes since this stream's Open, with it
        self._credit = 0     # may be sent in all; 0: the server does not say, and there is no pacing
        self._sequence = 0   # of the last request
        self._messages: Iterator[bytes] = iter(())  # of the current unit
        self._replay: Iterator[bytes] = iter(())    # the mirror, for a server that has lost it
        self._held: Optional[bytes] = None          # a message that was made and waits for credit
        self._pings = 0
        self._next_ping_ns = 0
        self._pings_known = False

    # ------------------------------------------------------------------------------------------------ what is sent

    def new_frame(self) -> Frame:
        frame = Frame(self._next_frame, self._settings.outcomes)
        self._next_frame += 1
        return frame

    def submit(self, unit: Unit) -> bool:
        """Takes a commit for sending. False: there is no room, and nothing was taken."""
        gone = self.outbox.push(unit, newest_only=not self.open)
        if gone is None:
            return False
        self.book.add(unit.frame)
        for one in gone:
            self.book.drop(one.frame, "newer frames of its layer came before it could be sent (flow policy)")
        return True

    def open_request(self) -> bytes:
        """The first message of a stream."""
        s = self._settings
        request = pb.StreamRequest(open=pb.Open(
            client_name=s.client_name, strict=s.strict, resume_token=self._resume_token, flow=FLOWS[s.flow],
            drop_oldest_frames=s.keep_frames if s.flow == DROP_OLDEST else 0, no_outcomes=not s.outcomes,
            owner_token=b"" if self._resume_token else s.owner_token))
        if s.on_disconnect == "keep":
            request.open.on_disconnect = pb.DISCONNECT_POLICY_KEEP
        elif s.on_disconnect != "clear":
            request.open.on_disconnect = pb.DISCONNECT_POLICY_LINGER
            request.open.linger_ns = int(float(s.on_disconnect) * SECOND_NS)
        self._begin_stream()
        return self._count(request.SerializeToString())

    def _count(self, message: bytes) -> bytes:
        self._sent += len(message)
        self._sequence += 1  # requests are sent without numbers, and the server counts
        return message

    def _has_credit(self) -> bool:
        return self._credit == 0 or self._sent < self._credit

    def next_request(self, now_ns: int) -> Optional[bytes]:
        """The next message, if there is one and it may be sent now."""
        if not self.open or not self._has_credit():
            return None
        if self._pings_known and now_ns >= self._next_ping_ns:
            self._pings += 1
            self._next_ping_ns = now_ns + (_QUICK_NS if self._pings < _QUICK_PINGS else _SLOW_NS)
            return self._count(pb.StreamRequest(ping=pb.Ping(client_time_ns=now_ns)).SerializeToString())
        for message in self._replay:
            return self._count(message)
        if self._current is None:
            if self._again:
                self._current = self._again.popleft()
            else:
                self._current = self.outbox.pop()
                if self._current is None:
                    return None
                for operation in self._current.operations:
                    operation.apply(self.mirror, now_ns)
            if self._current.frame.state == "waiting":
                self._current.frame.state = "sent"
            self._messages = self._current.requests()
        for message in self._messages:
            return self._count(message)
        commit = pb.Commit()
        commit.CopyFrom(self._current.commit)
        commit.frame_id = self._current.frame.id
        commit.send_time_ns = now_ns
        self._current.drops += self.outbox.take_unreported()
        commit.client_drops = self._current.drops
        self._on_way.append(self._current)
        self._current = None
        return self._count(pb.StreamRequest(commit=commit).SerializeToString())

    def next_ping_ns(self) -> Optional[int]:
        """When to ask again even if nothing else happens."""
        return self._next_ping_ns if self.open and self._pings_known else None

    def idle(self) -> bool:
        """All that was submitted has been sent."""
        return self._current is None and not self._again and not len(self.outbox)

    # -------------------------------------------------------------------------------------------------- what comes

    def answer(self, response: pb.StreamResponse, now_ns: int) -> None:
        if response.HasField("opened"):
            self._opened(response.opened, now_ns)
        self._credit = max(self._credit, response.credit_bytes)
        if response.HasField("pong"):
            pong = response.pong
            answered = pong.server_time_ns or response.server_time_ns
            self.clock.add(pong.client_time_ns, pong.received_time_ns, answered, now_ns)
        for issue in response.issues:
            self.on_issue(self.book.issue(issue))
        for receipt in response.receipts:
            if receipt.frame_id == 0:
                self._rebuilt_receipt(receipt)
                continue
            frame = self.book.receipt(receipt)
            if frame is not None and frame.answered:
                self._answered(frame)
            if frame is not None and frame.complete and self._unsure and frame.id > self._unsure[-1].id:
                # Outcomes come in the order of commits: those of before the resume that have not come were lost.
                self.book.give_up([f for f in self._unsure if not f.complete], "its outcome was lost with a connection")
                self._unsure = []

    def _rebuilt_receipt(self, receipt: pb.Receipt) -> None:
        """Of the commit that sent the scene anew: it stands for those that were on their way and are in it."""
        if not self._rebuilt:
            self.book.receipt(receipt)  # for the issues before it
        for frame in self._rebuilt:
            own = pb.Receipt()
            own.CopyFrom(receipt)
            own.frame_id = frame.id
            self.book.receipt(own)
        self._rebuilt = [frame for frame in self._rebuilt if not frame.complete]

    def _answered(self, frame: Frame) -> None:
        # Mostly the oldest; timed commits are answered when they are due, and others pass them.
        for unit in self._on_way:
            if unit.frame is frame:
                self._on_way.remove(unit)
                return

    def _opened(self, opened: pb.Opened, now_ns: int) -> None:
        resumed = bool(self._resume_token)
        self.info = opened
        self.open = True
        self.streams_opened += 1
        self._resume_token = opened.resume_token
        self._credit = opened.credit_bytes
        self._pings_known = opened.credit_bytes != 0  # a server without the one is from before there was either
        if resumed:
            self.resumed += 1
            applied = opened.last_frame_id if opened.HasField("last_frame_id") else 0
            waiting, self._on_way = self._on_way, deque()
            for unit in waiting:
                if unit.frame.id <= applied:
                    self.book.applied_unseen(unit.frame, opened.displays)
                else:
                    self._again.append(unit)
            if self._settings.on_disconnect == "keep" and not (self._rebuilding and not opened.HasField("last_frame_id")):
                for frame in self._rebuilt:
                    self.book.applied_unseen(frame, opened.displays)
                self._rebuilt = []
                self._unsure = [frame for frame in self.book.open_frames() if frame.answered]
                return
            self._unsure = [frame for frame in self.book.open_frames() if frame.answered]
        if self.streams_opened == 1:
            return
        if not resumed:
            self.clock.forget()
            self.book.give_up([f for f in self.book.open_frames() if f.answered], "its outcome was lost with a connection")
            self._unsure = []
        # The layers are gone, or may be: what was on its way is in the mirror.
        folded = (*self._on_way, *self._again)
        self._rebuilt = [f for f in self._rebuilt if not f.answered] + [unit.frame for unit in folded]
        self.outbox.unreported_drops += sum(unit.drops for unit in folded)
        self._on_way.clear()
        self._again.clear()
        self._replay = self._mirrored(now_ns)
        self._rebuilding = True

    def _mirrored(self, now_ns: int) -> Iterator[bytes]:
        yield pb.StreamRequest(delete=pb.Delete(all_mine=True)).SerializeToString()  # of what lingers
        yield from self.mirror.requests(now_ns)
        yield pb.StreamRequest(commit=pb.Commit(send_time_ns=now_ns)).SerializeToString()

    def lost(self) -> None:
        """The stream has ended."""
        self.open = False
        again = list(self._again)
        self._again.clear()
        if self._current is not None:
            again.insert(0, self._current)
            self._current = None
        # In the order in which they were sent: those on their way are older than what is sent again after them.
        self._on_way.extend(again)

    def forget_resume(self) -> bool:
        """The server does not know the token. True: there was one, so opening without it may go well."""
        had, self._resume_token = bool(self._resume_token), b""
        return had

    def fail(self, reason: str) -> None:
        """There will be no other stream."""
        self.open = False
        while self.outbox.pop() is not None:
            pass
        self._on_way.clear()
        self._again.clear()
        self._current = None
        self._rebuilt = []
        self.book.give_up(self.book.open_frames(), reason)

    @property
    def resume_token(self) -> bytes:
        return self._resume_token
