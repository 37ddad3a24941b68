"""Encodes bulk content as wire bytes without protobuf's copies.

A message whose payloads are last at every level consists of a short head, known once the sizes are, followed by the arrays
themselves: `Packed`. Wrapping it into the next outer message only makes the head longer; one join at the end copies
everything once. Heads are made of generated messages, so the field numbers of their content are only in the .proto
files; the numbers of the wrapping fields are below.
"""
from __future__ import annotations

from typing import Iterator, Optional, Sequence, Union

import numpy as np
from google.protobuf.message import Message

from .arrays import Array
from .v1 import primitives_pb2, scene_pb2

Buffer = Union[bytes, memoryview]

_BYTES = 2  # the wire type of everything that has a length


def varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def _key(number: int) -> bytes:
    return varint(number << 3 | _BYTES)


class Field:
    """Keys of the fields that wrap payloads, from the generated messages' own numbers."""

    UPSERT = _key(scene_pb2.StreamRequest.UPSERT_FIELD_NUMBER)
    BATCH = _key(scene_pb2.StreamRequest.BATCH_FIELD_NUMBER)
    UPSERTS = _key(scene_pb2.Batch.UPSERTS_FIELD_NUMBER)
    ENTITY = _key(scene_pb2.Upsert.ENTITY_FIELD_NUMBER)
    PRIMITIVE = _key(scene_pb2.Entity.PRIMITIVE_FIELD_NUMBER)
    PART = _key(primitives_pb2.Object.PARTS_FIELD_NUMBER)
    PART_PRIMITIVE = _key(primitives_pb2.Object.Part.PRIMITIVE_FIELD_NUMBER)
    DEFINE_OBJECT = _key(scene_pb2.StreamRequest.DEFINE_OBJECT_FIELD_NUMBER)
    DEFINITION = _key(scene_pb2.DefineObject.DEFINITION_FIELD_NUMBER)
    KINDS = {
        "points": _key(primitives_pb2.Primitive.POINTS_FIELD_NUMBER),
        "segments": _key(primitives_pb2.Primitive.SEGMENTS_FIELD_NUMBER),
        "mesh": _key(primitives_pb2.Primitive.MESH_FIELD_NUMBER),
        "curve": _key(primitives_pb2.Primitive.CURVE_FIELD_NUMBER),
        "bezier_surface": _key(primitives_pb2.Primitive.BEZIER_SURFACE_FIELD_NUMBER),
    }
    INDICES = _key(primitives_pb2.Vertices.INDICES_FIELD_NUMBER)
    COLORS = _key(primitives_pb2.Vertices.COLORS_FIELD_NUMBER)
    POSITIONS = _key(primitives_pb2.Vertices.POSITIONS_FIELD_NUMBER)
    VERTICES = {
        "points": _key(primitives_pb2.Points.VERTICES_FIELD_NUMBER),
        "segments": _key(primitives_pb2.Segments.VERTICES_FIELD_NUMBER),
        "mesh": _key(primitives_pb2.Mesh.VERTICES_FIELD_NUMBER),
        "curve": _key(primitives_pb2.Curve.VERTICES_FIELD_NUMBER),
        "bezier_surface": _key(primitives_pb2.BezierSurface.VERTICES_FIELD_NUMBER),
    }


class Packed:
    """A message: `head`, then `tail` as it lies in memory. It becomes invalid once an array in the tail has changed."""

    __slots__ = ("head", "tail", "tail_size")

    def __init__(self, head: bytes, tail: Sequence[Buffer] = (), tail_size: int = 0) -> None:
        self.head = head
        self.tail = tail
        self.tail_size = tail_size

    def __len__(self) -> int:
        return len(self.head) + self.tail_size

    def inside(self, key: bytes, before: bytes = b"") -> "Packed":
        """Returns the message that has this one as its field `key`, after the fields in `before`."""
        return Packed(before + key + varint(len(self)) + self.head, self.tail, self.tail_size)

    def to_bytes(self) -> bytes:
        """Returns the bytes; this is the only copy."""
        return b"".join((self.head, *self.tail)) if self.tail else self.head


def payload(array: Array) -> memoryview:
    """Returns the bytes of a C-contiguous array, without a copy."""
    return np.ravel(array).view(np.uint8).data


