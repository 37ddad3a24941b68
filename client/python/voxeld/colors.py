"""Colours: one for all elements, or one for each.

One colour is a name ("orange", "tab:orange"), a hex code ("#f80", "#ff8800"), or three or four numbers: floats from 0 to 1
or integers from 0 to 255. Many colours are an (n, 3) or (n, 4) array, uint8 or floats from 0 to 1, or a list of names. A colour
map turns n numbers into n colours. A fourth number is ignored: only layers have transparency.
"""
from __future__ import annotations

import difflib
import string
from dataclasses import dataclass
from typing import Any, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from .arrays import Array, as_array, number, require_finite, vector
from .color_names import NAMES, map_named, maps
from .errors import InvalidColor
from .v1 import primitives_pb2, types_pb2

Rgb = int  # 0xRRGGBB


@dataclass(frozen=True)
class Gradient:
    """Colours along a direction, in place of one colour: the position along it, (p · along) / |along|², from `low` to `high`
    (default: the least and the greatest present). `cmap`: a map's name, or 2 to 256 evenly spaced colours."""

    cmap: Union[str, Sequence[Any]] = "viridis"
    along: Sequence[float] = (0, 0, 1)
    low: float = 0
    high: float = 0

    def to_wire(self) -> primitives_pb2.ColorScale:
        x, y, z = vector(self.along, "along")
        scale = primitives_pb2.ColorScale(along=types_pb2.Vec3(x=x, y=y, z=z), low=number(self.low, "low"),
                                          high=number(self.high, "high"))
        if isinstance(self.cmap, str):
            scale.colormap = self.cmap
        else:
            scale.colors.extend(one(color) for color in self.cmap)
        return scale

    def of(self, positions: Array) -> npt.NDArray[np.uint8]:
        """Returns a colour for each position."""
        direction = np.array(vector(self.along, "along"), np.float64)
        if not direction.any():
            raise InvalidColor("a gradient's along is 0; give a direction")
        distances = positions.astype(np.float64) @ direction / (direction @ direction)
        ends = (None, None) if self.low == self.high == 0 else (self.low, self.high)
        return mapped(distances, self.cmap, *ends)


Colors = Union[str, Sequence[Any], Array, Gradient]


def _from_text(text: str) -> Rgb:
    name = text.strip().lower()
    if name in NAMES:
        return NAMES[name]
    if name.startswith("#"):
        digits = name[1:]
        if len(digits) in (3, 4):
            digits = "".join(2 * d for d in digits)
        if len(digits) in (6, 8) and all(d in string.hexdigits for d in digits):
            return int(digits[:6], 16)
        raise InvalidColor(f"the colour {text!r} is no hex code; give #rgb or #rrggbb, such as #ff8800")
    near = difflib.get_close_matches(name, NAMES, n=3)
    hint = f"did you mean {' or '.join(map(repr, near))}?" if near else (
        "give a CSS name, 'tab:orange', '#ff8800' or (1.0, 0.5, 0.0)")
    raise InvalidColor(f"there is no colour {text!r}; {hint}")


def _bytes_of(array: Array, what: str) -> npt.NDArray[np.uint8]:
    """Returns channels as uint8, from uint8, other integers from 0 to 255 or floats from 0 to 1."""
    if array.dtype == np.uint8:
        return array
    if array.dtype.kind in "iu":
        if array.size and (array.min() < 0 or array.max() > 255):
            raise InvalidColor(f"{what}: whole numbers are 0 to 255, got {array.min()} to {array.max()}")
        return array.astype(np.uint8)
    if array.dtype.kind != "f":
        raise InvalidColor(f"{what}: got elements of type {array.dtype}; give uint8, or floats from 0 to 1")
    require_finite(array, what)
    if array.size and (array.min() < 0 or array.max() > 1):
        hint = "; are they 0 to 255? then p.astype(np.uint8)" if array.min() >= 0 and array.max() <= 255 else ""
        raise InvalidColor(f"{what}: floats are 0 to 1, got {array.min():g} to {array.max():g}{hint}")
    result: npt.NDArray[np.uint8] = np.rint(array * 255).astype(np.uint8)
    return result


def one(value: Colors, what: str = "color") -> Rgb:
    """Returns one colour."""
    if isinstance(value, Gradient):
        raise InvalidColor(f"{what} is a gradient; one colour is right here")
    if isinstance(value, str):
        return _from_text(value)
    array = as_array(value, what)
    if array.shape not in ((3,), (4,)):
        raise InvalidColor(f"{what} must be one colour: a name, a hex code or three numbers; got shape {array.shape}")
    if array.dtype.kind in "iu" and array.dtype != np.uint8 and array.max() == 1:
        raise InvalidColor(f"{what} is {array.tolist()}: whole numbers are 0 to 255; for 0 to 1 give floats, such as 1.0")
    r, g, b = (int(c) for c in _bytes_of(array, what)[:3])
    return r << 16 | g << 8 | b


