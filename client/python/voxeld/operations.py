"""Operations as this client keeps them: their wire bytes, and their effect on the mirror."""
from __future__ import annotations

from dataclasses import dataclass
from typing import AbstractSet, Callable, Iterable, Iterator, Optional, Sequence, Union

from . import wire
from .mirror import Mirror
from .receipts import Frame, Issue
from .v1 import scene_pb2 as pb

# Size of a commit besides its operations, in this process and on the wire.
COMMIT_BYTES = 64


@dataclass
class Puts:
    """Entities that are added or replaced."""

    puts: Sequence[wire.Put]

    def size(self) -> int:
        return sum(len(p.request) for p in self.puts)

    def largest(self) -> int:
        return max((len(p.request) for p in self.puts), default=0)

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        for one in self.puts:
            mirror.put(one, now_ns + one.lifetime_ns if one.lifetime_ns else 0)


@dataclass
class Request:
    """Any single request; the mirror ignores it unless a subclass says how to apply it."""

    request: bytes

    def size(self) -> int:
        return len(self.request)

    def largest(self) -> int:
        return len(self.request)

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        pass


@dataclass
class Move(Request):
    layer: str
    id: str

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        mirror.move(self.layer, self.id, self.request)


@dataclass
class DeleteId(Request):
    layer: str
    id: str

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        mirror.delete(self.layer, [self.id])


@dataclass
class ClearLayer(Request):
    layer: str

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        mirror.clear_layer(self.layer)


class ClearAll(Request):
    def apply(self, mirror: Mirror, now_ns: int) -> None:
        mirror.clear()


@dataclass
class LayerState(Request):
    state: pb.LayerState

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        mirror.layer_state(self.state)


@dataclass
class Define(Request):
    name: str
    uses: AbstractSet[str]

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        mirror.define(self.name, self.request, self.uses)


@dataclass
class Undefine(Request):
    name: str
    cascade: bool

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        mirror.undefine(self.name, self.cascade)


class Immediate:
    """A frame: replaces the content of its layer. The only operation that a flow policy may drop."""

    __slots__ = ("layer", "parts")

    def __init__(self, layer: str, parts: Sequence[Puts]) -> None:
        self.layer = layer
        self.parts = parts

    def size(self) -> int:
        return sum(p.size() for p in self.parts) + 64

    def largest(self) -> int:
        return max((p.largest() for p in self.parts), default=0)

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        mirror.clear_layer(self.layer, make=True)
        for part in self.parts:
            part.apply(mirror, now_ns)


Operation = Union[Puts, Request, Immediate]


class _Begin(Request):
    """FrameBegin of a layer, together with the layer's name."""

    def __init__(self, layer: str) -> None:
        super().__init__(pb.StreamRequest(frame_begin=pb.FrameBegin(layer=layer)).SerializeToString())
        self.layer = layer


class _End(Request):
    def __init__(self, layer: str) -> None:
        super().__init__(pb.StreamRequest(frame_end=pb.FrameEnd(layer=layer)).SerializeToString())
        self.layer = layer


def weigh(operations: Iterable[Operation]) -> int:
    return COMMIT_BYTES + sum(o.size() for o in operations)


class Refused:
    """The operations of a commit that were refused, from its issues."""

    def __init__(self, issues: Iterable[Issue]) -> None:
        self._where = {(issue.sequence, issue.layer, issue.id) for issue in issues}
        self._sequences = {issue.sequence for issue in issues}

    def has(self, sequence: int) -> bool:
        return sequence in self._sequences

    def has_put(self, sequence: int, put: wire.Put) -> bool:
        """In a batch, single entities may be refused; an issue without a layer refers to the whole request, one without an id
        to the whole layer."""
        return sequence in self._sequences and any(
            (sequence, layer, id) in self._where for layer, id in ((put.layer, put.id), (put.layer, ""), ("", "")))


