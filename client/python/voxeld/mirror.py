"""The scene as the server has accepted it from this client, as wire bytes, for sending it again to a server that has lost it.

It shares its bytes with what was sent. It keeps only the newest state of each entity, layer and object, and no expired
entities.
"""
from __future__ import annotations

import heapq
from typing import AbstractSet, Iterator, Optional, Sequence, Union

from . import wire
from .v1 import primitives_pb2
from .v1 import scene_pb2 as pb


class _Entity:
    __slots__ = ("put", "moved", "gone_at_ns")

    def __init__(self, put: wire.Put, gone_at_ns: int) -> None:
        self.put = put
        self.moved: Optional[bytes] = None  # a later SetTransform
        self.gone_at_ns = gone_at_ns        # 0: never


class _Layer:
    __slots__ = ("state", "entities")

    def __init__(self) -> None:
        self.state: Optional[pb.LayerState] = None
        self.entities: dict[str, _Entity] = {}


class _Object:
    __slots__ = ("request", "uses")

    def __init__(self, request: bytes, uses: AbstractSet[str]) -> None:
        self.request = request
        self.uses = uses  # objects that it has instances of


class Mirror:
    def __init__(self) -> None:
        self._layers: dict[str, _Layer] = {}    # in the order of their creation
        self._objects: dict[str, _Object] = {}
        self._ends: list[tuple[int, str, str]] = []  # a heap: when which entity goes; or went, by something else

    def _layer(self, name: str) -> _Layer:
        layer = self._layers.get(name)
        if layer is None:
            layer = self._layers[name] = _Layer()
        return layer

    def put(self, put: wire.Put, gone_at_ns: int = 0) -> None:
        self._layer(put.layer).entities[put.id] = _Entity(put, gone_at_ns)
        if gone_at_ns:
            heapq.heappush(self._ends, (gone_at_ns, put.layer, put.id))
            if len(self._ends) > 64 and len(self._ends) > 4 * len(self):
                self._ends = [(e.gone_at_ns, name, id) for name, layer in self._layers.items()
                              for id, e in layer.entities.items() if e.gone_at_ns]
                heapq.heapify(self._ends)

    def purge(self, now_ns: int) -> None:
        """Forgets expired entities."""
        while self._ends and self._ends[0][0] <= now_ns:
            at, name, id = heapq.heappop(self._ends)
            layer = self._layers.get(name)
            entity = None if layer is None else layer.entities.get(id)
            if layer is not None and entity is not None and entity.gone_at_ns == at:
                del layer.entities[id]

    def move(self, layer: str, id: str, request: bytes) -> None:
        held = self._layers.get(layer)
        entity = None if held is None else held.entities.get(id)
        if entity is not None:
            entity.moved = request

    def delete(self, layer: str, ids: Sequence[str]) -> None:
        held = self._layers.get(layer)
        for id in ids if held is not None else ():
            held.entities.pop(id, None)  # type: ignore[union-attr]

    def clear_layer(self, layer: str, make: bool = False) -> None:
        """`make`: a frame creates the layer; a deletion does not."""
        held = self._layer(layer) if make else self._layers.get(layer)
        if held is not None:
            held.entities.clear()

    def clear(self) -> None:
        """Delete.all_mine also removes the layers with their properties."""
        self._layers.clear()

    def layer_state(self, state: pb.LayerState) -> None:
        layer = self._layer(state.layer)
        if layer.state is None:
            layer.state = pb.LayerState()
        for field, _ in state.ListFields():
            layer.state.ClearField(field.name)
        layer.state.MergeFrom(state)

    def define(self, name: str, request: bytes, uses: AbstractSet[str] = frozenset()) -> None:
        self._objects[name] = _Object(request, uses)

    def undefine(self, name: str, cascade: bool = False) -> None:
        self._objects.pop(name, None)
        if not cascade:
            return  # it had no instances
        for layer in self._layers.values():
            for id in [id for id, entity in layer.entities.items() if entity.put.uses == name]:
                del layer.entities[id]
        for held in self._objects.values():
            if name in held.uses:
                held.request = _without(held.request, name)
                held.uses = held.uses - {name}

    def __len__(self) -> int:
        return sum(len(layer.entities) for layer in self._layers.values())

    def restore(self, now_ns: int) -> Iterator[Union[bytes, wire.Put, None]]:
        """Yields what turns an empty scene into this one: objects before those that use them, then layer after layer in the
        order of their creation; and last, after None, instances of objects that were not defined here, which may be refused."""
        self.purge(now_ns)
        yield from self._definitions()
        unknown: list[_Entity] = []
        for name, layer in self._layers.items():
            # Emitted even if it sets nothing: it creates the layer in the right order.
            state = pb.LayerState(layer=name) if layer.state is None else layer.state
            yield pb.StreamRequest(layer_state=state).SerializeToString()
            for entity in layer.entities.values():
                if entity.put.uses and entity.put.uses not in self._objects:
                    unknown.append(entity)
                else:
                    yield from _again(entity, now_ns)
        if unknown:
            yield None
        for entity in unknown:
            yield from _again(entity, now_ns)

    def _definitions(self) -> Iterator[bytes]:
        done: set[str] = set()

        def one(name: str) -> Iterator[bytes]:
            held = self._objects.get(name)
            if held is None or name in done:
                return
            done.add(name)
            for used in sorted(held.uses):
                yield from one(used)
            yield held.request

        for name in self._objects:
            yield from one(name)


def _again(entity: _Entity, now_ns: int) -> Iterator[Union[bytes, wire.Put]]:
    yield entity.put if not entity.gone_at_ns else entity.put.with_lifetime(entity.gone_at_ns - now_ns)
    if entity.moved is not None:
        yield entity.moved


def _without(definition: bytes, name: str) -> bytes:
    whole = pb.StreamRequest.FromString(definition).define_object
    parts = [part for part in whole.definition.parts if part.primitive.instance.object != name]
    left = pb.DefineObject(object=whole.object, definition=primitives_pb2.Object(parts=parts))
    return pb.StreamRequest(define_object=left).SerializeToString()
