"""The queue of commits to send, subject to the flow policy and to size limits. Pure: no threads, no clock."""
from __future__ import annotations

from collections import deque
from typing import Deque, Optional, Sequence

from .operations import ClearAll, ClearLayer, DeleteId, Immediate, Move, Operation, Puts, Unit, weigh

RELIABLE, LATEST, DROP_OLDEST = "reliable", "latest", "drop_oldest"


class Outbox:
    """First in, first out. Of the waiting immediate frames of one layer, LATEST keeps the newest, DROP_OLDEST the `keep`
    newest, and RELIABLE all. Retained operations always wait.

    A unit that a policy leaves without any operation is dropped as a whole; one that holds something else keeps its commit.
    Timed commits and those that must be shown (must_show) are never dropped.
    """

    def __init__(self, policy: str = RELIABLE, keep: int = 1, limit_bytes: int = 256 << 20) -> None:
        self._keep = {RELIABLE: 0, LATEST: 1, DROP_OLDEST: keep}[policy]
        self._limit = limit_bytes
        self._units: Deque[Unit] = deque()
        self._frames: dict[str, Deque[tuple[Unit, Immediate]]] = {}
        self.bytes = 0
        self.dropped_frames = 0    # since the beginning
        self.unreported_drops = 0  # not yet told with a commit
        self.merged_operations = 0 # retained ones that newer ones made needless, taken out for want of room

    def __len__(self) -> int:
        return len(self._units)

    def units(self) -> list[Unit]:
        return list(self._units)

    def push(self, unit: Unit, newest_only: bool = False) -> Optional[list[Unit]]:
        """Adds `unit`, and returns the units dropped for it. None: there was not enough room, and nothing has changed.
        `newest_only` (set while disconnected): if room is needed, keep only the newest frame of each layer, whatever the
        policy."""
        room = self._limit - unit.bytes
        keep = {layer: 1 for layer in self._frames} if newest_only and self.bytes > room else {}
        for operation in unit.operations if unit.droppable else ():
            if isinstance(operation, Immediate) and (self._keep or operation.layer in keep):
                keep[operation.layer] = max(self._keep - 1, 0)
        if self.bytes - self._given_up(keep) > room:
            self._merge(unit, room + self._given_up(keep))
        if self.bytes - self._given_up(keep) > room and self._units:
            return None
        gone: list[Unit] = []
        for layer, most in keep.items():
            gone += self._leave(layer, most)
        self._units.append(unit)
        self.bytes += unit.bytes
        for operation in list(unit.operations) if unit.droppable else ():
            if isinstance(operation, Immediate):
                self._frames.setdefault(operation.layer, deque()).append((unit, operation))
                if self._keep:
                    # One unit may hold several frames of one layer.
                    gone += self._leave(operation.layer, self._keep)
        return gone

    def pop(self) -> Optional[Unit]:
        """Removes and returns the oldest unit; from now on it is in flight, and no policy may drop it."""
        if not self._units:
            return None
        unit = self._units.popleft()
        self.bytes -= unit.bytes
        for operation in unit.operations if unit.droppable else ():
            if isinstance(operation, Immediate):
                waiting = self._frames[operation.layer]
                waiting.popleft()
                if not waiting:
                    del self._frames[operation.layer]
        return unit

    def take_unreported(self) -> int:
        drops, self.unreported_drops = self.unreported_drops, 0
        return drops

    def _given_up(self, keep: dict[str, int]) -> int:
        """Returns the bytes that are freed if so many frames of each layer are kept."""
        total = 0
        for layer, most in keep.items():
            waiting = self._frames.get(layer, deque())
            total += sum(frame.size() for _, frame in list(waiting)[:max(len(waiting) - most, 0)])
        return total

    def _leave(self, layer: str, keep: int) -> list[Unit]:
        """Drops all but the `keep` newest frames of `layer`; returns the units that have nothing left."""
        waiting = self._frames.get(layer, deque())
        emptied = []
        while len(waiting) > keep:
            unit, frame = waiting.popleft()
            unit.operations.remove(frame)
            unit.frame.client_dropped_frames += 1
            self.dropped_frames += 1
            self.unreported_drops += 1
            self._reweigh(unit)
            if not unit.operations:
                self._units.remove(unit)
                self.bytes -= unit.bytes
                emptied.append(unit)
        if not waiting:
            self._frames.pop(layer, None)
        return emptied

    def _reweigh(self, unit: Unit) -> None:
        before = unit.bytes
        unit.weigh()
        self.bytes += unit.bytes - before

    def _merged(self, newest: Unit) -> list[tuple[Unit, list[Operation]]]:
        """Returns the units that can do without some retained puts and moves, because something later, perhaps `newest`,
        replaces those completely; and the operations left in each. The resulting scene is the same. Timed commits take effect
        at another time: they stay unchanged, and replace nothing; units that must be shown lose nothing."""
        result: list[tuple[Unit, list[Operation]]] = []
        seen: set[tuple[str, str]] = set()
        whole_layers: set[str] = set()
        everything = False

        def needless(layer: str, id: str) -> bool:
            return everything or layer in whole_layers or (layer, id) in seen

        for unit in (newest, *reversed(self._units)):
            if unit.timed:
                continue
            kept: list[Operation] = []
            changed = False
            for operation in reversed(unit.operations):
                if isinstance(operation, Puts):
                    left = [p for p in operation.puts if not needless(p.layer, p.id)]
                    seen.update((p.layer, p.id) for p in operation.puts)
                    if len(left) < len(operation.puts):
                        changed = True
                        operation = Puts(left)
                        if not left:
                            continue
                elif isinstance(operation, Move):
                    if needless(operation.layer, operation.id):
                        changed = True
                        continue
                elif isinstance(operation, DeleteId):
                    seen.add((operation.layer, operation.id))
                elif isinstance(operation, (ClearLayer, Immediate)):
                    whole_layers.add(operation.layer)
                elif isinstance(operation, ClearAll):
                    everything = True
                kept.append(operation)
            if changed and unit.droppable:
                result.append((unit, kept[::-1]))
        return result

    def _merge(self, newest: Unit, room: int) -> None:
        """Merges if that frees enough room."""
        merged = self._merged(newest)
        weight = sum(weigh(operations) - unit.bytes for unit, operations in merged if unit is not newest)
        if self.bytes + weight > room:
            return
        for unit, operations in merged:
            self.merged_operations += _count(unit.operations) - _count(operations)
            unit.operations = operations
            if unit is newest:
                unit.weigh()
            else:
                self._reweigh(unit)


def _count(operations: Sequence[Operation]) -> int:
    return sum(len(o.puts) if isinstance(o, Puts) else 1 for o in operations)