class Unit:
    """A commit and the operations before it. `bytes` is its size in the buffer, `largest` the size of its largest message that
    cannot be made smaller."""

    __slots__ = ("frame", "operations", "commit", "bytes", "largest", "drops", "sequences", "commit_sequence", "issues",
                 "restores", "on_accepted", "_most")

    def __init__(self, frame: Frame, operations: Iterable[Operation], commit: pb.Commit,
                 on_accepted: Optional[Callable[[], None]] = None, restores: bool = False) -> None:
        self.frame = frame
        self.operations = list(operations)
        self.commit = commit
        self.on_accepted = on_accepted
        self.restores = restores  # it sends accepted content again
        self.drops = 0            # frames given up before it was sent: what its commit reports
        self.weigh()
        self.forget_sending()

    def forget_sending(self) -> None:
        """Prepares for sending it again from the beginning."""
        self.sequences: list[int] = []  # of its requests, as sent
        self.commit_sequence = 0        # not 0: it was sent completely
        self.issues: list[Issue] = []
        self._most = wire.BATCH_BYTES

    def weigh(self) -> None:
        self.bytes = weigh(self.operations)
        self.largest = max((operation.largest() for operation in self.operations), default=0)

    @property
    def timed(self) -> bool:
        return self.commit.present_at_ns != 0

    @property
    def droppable(self) -> bool:
        """Whether a flow policy may drop its frames."""
        return not self.commit.must_show and not self.commit.durable and not self.timed

    def _messages(self) -> Iterator[Union[Sequence[wire.Put], Request]]:
        """Yields all messages except the commit. Consecutive puts share messages."""
        run: list[wire.Put] = []
        for operation in self.operations:
            if isinstance(operation, Puts):
                run += operation.puts
                continue
            yield from wire.runs(run, self._most)
            run = []
            if isinstance(operation, Request):
                yield operation
                continue
            yield _Begin(operation.layer)
            yield from wire.runs([p for part in operation.parts for p in part.puts], self._most)
            yield _End(operation.layer)
        yield from wire.runs(run, self._most)

    def requests(self, most_bytes: int = wire.BATCH_BYTES) -> Iterator[bytes]:
        """Yields all requests except the commit; batches have at most `most_bytes`."""
        self._most = most_bytes
        for message in self._messages():
            yield message.request if isinstance(message, Request) else wire.together(message)

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        """Applies the accepted commit to the mirror, except what its issues say was refused."""
        mirror.purge(now_ns)
        refusals = [issue for issue in self.issues if not issue.applied]
        if not refusals:
            for operation in self.operations:
                operation.apply(mirror, now_ns)
            return
        refused = Refused(refusals)
        frame: Optional[Immediate] = None  # that has begun, with what was taken of it
        for message, sequence in zip(self._messages(), self.sequences):
            if isinstance(message, _Begin):
                frame = None if refused.has(sequence) else Immediate(message.layer, [])
            elif isinstance(message, _End):
                if frame is not None and not refused.has(sequence):
                    frame.apply(mirror, now_ns)
                frame = None
            elif isinstance(message, Request):
                if not refused.has(sequence):
                    message.apply(mirror, now_ns)
            else:
                taken = Puts([put for put in message if not refused.has_put(sequence, put)])
                if frame is not None:
                    frame.parts = [*frame.parts, taken]
                else:
                    taken.apply(mirror, now_ns)


def delete_id(layer: str, id: str) -> DeleteId:
    return DeleteId(pb.StreamRequest(delete=pb.Delete(layer=layer, id=id)).SerializeToString(), layer, id)


def clear_layer(layer: str) -> ClearLayer:
    return ClearLayer(pb.StreamRequest(delete=pb.Delete(layer=layer, all_of_layer=True)).SerializeToString(), layer)


def clear_all() -> ClearAll:
    return ClearAll(pb.StreamRequest(delete=pb.Delete(all_mine=True)).SerializeToString())


def move(layer: str, id: str, transform: Sequence[float]) -> Move:
    request = pb.StreamRequest(set_transform=pb.SetTransform(layer=layer, id=id))
    request.set_transform.transform.m.extend(transform)
    return Move(request.SerializeToString(), layer, id)


def layer_state(state: pb.LayerState) -> LayerState:
    return LayerState(pb.StreamRequest(layer_state=state).SerializeToString(), state)


def define(name: str, parts: Iterable[wire.Packed], uses: AbstractSet[str] = frozenset()) -> Define:
    """`parts` are Object.Part messages; `uses` are the objects that some of them are instances of."""
    tail: list[wire.Buffer] = []
    for part in parts:
        wrapped = part.inside(wire.Field.PART)
        tail += (wrapped.head, *wrapped.tail)
    content = wire.Packed(b"", tail, sum(len(t) for t in tail))
    whole = content.inside(wire.Field.DEFINITION, pb.DefineObject(object=name).SerializeToString()).inside(
        wire.Field.DEFINE_OBJECT)
    return Define(whole.to_bytes(), name, uses)


def undefine(name: str, cascade: bool) -> Undefine:
    return Undefine(
        pb.StreamRequest(delete_object=pb.DeleteObject(object=name, cascade=cascade)).SerializeToString(), name, cascade)


def restoring(mirror: Mirror, now_ns: int) -> Iterator[Optional[Operation]]:
    """Yields what restores the mirror's scene, whatever the server has left of it. None: a new commit starts here."""
    yield clear_all()
    for one in mirror.restore(now_ns):
        yield one if one is None else Request(one) if isinstance(one, bytes) else Puts([one])


def parted(all_of_it: Iterable[Optional[Operation]], most_bytes: int, most_operations: int) -> Iterator[list[Operation]]:
    """Splits the operations into commits of at most the given sizes; none is empty."""
    commit: list[Operation] = []
    size = 0
    for operation in all_of_it:
        if commit and (operation is None or size + operation.size() > most_bytes or len(commit) >= most_operations):
            yield commit
            commit, size = [], 0
        if operation is not None:
            commit.append(operation)
            size += operation.size()
    if commit:
        yield commit
