"""The properties that every entity has besides its shape."""
from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Optional

import numpy.typing as npt

from . import transforms
from .arrays import number
from .errors import InvalidValue
from .transforms import Matrix
from .v1 import scene_pb2 as pb


@dataclass(frozen=True)
class Look:
    """The properties that every entity has besides its shape."""

    transform: Optional[Matrix] = None
    priority: int = 0
    erase: bool = False
    lifetime: Optional[float] = None  # s
    label: str = ""

    @staticmethod
    def of(transform: Optional[npt.ArrayLike] = None, priority: int = 0, erase: bool = False,
           lifetime: Optional[float] = None, label: str = "") -> "Look":
        if not (isinstance(priority, int) and 0 <= priority <= 126):
            raise InvalidValue(f"priority is {priority!r}; give a whole number from 0 to 126, the higher wins")
        if lifetime is not None:
            number(lifetime, "lifetime", above=0)
        return Look(None if transform is None else transforms.as_matrix(transform), priority, bool(erase), lifetime, label)

    def changed(self, **new: Any) -> "Look":
        look = replace(self, **new)
        return Look.of(look.transform, look.priority, look.erase, look.lifetime, look.label)

    @property
    def lifetime_ns(self) -> int:
        return 0 if self.lifetime is None else max(int(self.lifetime * 1e9), 1)

    def to_bytes(self) -> bytes:
        return pb.Entity(
            transform=None if self.transform is None else transforms.to_wire(self.transform), priority=self.priority,
            erase=self.erase, lifetime_ns=self.lifetime_ns, label=self.label).SerializeToString()
