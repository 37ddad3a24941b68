"""voxeld: draw on volumetric displays.

    import voxeld as voxel
    v = voxel.connect()
    v.lines("axes", [[-1, 0, 0], [1, 0, 0]], colors="tab:orange")
"""
import importlib.util

if importlib.util.find_spec(f"{__name__}.v1") is None:
    raise ImportError(
        "voxeld: the generated modules (voxeld.v1) are not here: this is the client's source. Build the wheel in the source tree: "
        "tools/setup --python && cmake --preset demo -DVOXELD_PYTHON_CLIENT=ON && cmake --build --preset demo --target python_client; "
        "then install it in a virtual environment: pip install build/demo/python/voxeld-*.whl")

from . import aio
from .assets import Asset
from .clip import ClipBox, ClipCylinder
from .colors import Gradient
from .connection import Connection, connect
from .credentials import Credentials
from .errors import (BufferFull, CommitDropped, CommitRefused, ConnectionLost, InvalidArray, InvalidColor, InvalidOption,
                     InvalidValue, NotDurable, VoxelError)
from .handles import FrameBlock, Handle, Layer, ObjectBlock
from .queries import ChangeSet
from .receipts import Accepted, Frame, Issue, Outcome, Stages
from .transforms import identity, rotate, scale, translate
from .volumes import Volume

__version__ = "0.1.0"

__all__ = [
    "Accepted", "Asset", "BufferFull", "ChangeSet", "ClipBox", "ClipCylinder", "CommitDropped", "CommitRefused", "Connection", "ConnectionLost", "Credentials",
    "Frame",
    "FrameBlock", "Gradient", "Handle", "InvalidArray", "InvalidColor", "InvalidOption", "InvalidValue", "Issue", "Layer", "NotDurable", "ObjectBlock", "Outcome",
    "Stages", "VoxelError", "Volume", "aio", "connect", "identity", "rotate", "scale", "translate"]