def vertices(positions: Array, position_type: primitives_pb2.ElementType,
             colors: Optional[Array] = None, indices: Optional[Array] = None, *, of_elements: bool = False) -> Packed:
    """Encodes vertices. `colors` is (n, 3) or (n, 4) uint8, one per segment or triangle if `of_elements`; `indices` is uint32."""
    head = primitives_pb2.Vertices(count=len(positions), position_type=position_type)
    parts: list[tuple[bytes, memoryview]] = []
    if indices is not None:
        head.index_type = primitives_pb2.ELEMENT_TYPE_U32
        head.index_count = indices.size
        parts.append((Field.INDICES, payload(indices)))
    if colors is not None:
        wide = colors.shape[1] == 4
        head.color_type = primitives_pb2.ELEMENT_TYPE_RGBX8 if wide else primitives_pb2.ELEMENT_TYPE_RGB8
        if of_elements:
            head.colors_of = primitives_pb2.Vertices.ELEMENTS
        parts.append((Field.COLORS, payload(colors)))
    parts.append((Field.POSITIONS, payload(positions)))
    tail: list[Buffer] = []
    size = 0
    for key, data in parts:
        prefix = key + varint(len(data))
        tail += (prefix, data)
        size += len(prefix) + len(data)
    return Packed(head.SerializeToString(), tail, size)


def message(content: Message) -> Packed:
    return Packed(content.SerializeToString())


class Put:
    """An upsert as a complete StreamRequest; its Upsert begins at `start`. `uses`: the object that it is an instance of.
    `lifetime_ns`: how long it stays, as the request says; 0: without limit."""

    __slots__ = ("layer", "id", "request", "start", "uses", "lifetime_ns")

    def __init__(self, layer: str, id: str, request: bytes, start: int, uses: str = "", lifetime_ns: int = 0) -> None:
        self.layer = layer
        self.id = id
        self.request = request
        self.start = start
        self.uses = uses
        self.lifetime_ns = lifetime_ns

    def with_lifetime(self, lifetime_ns: int) -> "Put":
        """Returns the same with another lifetime."""
        request = scene_pb2.StreamRequest.FromString(self.request)
        request.upsert.entity.lifetime_ns = lifetime_ns
        content = Packed(request.upsert.SerializeToString())
        whole = content.inside(Field.UPSERT)
        return Put(self.layer, self.id, whole.to_bytes(), len(whole) - len(content), self.uses, lifetime_ns)


def put(layer: str, id: str, entity: bytes, primitive: Packed, uses: str = "", lifetime_ns: int = 0) -> Put:
    """Encodes an upsert of `primitive` under (layer, id). `entity`: an Entity's other fields, serialised."""
    upsert = primitive.inside(Field.PRIMITIVE, entity).inside(
        Field.ENTITY, scene_pb2.Upsert(layer=layer, id=id).SerializeToString())
    request = upsert.inside(Field.UPSERT)
    return Put(layer, id, request.to_bytes(), len(request) - len(upsert), uses, lifetime_ns)


# Upserts of at least this size are sent alone, unchanged; consecutive smaller ones fill a batch up to the second limit.
ALONE_BYTES = 64 << 10
BATCH_BYTES = 1 << 20


def runs(puts: Sequence[Put], most_bytes: int = BATCH_BYTES) -> Iterator[Sequence[Put]]:
    """Splits `puts`, in their order, into messages: none above `most_bytes` except a single put that is larger."""
    waiting: list[Put] = []
    size = 0
    for one in puts:
        length = len(one.request) + 8
        if waiting and (size + length + 8 > most_bytes or length >= ALONE_BYTES):
            yield waiting
            waiting, size = [], 0
        waiting.append(one)
        size += length
        if length >= ALONE_BYTES:
            yield waiting
            waiting, size = [], 0
    if waiting:
        yield waiting


def together(puts: Sequence[Put]) -> bytes:
    """Returns one request that adds all of them."""
    if len(puts) == 1:
        return puts[0].request
    tail: list[Buffer] = []
    for one in puts:
        content = memoryview(one.request)[one.start:]
        tail += (Field.UPSERTS + varint(len(content)), content)
    total = sum(len(part) for part in tail)
    return Packed(Field.BATCH + varint(total), tail, total).to_bytes()
