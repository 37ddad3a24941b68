"""The scene as this client has sent it, as wire bytes: what a server that knows nothing of it any more is told again.

It shares its bytes with what was sent; of each entity, layer and object it keeps the newest alone.
"""
from __future__ import annotations

from typing import Iterator, Optional, Sequence

from . import wire
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


class Mirror:
    def __init__(self) -> None:
        self._layers: dict[str, _Layer] = {}
        self._objects: dict[str, bytes] = {}

    def _layer(self, name: str) -> _Layer:
        return self._layers.setdefault(name, _Layer())

    def put(self, put: wire.Put, gone_at_ns: int = 0) -> None:
        self._layer(put.layer).entities[put.id] = _Entity(put, gone_at_ns)

    def move(self, layer: str, id: str, request: bytes) -> None:
        entity = self._layer(layer).entities.get(id)
        if entity is not None:
            entity.moved = request

    def delete(self, layer: str, ids: Sequence[str]) -> None:
        entities = self._layer(layer).entities
        for id in ids:
            entities.pop(id, None)

    def clear_layer(self, layer: str) -> None:
        self._layer(layer).entities.clear()

    def clear(self) -> None:
        for layer in self._layers.values():
            layer.entities.clear()

    def frame(self, layer: str, puts: Sequence[wire.Put], gone_at_ns: Sequence[int]) -> None:
        self.clear_layer(layer)
        for put, gone in zip(puts, gone_at_ns):
            self.put(put, gone)

    def layer_state(self, state: pb.LayerState) -> None:
        layer = self._layer(state.layer)
        if layer.state is None:
            layer.state = pb.LayerState()
        for field, _ in state.ListFields():
            layer.state.ClearField(field.name)
        layer.state.MergeFrom(state)

    def define(self, name: str, request: bytes) -> None:
        self._objects[name] = request

    def undefine(self, name: str) -> None:
        self._objects.pop(name, None)

    def __len__(self) -> int:
        return sum(len(layer.entities) for layer in self._layers.values())

    def requests(self, now_ns: int) -> Iterator[bytes]:
        """What makes an empty scene this one. Entities whose time is over are left out."""
        yield from self._objects.values()
        for layer in self._layers.values():
            if layer.state is not None:
                yield pb.StreamRequest(layer_state=layer.state).SerializeToString()
        for layer in self._layers.values():
            alive = [e for e in layer.entities.values() if not e.gone_at_ns or e.gone_at_ns > now_ns]
            yield from wire.batched([e.put for e in alive])
            for entity in alive:
                if entity.moved is not None:
                    yield entity.moved
