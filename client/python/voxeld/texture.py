"""Images on surfaces."""
from __future__ import annotations

import os
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

from .arrays import as_array, require_finite
from .assets import Asset
from .errors import InvalidArray, InvalidValue
from .v1 import primitives_pb2 as pb

PictureFile = Union[str, "os.PathLike[str]", bytes, bytearray, memoryview, Asset]
"""A PNG or JPEG file: its path, its bytes, or an asset of them."""


def picture_fields(texture: PictureFile) -> dict[str, Any]:
    """Returns a message's picture, or the range in its place. Raises OSError if the file cannot be read."""
    if isinstance(texture, Asset):
        return {"picture_in": texture.range()}
    return {"picture": _picture_bytes(texture)}


def _picture_bytes(texture: Union[str, "os.PathLike[str]", bytes, bytearray, memoryview]) -> bytes:
    if isinstance(texture, (bytes, bytearray, memoryview)):
        return bytes(texture)
    if not isinstance(texture, (str, os.PathLike)):
        raise InvalidValue(f"texture is a {type(texture).__name__}; give a PNG or JPEG file, its path or its bytes")
    with open(texture, "rb") as file:
        return file.read()


def to_texture(texture: Optional[PictureFile], uv: Optional[npt.ArrayLike], count: int) -> Optional[pb.Texture]:
    """Returns the texture with the places of `count` vertices. Give neither argument, or both."""
    if texture is None and uv is None:
        return None
    if texture is None or uv is None:
        raise InvalidValue("texture and uv go together; give both, or none of them")
    places = as_array(uv, "uv")
    if places.shape != (count, 2):
        raise InvalidArray(f"uv must be of shape ({count}, 2), got {places.shape}")
    require_finite(places, "uv")
    return pb.Texture(coordinates=np.ascontiguousarray(places, np.float32).tobytes(), **picture_fields(texture))
