"""Encodes volumes and isosurfaces as wire bytes."""
from __future__ import annotations

from typing import Any, Optional, Sequence, Union, cast

import numpy as np
import numpy.typing as npt

from . import colors as colors_
from . import wire
from .arrays import as_array, number, vector
from .assets import Asset, samples, x_fastest
from .colors import Colors
from .errors import InvalidArray, InvalidValue
from .shapes import FILLS, RULES, WHOLE_BYTES, choice, solid, thickness, vec
from .v1 import primitives_pb2 as pb

Color = Optional[Colors]
Extent = Optional[tuple[npt.ArrayLike, npt.ArrayLike]]

_FILTERS = {"linear": pb.Grid.LINEAR, "nearest": pb.Grid.NEAREST}
_TYPES = {np.dtype(np.uint8): pb.ELEMENT_TYPE_U8, np.dtype(np.uint16): pb.ELEMENT_TYPE_U16}


def _grid(array: Union[npt.ArrayLike, Asset], extent: Extent, filter: str, colors: bool) -> pb.Grid:
    """`array` has the shape (nx, ny, nz) or, for colours, (nx, ny, nz, 4); or is an asset of one."""
    asset = array if isinstance(array, Asset) else None
    field: Any = asset if asset is not None else as_array(cast(npt.ArrayLike, array), "array")
    if field.shape is None:
        raise InvalidValue("the asset is no array's; upload the array itself, so that its shape is known")
    if len(field.shape) != (4 if colors else 3) or 0 in field.shape or (colors and field.shape[3] != 4):
        raise InvalidArray(f"array must be of shape {'(nx, ny, nz, 4)' if colors else '(nx, ny, nz)'}, got {field.shape}")
    shape = np.array(field.shape[:3])
    if extent is None:
        last = shape / shape.max()
        first = -last
    else:
        first, last = np.array(vector(extent[0], "extent[0]")), np.array(vector(extent[1], "extent[1]"))
        if not (first < last).all():
            raise InvalidArray(f"extent goes from {first.tolist()} to {last.tolist()}; the first must be less on every axis")
    if colors and field.dtype != np.uint8:
        raise InvalidArray(f"array of colours must be uint8, got {field.dtype}")
    if asset is None:
        field = samples(field)
        if field.nbytes > WHOLE_BYTES:
            raise InvalidArray(f"array takes {field.nbytes} bytes, more than the {WHOLE_BYTES} that go at once; give fewer samples, or "
                               "narrower ones (uint8)")
    element = pb.ELEMENT_TYPE_RGBA8 if colors else _TYPES.get(field.dtype, pb.ELEMENT_TYPE_F32)
    edges = np.diag(last - first)
    grid = pb.Grid(corner=vec(first, "extent"), edge_a=vec(edges[0], "extent"), edge_b=vec(edges[1], "extent"),
                   edge_c=vec(edges[2], "extent"), size_a=shape[0], size_b=shape[1], size_c=shape[2], type=element,
                   filter=choice(_FILTERS, filter, "filter"))
    if asset is not None:
        grid.samples_in.CopyFrom(asset.range())
    else:
        grid.samples = x_fastest(field)
    return grid


def grid(array: Union[npt.ArrayLike, Asset], *, values: Optional[Sequence[float]] = None, colors: Optional[Sequence[Any]] = None,
         cmap: Optional[str] = None, opacities: Optional[Sequence[float]] = None, extent: Extent = None, filter: str = "linear",
         color: Color = None) -> list[wire.Packed]:
    is_colors = (len(array.shape or ()) if isinstance(array, Asset) else np.ndim(cast(npt.ArrayLike, array))) == 4
    shape = pb.Volume(grid=_grid(array, extent, filter, is_colors))
    if values is None:
        if colors is not None or cmap is not None or opacities is not None:
            raise InvalidValue("colors, cmap and opacities are of values; give these as well")
        return solid(color, volume=shape)
    if is_colors:
        raise InvalidValue("values are given, but the array has colours")
    if (colors is None) == (cmap is None):
        raise InvalidValue("give colors, one for each of values, or cmap, a map's name")
    for what, given in (("colors", colors), ("opacities", opacities)):
        if given is not None and len(given) != len(values):
            raise InvalidValue(f"{what} has {len(given)} for {len(values)} values; give one for each")
    shape.transfer.values.extend(number(value, "values") for value in values)
    shape.transfer.colors.extend(colors_.one(each) for each in colors or ())
    shape.transfer.colormap = cmap or ""
    shape.transfer.opacities.extend(number(value, "opacities", least=0) for value in opacities or ())
    return solid(color, volume=shape)


def isosurface(array: Union[npt.ArrayLike, Asset], level: float, *, extent: Extent = None, filter: str = "linear", color: Color = None,
               fill: str = "surface", rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels") -> list[wire.Packed]:
    return solid(color, isosurface=pb.Isosurface(
        grid=_grid(array, extent, filter, False), level=number(level, "level"), fill=choice(FILLS, fill, "fill"),
        rule=choice(RULES, rule, "rule"), shell=thickness(shell, unit, "shell")))
