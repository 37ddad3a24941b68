"""The handles that drawing calls return, and the layers, frames and objects to draw in."""
from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING, Any, Optional, Sequence, Type

import numpy as np
import numpy.typing as npt

from . import clip as clips
from . import operations, shapes, transforms, wire
from .arrays import number, vector
from .colors import numbers_each
from .draw import Draw, Look, Make, checked_name
from .errors import InvalidOption, InvalidValue
from .options import LOOK, leading_names, refused
from .pieces import free_name, ids
from .receipts import Accepted, Frame, Issue, Outcome
from .shapes import choice
from .transforms import Matrix
from .v1 import primitives_pb2, types_pb2
from .v1 import scene_pb2 as pb

if TYPE_CHECKING:
    from .base import BaseConnection

_BLENDS = {"over": types_pb2.BLEND_MODE_OVER, "add": types_pb2.BLEND_MODE_ADD, "erase": types_pb2.BLEND_MODE_ERASE}


class Handle:
    """One thing in the scene. Setting `transform`, update() and remove() each send only the change. The arguments of its
    drawing call are kept for update(); arrays are not copied for that."""

    def __init__(self, connection: "BaseConnection", layer: str, name: str, make: Make, args: tuple[Any, ...],
                 options: dict[str, Any], look: Look) -> None:
        self._connection = connection
        self._make, self._args, self._options, self._look = make, args, options, look
        self.layer = layer
        self.name = name
        self.frame: Optional[Frame] = None  # of the last commit, when calls are commits of their own

    def __repr__(self) -> str:
        return f"<{self._make.__name__} {self.name!r} in layer {self.layer!r}>"

    def _put(self) -> "Handle":
        shape = self._make(*self._args, **self._options)
        puts = put_parts(self.layer, self.name, shape, self._look, _uses(self._make, self._args))
        self.frame = self._connection._put(self.layer, self.name, puts)
        return self

    @property
    def transform(self) -> Matrix:
        """The 4×4 matrix. Assign a new one to change it; changing the returned array has no effect."""
        return transforms.identity() if self._look.transform is None else self._look.transform.copy()

    @transform.setter
    def transform(self, matrix: npt.ArrayLike) -> None:
        self._look = self._look.changed(transform=matrix)
        assert self._look.transform is not None
        self.frame = self._connection._move(self.layer, self.name, self._look.transform)

    def update(self, *args: Any, **changes: Any) -> Optional[Frame]:
        """Draws it again with some arguments changed, named as in the drawing call: h.update(positions),
        h.update(colors="red")."""
        call = self._make.__name__
        if len(args) > len(self._args):
            raise InvalidValue(f"{call} takes {len(self._args)} arguments, got {len(args)}")
        leading = leading_names(getattr(Draw, call), len(self._args))
        for key in changes:
            if key in leading[:len(args)]:
                raise InvalidOption(f"update() got {key!r} twice: first by its place")
            if key not in (*leading, *self._options, *LOOK):
                raise refused(call, key, (*leading, *self._options, *LOOK))
        looks = {key: changes.pop(key) for key in LOOK if key in changes}
        named = {key: changes.pop(key) for key in leading if key in changes}
        if "colors" in changes and "cmap" in self._options and "cmap" not in changes and not numbers_each(changes["colors"]):
            changes["cmap"] = None  # it was for the numbers that these colours replace
        before = self._args, self._options, self._look
        self._args = tuple(named.get(key, value) for key, value in zip(leading, (*args, *self._args[len(args):])))
        self._options = {**self._options, **changes}
        try:
            self._look = self._look.changed(**looks)
            self._put()
        except Exception:
            self._args, self._options, self._look = before
            raise
        return self.frame

    def remove(self) -> Optional[Frame]:
        """Removes it from the scene. update() would draw it again."""
        self.frame = self._connection._remove(self.layer, self.name)
        return self.frame

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        return {**self._connection._repr_mimebundle_(include, exclude), "text/plain": repr(self)}


class Layer(Draw[Handle]):
    """Layers are drawn over one another, each with an opacity and a blend mode."""

    def __init__(self, connection: "BaseConnection", name: str) -> None:
        self._connection = connection
        self.name = checked_name(name, "layer")

    def __repr__(self) -> str:
        return f"<Layer {self.name!r}>"

    def _draw(self, name: str, make: Make, args: tuple[Any, ...], options: dict[str, Any], look: Look) -> Handle:
        return Handle(self._connection, self.name, checked_name(name, "name"), make, args, options, look)._put()

    def set(self, *, visible: Optional[bool] = None, opacity: Optional[float] = None, order: Optional[int] = None,
            blend: Optional[str] = None, transform: Optional[npt.ArrayLike] = None,
            clip: Optional[Sequence[clips.ClipPart]] = None,
            region: Optional[tuple[npt.ArrayLike, npt.ArrayLike]] = None, mask: Optional[str] = None) -> Optional[Frame]:
        """Sets what is given. `opacity`: 0 to 1. `order`: the higher is drawn over the lower. `blend`: "over", "add" or
        "erase". `clip`: planes (a, b, c, d) that keep a·x + b·y + c·z + d ≥ 0, ClipBox, ClipCylinder: only what lies inside
        all of them is drawn. `region`: two corners of a box. `mask`: a layer of yours; only where it covers, visible or not,
        this one is visible; "" removes the mask."""
        state = pb.LayerState(layer=self.name)
        if visible is not None:
            state.visible = visible
        if opacity is not None:
            if number(opacity, "opacity", least=0) > 1:
                raise InvalidValue(f"opacity is {opacity}; give 0 to 1")
            state.opacity = round(opacity * 255)
        if order is not None:
            state.order = _order(order)
        if blend is not None:
            state.blend = choice(_BLENDS, blend, "blend")
        if transform is not None:
            state.transform.CopyFrom(transforms.to_wire(transforms.as_matrix(transform)))
        if clip is not None:
            state.clip.CopyFrom(clips.to_wire(clip))
        if region is not None:
            low, high = vector(region[0], "region[0]"), vector(region[1], "region[1]")
            state.region.min.CopyFrom(types_pb2.Vec3(x=low[0], y=low[1], z=low[2]))
            state.region.max.CopyFrom(types_pb2.Vec3(x=high[0], y=high[1], z=high[2]))
        if mask is not None:
            state.mask_layer = mask
        return self._connection._stage_ready([operations.layer_state(state)])

    def frame(self, *, present_in: Optional[float] = None, must_show: bool = False) -> "FrameBlock":
        return self._connection.frame(self.name, present_in=present_in, must_show=must_show)

    def remove(self, name: str) -> Optional[Frame]:
        return self._connection._remove(self.name, name)

    def clear(self) -> Optional[Frame]:
        return self._connection.clear(self.name)


