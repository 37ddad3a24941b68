"""Maps names to entities: a large array is sent as several entities, and remains one thing to the caller."""
from __future__ import annotations

import re
from typing import Callable, Iterator, Optional

from .errors import InvalidValue

# Separates a name from a piece's number. Names that end this way are refused: they could be another name's pieces.
MARK = "\u00a7"  # §
_TAKEN = re.compile(f"{MARK}[0-9]+$")


def free_name(name: str) -> str:
    """Returns `name` if no piece of another name can have it."""
    if _TAKEN.search(name):
        raise InvalidValue(f"the name {name!r} ends as pieces of large arrays do ({MARK} and a number); give another")
    return name


def ids(name: str, pieces: int) -> list[str]:
    return [name] if pieces == 1 else [f"{name}{MARK}{i}" for i in range(pieces)]


class _Name:
    """`pieces` is the number of pieces now, as requested so far. Up to `most` may exist, and `single` says whether the one
    without a number may: removed pieces count until the server has accepted the removal."""

    __slots__ = ("pieces", "most", "single", "version")

    def __init__(self) -> None:
        self.pieces = 1
        self.most = 0
        self.single = True
        self.version = 0

    def usual(self) -> bool:
        return self.pieces == 1 and self.most == 0

    def only(self) -> None:
        self.single, self.most = self.pieces == 1, 0 if self.pieces == 1 else self.pieces

    def copy(self) -> "_Name":
        other = _Name()
        other.pieces, other.most, other.single, other.version = self.pieces, self.most, self.single, self.version
        return other


_Key = tuple[str, str]


class Pieces:
    """The pieces of every (layer, name). A Draft changes them, all at once or not at all. For one thread at a time."""

    def __init__(self) -> None:
        self._names: dict[_Key, _Name] = {}
        self._version = 0

    def draft(self) -> "Draft":
        self._version += 1
        return Draft(self, self._version)

    def __len__(self) -> int:
        return len(self._names)


class Draft:
    """The changes that one commit makes to the pieces."""

    def __init__(self, base: Pieces, version: int) -> None:
        self._base = base
        self._version = version
        self._changed: dict[_Key, _Name] = {}

    def _of(self, layer: str, name: str) -> _Name:
        key = layer, name
        held = self._changed.get(key)
        if held is None:
            before = self._base._names.get(key)
            held = _Name() if before is None else before.copy()
        return held

    def _change(self, layer: str, name: str) -> _Name:
        held = self._changed[layer, name] = self._of(layer, name)
        held.version = self._version
        return held

    def now(self, layer: str, name: str) -> list[str]:
        """Returns the name's current ids."""
        return ids(name, self._of(layer, name).pieces)

    def put(self, layer: str, name: str, pieces: int) -> list[str]:
        """Sets the number of pieces. Returns the ids to delete."""
        held = self._of(layer, name)
        if pieces == 1 and held.usual():
            return []
        held = self._change(layer, name)
        held.pieces = pieces
        first = 0 if pieces == 1 else pieces
        gone = [f"{name}{MARK}{i}" for i in range(first, held.most)]
        if pieces != 1 and held.single:
            gone.append(name)
        held.single = held.single or pieces == 1
        held.most = max(held.most, 0 if pieces == 1 else pieces)
        return gone

    def remove(self, layer: str, name: str) -> list[str]:
        """Removes the name. Returns the ids to delete."""
        held = self._of(layer, name)
        if held.usual():
            return [name]
        held = self._change(layer, name)
        held.pieces = 1
        return [*([name] if held.single else []), *(f"{name}{MARK}{i}" for i in range(held.most))]

    def clear(self, layer: Optional[str]) -> None:
        """Notes that all entities of a layer, or of all layers, are deleted by another operation."""
        for key in {*self._base._names, *self._changed}:
            if layer is None or key[0] == layer:
                self._change(*key).pieces = 1

    def keep(self) -> Callable[[], None]:
        """Applies the changes; call the returned function when the server has accepted the commit."""
        names = self._base._names
        for key, held in self._changed.items():
            names[key] = held

        def accepted() -> None:
            for key in self._keys():
                held = names[key]
                held.only()
                if held.usual():
                    del names[key]

        return accepted

    def _keys(self) -> Iterator[_Key]:
        """Yields the names that no later commit has changed."""
        for key in self._changed:
            held = self._base._names.get(key)
            if held is not None and held.version == self._version:
                yield key
