"""Operations as this client keeps them: wire bytes, and what each does to the mirror."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Iterable, Iterator, Sequence, Union

from . import wire
from .mirror import Mirror
from .receipts import Frame
from .v1 import scene_pb2 as pb


@dataclass
class Puts:
    """Entities put up, or replaced."""

    puts: Sequence[wire.Put]
    lifetime_ns: int = 0

    def size(self) -> int:
        return sum(len(p.request) for p in self.puts)

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        for one in self.puts:
            mirror.put(one, now_ns + self.lifetime_ns if self.lifetime_ns else 0)


@dataclass
class Request:
    """Anything small that the mirror need not know of, or knows by a subclass."""

    request: bytes

    def size(self) -> int:
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

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        mirror.define(self.name, self.request)


@dataclass
class Undefine(Request):
    name: str

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        mirror.undefine(self.name)


class Immediate:
    """A frame: replaces what its layer held. The one kind that a flow policy may give up."""

    __slots__ = ("layer", "parts")

    def __init__(self, layer: str, parts: Sequence[Puts]) -> None:
        self.layer = layer
        self.parts = parts

    def size(self) -> int:
        return sum(p.size() for p in self.parts) + 64

    def apply(self, mirror: Mirror, now_ns: int) -> None:
        mirror.clear_layer(self.layer)
        for part in self.parts:
            part.apply(mirror, now_ns)


Operation = Union[Puts, Request, Immediate]


def weigh(operations: Iterable[Operation]) -> int:
    return 64 + sum(o.size() for o in operations)


class Unit:
    """A commit and the operations before it. `bytes` is what it weighs in the buffer."""

    __slots__ = ("frame", "operations", "commit", "bytes", "drops")

    def __init__(self, frame: Frame, operations: Iterable[Operation], commit: pb.Commit) -> None:
        self.frame = frame
        self.operations = list(operations)
        self.commit = commit
        self.drops = 0  # frames given up before it was sent: what its commit reports
        self.bytes = 0
        self.weigh()

    def weigh(self) -> None:
        self.bytes = weigh(self.operations)

    def requests(self) -> Iterator[bytes]:
        """All but the commit. Puts side by side share batches."""
        run: list[wire.Put] = []
        for operation in self.operations:
            if isinstance(operation, Puts):
                run += operation.puts
                continue
            yield from wire.batched(run)
            run = []
            if isinstance(operation, Request):
                yield operation.request
                continue
            yield pb.StreamRequest(frame_begin=pb.FrameBegin(layer=operation.layer)).SerializeToString()
            yield from wire.batched([p for part in operation.parts for p in part.puts])
            yield pb.StreamRequest(frame_end=pb.FrameEnd(layer=operation.layer)).SerializeToString()
        yield from wire.batched(run)


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


def define(name: str, parts: Iterable[wire.Packed]) -> Define:
    """`parts` are Object.Part messages."""
    tail: list[wire.Buffer] = []
    for part in parts:
        wrapped = part.inside(wire.Field.PART)
        tail += (wrapped.head, *wrapped.tail)
    content = wire.Packed(b"", tail, sum(len(t) for t in tail))
    whole = content.inside(wire.Field.DEFINITION, pb.DefineObject(object=name).SerializeToString()).inside(
        wire.Field.DEFINE_OBJECT)
    return Define(whole.to_bytes(), name)


def undefine(name: str, cascade: bool) -> Undefine:
    return Undefine(
        pb.StreamRequest(delete_object=pb.DeleteObject(object=name, cascade=cascade)).SerializeToString(), name)