def _order(order: int) -> int:
    if isinstance(order, bool) or not isinstance(order, (int, np.integer)) or not -2**31 <= order < 2**31:
        raise InvalidValue(f"order is {order!r}; give a whole number, the higher is drawn over the lower")
    return int(order)


def put_parts(layer: str, name: str, shape: Sequence[wire.Packed], look: Look, uses: str = "") -> operations.Puts:
    """Encodes a shape under its name; if it has several pieces, under an id for each. `uses`: the object that it draws."""
    entity = look.to_bytes()
    return operations.Puts([wire.put(layer, id, entity, one, uses, look.lifetime_ns)
                            for id, one in zip(ids(free_name(name), len(shape)), shape)])


def _uses(make: Make, args: tuple[Any, ...]) -> str:
    return str(args[0]) if make is shapes.instance else ""


class FrameBlock(Draw[None]):
    """Immediate mode: when the `with` ends, everything drawn in it replaces the layer's content at once. If the block raises,
    nothing is sent. Afterwards it behaves as the Frame of its commit."""

    def __init__(self, connection: "BaseConnection", layer: str, present_in: Optional[float], must_show: bool) -> None:
        self._connection = connection
        self._layer = checked_name(layer, "layer")
        self._parts: dict[str, operations.Puts] = {}
        self._present_in, self._must_show = present_in, must_show
        self._frame: Optional[Frame] = None

    def __enter__(self) -> "FrameBlock":
        self._parts = {}
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], error: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None:
        if kind is None:
            self._frame = self._connection._immediate(self._layer, self._parts, self._present_in, self._must_show)

    def _draw(self, name: str, make: Make, args: tuple[Any, ...], options: dict[str, Any], look: Look) -> None:
        checked_name(name, "name")
        self._parts[name] = put_parts(self._layer, name, make(*args, **options), look, _uses(make, args))

    @property
    def ticket(self) -> Frame:
        """The commit's Frame."""
        if self._frame is None:
            raise InvalidValue("this frame has no commit yet: it is not at its end, or waits for v.commit()")
        return self._frame

    @property
    def accepted(self) -> Optional[Accepted]:
        return self.ticket.accepted

    @property
    def outcomes(self) -> dict[str, Outcome]:
        return self.ticket.outcomes

    @property
    def issues(self) -> tuple[Issue, ...]:
        return self.ticket.issues

    def wait(self, timeout: Optional[float] = None) -> Frame:
        return self.ticket.wait(timeout)

    def wait_shown(self, timeout: Optional[float] = None) -> dict[str, Outcome]:
        return self.ticket.wait_shown(timeout)


class ObjectBlock(Draw[None]):
    """A group that draws nothing itself; instances draw it. The drawing calls in the `with` define the whole object. Its parts
    have no looks of their own except a transform."""

    def __init__(self, connection: "BaseConnection", name: str) -> None:
        self._connection = connection
        self.name = checked_name(name, "object")
        self._parts: list[wire.Packed] = []
        self._uses: set[str] = set()
        self.frame: Optional[Frame] = None

    def __enter__(self) -> "ObjectBlock":
        self._parts, self._uses = [], set()
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], error: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None:
        if kind is None:
            self.frame = self._connection._stage_ready([operations.define(self.name, self._parts, self._uses)])

    def _draw(self, name: str, make: Make, args: tuple[Any, ...], options: dict[str, Any], look: Look) -> None:
        if look != Look(look.transform):
            raise InvalidValue(f"the part {name!r} of an object has only a transform; give the rest to the instances")
        before = primitives_pb2.Object.Part(
            transform=None if look.transform is None else transforms.to_wire(look.transform)).SerializeToString()
        if make is shapes.instance:
            self._uses.add(str(args[0]))
        for one in make(*args, **options):
            self._parts.append(_copied(one.inside(wire.Field.PART_PRIMITIVE, before)))


def _copied(packed: wire.Packed) -> wire.Packed:
    return wire.Packed(packed.to_bytes())
