"""A volume that a display shows, rebuilt: slices of colours, and where their pixels are."""
from __future__ import annotations

from typing import Iterable, Optional

import numpy as np
import numpy.typing as npt

from . import picture as picture_
from .errors import VoxelError
from .v1 import display_pb2 as pb

Bytes = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float64]


def _row(count: int, pitch_mm: float, middle_mm: float, mirror: bool) -> Floats:
    """The centres of the pixels of one picture axis."""
    centres = (np.arange(count) + 0.5 - count / 2) * pitch_mm + middle_mm
    return centres[::-1] if mirror else centres


class Volume:
    """`rgb`: (slices, height, width, 3) uint8, as an eye would see it. Row 0 is the lowest."""

    def __init__(self, header: pb.VolumeHeader, rgb: Bytes) -> None:
        self.header = header
        self.rgb = rgb

    def __repr__(self) -> str:
        return f"<Volume {self.header.volume} of {self.header.display!r}, {self.lit} of {self.rgb[..., 0].size} pixels lit>"

    @staticmethod
    def of(chunks: Iterable[pb.VolumeChunk]) -> "Volume":
        header: Optional[pb.VolumeHeader] = None
        rgb: Bytes = np.zeros((0, 0, 0, 3), np.uint8)
        for chunk in chunks:
            if chunk.HasField("header"):
                header = chunk.header
                rgb = np.zeros((header.layout.slices, header.layout.height, header.layout.width, 3), np.uint8)
            elif header is not None:
                data = np.frombuffer(chunk.slices.rgb, np.uint8).reshape(-1, *rgb.shape[1:])
                rgb[chunk.slices.first_slice:chunk.slices.first_slice + len(data)] = data
        if header is None:
            raise VoxelError("the server sent a volume without its header")
        return Volume(header, rgb)

    @property
    def display(self) -> str:
        return self.header.display

    @property
    def lit(self) -> int:
        """Pixels that are not black."""
        return int(np.count_nonzero(self.rgb.any(axis=3)))

    def points(self) -> tuple[Floats, Bytes]:
        """Where the lit pixels are, in mm, (n, 3), and their colours, (n, 3)."""
        s, v, u = np.nonzero(self.rgb.any(axis=3))
        colors = self.rgb[s, v, u]
        geometry = self.header.geometry
        shape = geometry.WhichOneof("shape")
        if shape == "planar_stack":
            stack = geometry.planar_stack
            across = _row(stack.width_px, stack.pitch_u_mm, 0, stack.mirror_u)[u]
            up = _row(stack.height_px, stack.pitch_v_mm, 0, stack.mirror_v)[v]
            along = np.array(list(stack.positions_mm))[s]
            flat = stack.normal == pb.PlanarStack.Z
            return np.stack([across, up, along] if flat else [across, along, up], axis=1), colors
        if shape == "rotor":
            return self._rotor_points(s, v, u), colors
        lattice = geometry.lattice
        at = np.zeros((lattice.slices * lattice.width_px, 3))
        at[list(lattice.pixels)] = np.stack([list(lattice.x_mm), list(lattice.y_mm), list(lattice.z_mm)], axis=1)
        return at[s * lattice.width_px + u], colors

    def _rotor_points(self, s: npt.NDArray[np.intp], v: npt.NDArray[np.intp], u: npt.NDArray[np.intp]) -> Floats:
        rotor = self.header.geometry.rotor
        result = np.zeros((len(s), 3))
        for number, panel in enumerate(rotor.panels):
            mine = s % len(rotor.panels) == number
            turned = (s[mine] // len(rotor.panels)) / rotor.slices_per_turn
            angle = 2 * np.pi * (panel.phase_turns + (-turned if rotor.clockwise else turned))
            along = _row(rotor.width_px, panel.pitch_u_mm, panel.shift_u_mm, panel.mirror_u)[u[mine]]
            up = _row(rotor.height_px, panel.pitch_v_mm, panel.shift_v_mm, panel.mirror_v)[v[mine]]
            cos, sin, off = np.cos(angle), np.sin(angle), panel.eccentricity_mm
            result[mine] = np.stack([along * cos - off * sin, along * sin + off * cos, up], axis=1)
        return result

    def corners(self) -> Floats:
        """The corners of the voxel grid, in mm, (8, 3)."""
        grid = self.header.geometry.grid
        low = np.array([grid.origin_mm.x, grid.origin_mm.y, grid.origin_mm.z])
        size = np.array([grid.nx * grid.pitch_mm.x, grid.ny * grid.pitch_mm.y, grid.nz * grid.pitch_mm.z])
        ends = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
        result: Floats = low + ends * size
        return result

    def picture(self, width: int = 512, height: int = 512, azimuth: float = 30.0, elevation: float = 25.0) -> Bytes:
        """As seen from outside, (height, width, 3): lights add up; the grid's edges are drawn in grey."""
        at, colors = self.points()
        grid = self.header.geometry.grid
        pitch = max(grid.pitch_mm.x, grid.pitch_mm.y, grid.pitch_mm.z)
        return picture_.splat(at, colors, self.corners(), pitch, width, height, azimuth, elevation)

    def save_png(self, path: str, width: int = 512, height: int = 512, azimuth: float = 30.0, elevation: float = 25.0) -> None:
        """picture(), as a file."""
        with open(path, "wb") as file:
            file.write(picture_.png(self.picture(width, height, azimuth, elevation)))

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, object]:
        return {"text/plain": repr(self), "image/png": picture_.png(self.picture())}
