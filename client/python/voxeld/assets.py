"""Content that is uploaded to the server once, and named by its hash from then on."""
from __future__ import annotations

import dataclasses
import hashlib
import os
from typing import Optional, Union

import numpy as np
import numpy.typing as npt

from .arrays import as_array
from .errors import InvalidArray, InvalidValue
from .v1 import primitives_pb2 as pb

Content = Union[str, "os.PathLike[str]", bytes, bytearray, memoryview, npt.ArrayLike]
"""What can be uploaded: a file's path, bytes as they are, or an array of samples."""


@dataclasses.dataclass(frozen=True)
class Asset:
    """Content that the server stores by its SHA-256, as upload() returns it. An image's asset can be used as a texture, an
    array's as the samples of a volume or isosurface."""

    sha256: bytes
    size: int
    shape: Optional[tuple[int, ...]] = None
    """Of an array: (nx, ny, nz), or, of colours, (nx, ny, nz, 4)."""
    dtype: Optional[np.dtype] = None  # type: ignore[type-arg]

    def range(self) -> pb.MemoryRange:
        """Returns the range of the whole asset."""
        return pb.MemoryRange(asset=self.sha256, size=self.size)


def samples(array: npt.ArrayLike) -> "np.typing.NDArray[np.generic]":
    """Returns a field in the wire's format: uint8, uint16 or float32."""
    field = as_array(array, "array")
    if field.ndim not in (3, 4) or 0 in field.shape or (field.ndim == 4 and (field.shape[3] != 4 or field.dtype != np.uint8)):
        raise InvalidArray(f"array must be of shape (nx, ny, nz), or, of colours, uint8 of (nx, ny, nz, 4), got {field.shape}")
    if field.dtype not in (np.uint8, np.uint16):
        field = field.astype(np.float32)
        if np.isinf(field).any():
            raise InvalidArray("array has infinite numbers; give finite ones, or NaN where there is nothing")
    return field


def x_fastest(field: "np.typing.NDArray[np.generic]") -> bytes:
    return np.ascontiguousarray(np.swapaxes(field, 0, 2)).tobytes()


def pack(content: Content) -> tuple[bytes, Asset]:
    """Returns the bytes and their asset. Raises OSError if a file cannot be read."""
    shape, dtype = None, None
    if isinstance(content, (bytes, bytearray, memoryview)):
        data = bytes(content)
    elif isinstance(content, (str, os.PathLike)):
        with open(content, "rb") as file:
            data = file.read()
    else:
        field = samples(content)
        data, shape, dtype = x_fastest(field), field.shape, field.dtype
    if not data:
        raise InvalidValue("content has no bytes; an asset has 1 at least")
    return data, Asset(hashlib.sha256(data).digest(), len(data), shape, dtype)
