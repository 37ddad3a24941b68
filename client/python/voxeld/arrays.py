"""Converts arrays for the wire: checked, C-contiguous, little-endian; copied only where necessary."""
from __future__ import annotations

import sys
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InvalidArray
from .v1 import primitives_pb2 as pb

Array = npt.NDArray[Any]

# The largest integer that positions may have (ELEMENT_TYPE_I32).
MAX_INTEGER = 1 << 24


def as_array(values: npt.ArrayLike, what: str) -> Array:
    """Returns `values` as an array of numbers; an array is not copied."""
    try:
        array = np.asarray(values)
    except ValueError:
        raise InvalidArray(f"{what}: these rows are not all of one length; give an array of one shape") from None
    if array.dtype.kind not in "fiub":
        hint = "; these rows are not all of one length" if array.dtype == object else ""
        raise InvalidArray(f"{what}: got elements of type {array.dtype}{hint}; give numbers (float32 goes out as it lies)")
    return array


def _shape_hint(shape: tuple[int, ...]) -> str:
    if len(shape) == 2 and shape[0] == 3:
        return ", did you mean .T?"
    if len(shape) == 2 and shape[1] == 2:
        return "; for flat ones add z: np.column_stack([p, np.zeros(len(p))])"
    if shape == (3,):
        return ", did you mean [p]?"
    if len(shape) == 3 and shape[2] == 3:
        return ", did you mean .reshape(-1, 3)?"
    if len(shape) == 2 and shape[1] == 4:
        return ", did you mean p[:, :3]?"
    return ""


def require_finite(array: Array, what: str) -> None:
    """Raises InvalidArray, naming the first element that is NaN or infinite."""
    if array.dtype.kind != "f" or array.size == 0:
        return
    # One pass without a temporary: a NaN or an infinity makes the sum non-finite. So may large numbers, so look closer then.
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(array.sum()):
            return
    bad = ~np.isfinite(array)
    if bad.any():
        first = tuple(int(i) for i in np.argwhere(bad)[0])
        where = ", ".join(map(str, first))
        raise InvalidArray(
            f"{what}[{where}] is {array[first]}, one of {int(bad.sum())} that are not finite; "
            "leave such rows out: p[np.isfinite(p).all(axis=1)]")


def _little_endian(array: Array) -> Array:
    return array if sys.byteorder == "little" and array.dtype.isnative else array.astype(array.dtype.newbyteorder("<"))


def positions(values: npt.ArrayLike, what: str = "positions") -> tuple[Array, pb.ElementType]:
    """Returns (n, 3) float32, int16 or int32, C-contiguous, and the wire's element type. Arrays of these three types are not
    copied; other floats become float32, other integers int32."""
    array = as_array(values, what)
    if array.size == 0 and array.ndim <= 2:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InvalidArray(f"{what} must be of shape (n, 3), got {array.shape}{_shape_hint(array.shape)}")
    dtype: np.dtype[Any] = np.dtype(np.int32)
    element = pb.ELEMENT_TYPE_I32
    if array.dtype.kind == "f":
        element, dtype = pb.ELEMENT_TYPE_F32, np.dtype(np.float32)
    elif array.dtype == np.int16:
        element, dtype = pb.ELEMENT_TYPE_I16, np.dtype(np.int16)
    else:
        if array.size and (array.max() > MAX_INTEGER or array.min() < -MAX_INTEGER):
            raise InvalidArray(
                f"{what}: whole numbers must lie within ±2**24, got {array.min()} to {array.max()}; give float32")
    with np.errstate(over="ignore"):
        array = np.ascontiguousarray(array, dtype=dtype)
    require_finite(array, what)
    return _little_endian(array), element


def indices(values: npt.ArrayLike, count: int, what: str = "faces") -> Array:
    """Returns (m, 3) uint32, each below `count`. uint32 and int32 arrays are not copied."""
    array = as_array(values, what)
    if array.size == 0 and array.ndim <= 2:
        array = array.reshape(0, 3).astype(np.uint32)
    if array.dtype.kind not in "iu":
        raise InvalidArray(f"{what}: got elements of type {array.dtype}; indices are whole numbers")
    if array.ndim != 2 or array.shape[1] != 3:
        hint = ", did you mean .T?" if array.ndim == 2 and array.shape[0] == 3 else ""
        if array.ndim == 2 and array.shape[1] == 4:
            hint = "; split quads into triangles: np.vstack([f[:, [0, 1, 2]], f[:, [0, 2, 3]]])"
        raise InvalidArray(f"{what} must be of shape (m, 3), got {array.shape}{hint}")
    if array.size:
        low, high = int(array.min()), int(array.max())
        if low < 0 or high >= count:
            hint = "; do they count from 1?" if low == 1 and high == count else ""
            raise InvalidArray(f"{what} go from {low} to {high}, but there are {count} vertices{hint}")
    if array.dtype == np.int32:
        array = array.view(np.uint32)
    return _little_endian(np.ascontiguousarray(array, dtype=np.uint32))


def vector(values: npt.ArrayLike, what: str) -> tuple[float, float, float]:
    """Returns three finite numbers."""
    array = as_array(values, what)
    if array.shape != (3,):
        raise InvalidArray(f"{what} must be three numbers, got shape {array.shape}")
    require_finite(array, what)
    return float(array[0]), float(array[1]), float(array[2])


def number(value: float, what: str, *, above: float | None = None, least: float | None = None) -> float:
    """Returns a finite number, greater than `above` and not less than `least`."""
    try:
        result = float(value)
    except (TypeError, ValueError):
        raise InvalidArray(f"{what} must be a number, got {value!r}") from None
    right = (above is None or result > above) and (least is None or result >= least)
    if not np.isfinite(result) or not right:
        bound = f"greater than {above:g}" if above is not None else f"at least {least:g}" if least is not None else "finite"
        raise InvalidArray(f"{what} must be {bound}, got {result!r}")
    return result
