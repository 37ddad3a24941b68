"""The clip of a layer: parts of the scene; only content inside all of them is drawn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional, Sequence, Union

import numpy.typing as npt

from . import transforms
from .arrays import as_array, number, vector
from .errors import InvalidValue
from .v1 import scene_pb2 as pb
from .v1 import types_pb2


@dataclass(frozen=True)
class ClipBox:
    """A box of `size` around `center`, under a transform (box → scene); all sizes are greater than 0."""

    center: npt.ArrayLike = (0, 0, 0)
    size: npt.ArrayLike = (1, 1, 1)
    transform: Optional[npt.ArrayLike] = None


@dataclass(frozen=True)
class ClipCylinder:
    """A cylinder from `start` to `end` with flat ends; the radius is greater than 0."""

    start: npt.ArrayLike
    end: npt.ArrayLike
    radius: float


# A plane (a, b, c, d) keeps a·x + b·y + c·z + d ≥ 0.
ClipPart = Union[npt.ArrayLike, ClipBox, ClipCylinder]


def _point(value: npt.ArrayLike, name: str) -> types_pb2.Vec3:
    x, y, z = vector(value, name)
    return types_pb2.Vec3(x=x, y=y, z=z)


def _add(part: ClipPart, clip: pb.Clip) -> None:
    if isinstance(part, ClipBox):
        box = clip.boxes.add(center=_point(part.center, "the clip box's center"),
                             size=_point(part.size, "the clip box's size"))
        if part.transform is not None:
            box.transform.CopyFrom(transforms.to_wire(transforms.as_matrix(part.transform)))
        return
    if isinstance(part, ClipCylinder):
        clip.cylinders.add(start=_point(part.start, "the clip cylinder's start"),
                           end=_point(part.end, "the clip cylinder's end"),
                           radius=number(part.radius, "the clip cylinder's radius", above=0))
        return
    four = as_array(part, "clip")
    if four.shape != (4,):
        raise InvalidValue("a part of a clip is a plane, four numbers (a, b, c, d), a ClipBox or a ClipCylinder; got "
                           f"shape {four.shape}")
    a, b, c = vector(four[:3], "the clip plane's normal")
    clip.planes.add(a=a, b=b, c=c, d=number(four[3], "the clip plane's distance"))


def to_wire(parts: Sequence[ClipPart]) -> pb.Clip:
    """Returns the parts as a message. Without parts it removes the layer's clip."""
    clip = pb.Clip()
    for part in parts:
        _add(part, clip)
    return clip
