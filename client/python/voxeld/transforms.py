"""Affine maps as 4×4 matrices; they compose with `@`, and the right one is applied first."""
from __future__ import annotations

import math
from typing import Any, Optional

import numpy as np
import numpy.typing as npt

from .arrays import Array, as_array, number, require_finite, vector
from .errors import InvalidArray
from .v1 import types_pb2 as pb

Matrix = npt.NDArray[np.float64]


def identity() -> Matrix:
    return np.eye(4)


def translate(x: float | npt.ArrayLike, y: Optional[float] = None, z: Optional[float] = None) -> Matrix:
    """Returns a translation by three numbers, or by one array of three."""
    if (y is None) != (z is None) or y is None and np.ndim(x) == 0:
        raise InvalidArray(f"the translation is {', '.join(str(one) for one in (x, y, z) if one is not None)}; give x, y and z")
    by: Any = x if y is None else (x, y, z)
    matrix = np.eye(4)
    matrix[:3, 3] = vector(by, "translation")
    return matrix


def scale(x: float | npt.ArrayLike, y: Optional[float] = None, z: Optional[float] = None) -> Matrix:
    """Returns a scaling by one factor for all axes, or by three, as numbers or as one array."""
    factors: Any = x if y is None and z is None and np.ndim(x) > 0 else (x, x if y is None else y, x if z is None else z)
    return np.diag([*vector(factors, "scale"), 1.0])


def rotate(axis: str | npt.ArrayLike, degrees: float) -> Matrix:
    """Returns a rotation about "x", "y", "z" or any direction, counter-clockwise as seen from its tip."""
    if isinstance(axis, str):
        if axis not in ("x", "y", "z"):
            raise InvalidArray(f"the axis is {axis!r}; give 'x', 'y', 'z' or a direction of three numbers")
        direction: Array = np.eye(3)["xyz".index(axis)]
    else:
        direction = np.array(vector(axis, "axis"))
        length = float(np.linalg.norm(direction))
        if length == 0:
            raise InvalidArray("the axis is (0, 0, 0), which points nowhere")
        direction = direction / length
    angle = math.radians(number(degrees, "degrees"))
    x, y, z = direction
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    matrix[:3, :3] += math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross)
    return matrix


def as_matrix(values: npt.ArrayLike) -> Matrix:
    """Returns a 4×4 or 3×4 array as a checked 4×4 matrix."""
    array = as_array(values, "transform")
    if array.shape == (3, 4):
        array = np.vstack([array, [0, 0, 0, 1]])
    if array.shape != (4, 4):
        hint = "; use translate(), rotate(), scale()" if array.shape == (3, 3) or array.ndim < 2 else ""
        raise InvalidArray(f"transform must be of shape (4, 4) or (3, 4), got {array.shape}{hint}")
    require_finite(array, "transform")
    matrix: Matrix = np.array(array, dtype=np.float64)
    if not np.array_equal(matrix[3], [0, 0, 0, 1]):
        hint = ", did you mean .T?" if np.array_equal(matrix[:, 3], [0, 0, 0, 1]) else ""
        raise InvalidArray(f"the transform's last row must be 0 0 0 1, got {matrix[3].tolist()}{hint}")
    if np.linalg.det(matrix[:3, :3]) == 0:
        raise InvalidArray("the transform is singular: it flattens space; every scale must differ from 0")
    return matrix


def to_wire(matrix: Matrix) -> pb.Affine:
    return pb.Affine(m=matrix[:3].ravel().tolist())