def rgb_of(colors: Sequence[Rgb]) -> npt.NDArray[np.uint8]:
    """Returns colours, given as numbers, as an (n, 3) array."""
    words = np.array(colors, dtype=np.uint32)
    result: npt.NDArray[np.uint8] = np.stack([words >> 16 & 255, words >> 8 & 255, words & 255], axis=-1).astype(np.uint8)
    return result


def along(value: Optional[Colors], positions: Array) -> Optional[Colors]:
    """Applies a gradient to the positions; returns any other value unchanged."""
    return value.of(positions) if isinstance(value, Gradient) else value


def mapped(values: npt.ArrayLike, cmap: Union[str, Sequence[Any]], low: Optional[float] = None,
           high: Optional[float] = None) -> npt.NDArray[np.uint8]:
    """Returns a colour for each number: `low` (default: the least) maps to the map's first colour, `high` to its last."""
    if isinstance(cmap, str):
        named = map_named(cmap)
        if named is None:
            raise InvalidColor(f"there is no colour map {cmap!r}; {_map_hint(cmap)}")
        stops = rgb_of(named).astype(np.float64)
    else:
        stops = rgb_of([one(color) for color in cmap]).astype(np.float64)
    array = as_array(values, "colors").astype(np.float64)
    require_finite(array, "colors")
    if array.size == 0:
        return np.zeros((*array.shape, 3), np.uint8)
    first = float(array.min()) if low is None else float(low)
    last = float(array.max()) if high is None else float(high)
    at = np.clip((array - first) / (last - first), 0, 1) if last > first else np.zeros_like(array)
    place = np.linspace(0, 1, len(stops))
    if isinstance(cmap, str):  # in 256 steps, as the server has them: maps of few colours keep their edges
        at = np.rint(at * 255) / 255
    channels = np.stack([np.interp(at, place, stops[:, c]) for c in range(3)], axis=-1)
    result: npt.NDArray[np.uint8] = np.rint(channels).astype(np.uint8)
    return result


def _map_hint(wrong: str) -> str:
    turned = "_r" if wrong.endswith("_r") else ""
    plain = wrong.removesuffix("_r")
    by_folded = {name.lower(): name for name in maps()}
    near = difflib.get_close_matches(plain.lower(), by_folded, n=1)
    if near:
        return f"did you mean {by_folded[near[0]] + turned!r}?"
    return f"there are {', '.join(maps())}, each also turned round, as viridis_r"


def numbers_each(value: Optional[Colors]) -> bool:
    """Returns whether `value` is one number per vertex, which needs a colour map."""
    if value is None or isinstance(value, (str, Gradient)) or np.ndim(value) != 1:
        return False
    return isinstance(value, np.ndarray) or (len(value) > 4 and not isinstance(value[0], str))


def many(value: Optional[Colors], count: int, cmap: Optional[str] = None, of: str = "vertices") -> Union[None, Rgb, Array]:
    """Returns None (the default colour), one colour, or a C-contiguous (count, 3) or (count, 4) uint8 array. Such an array is
    not copied. `of`: what has the colours, for error messages."""
    if value is None:
        if cmap is not None:
            raise InvalidColor(f"cmap is {cmap!r}, but there are no colors to map; give one number for each of {count}")
        return None
    if isinstance(value, Gradient):
        raise InvalidColor("colors is a gradient; colours themselves are right here")
    if cmap is not None:
        values = as_array(value, "colors")
        if values.shape != (count,):
            raise InvalidColor(f"colors with a cmap must be of shape ({count},), one number each, got {values.shape}")
        return np.ascontiguousarray(mapped(values, cmap))
    if isinstance(value, str):
        return _from_text(value)
    if len(value) and all(isinstance(v, str) for v in value):
        if len(value) != count:
            raise InvalidColor(f"colors are {len(value)} names for {count} {of}")
        return rgb_of([_from_text(str(v)) for v in value])
    array = as_array(value, "colors")
    if array.ndim == 1 and len(array) in (3, 4):
        return one(value, "colors")
    if array.ndim == 1 and len(array) == count and count:
        raise InvalidColor(f"colors is one number for each of {count} {of}; say how they become colours: cmap='viridis'")
    if array.ndim != 2 or array.shape[1] not in (3, 4):
        hint = ", did you mean .T?" if array.ndim == 2 and array.shape[0] in (3, 4) else ""
        raise InvalidColor(f"colors must be one colour or of shape ({count}, 3) or ({count}, 4), got {array.shape}{hint}")
    if len(array) != count:
        raise InvalidColor(f"colors are {len(array)} for {count} {of}")
    return np.ascontiguousarray(_bytes_of(array, "colors"))
