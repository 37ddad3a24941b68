"""A volume that a display shows, reconstructed: slices of colours, and the positions of their pixels."""
from __future__ import annotations

from typing import Iterable, Optional

import numpy as np
import numpy.typing as npt

from . import picture as picture_
from .errors import VoxelError
from .v1 import display_pb2 as pb

Bytes = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]


def _row(count: int, pitch_mm: float, middle_mm: float, mirror: bool) -> Floats:
    """Returns the centres of the pixels along one axis of the slice images."""
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
        """The number of pixels that are not black."""
        return int(np.count_nonzero(self.rgb.any(axis=3)))

    def points(self) -> tuple[Floats, Bytes]:
        """Returns the positions of the lit pixels in mm, (n, 3), and their colours, (n, 3)."""
        s, v, u = np.nonzero(self.rgb.any(axis=3))
        colors = self.rgb[s, v, u]
        geometry = self.header.geometry
        shape = geometry.WhichOneof("shape")
        if shape == "planar_stack":
            at = self._stack_points(s, v, u)
        elif shape == "rotor":
            at = self._rotor_points(s, v, u)
        elif shape == "helix":
            at = self._helix_points(s, v, u)
        elif shape == "lattice":
            lattice = geometry.lattice
            lights = np.zeros((lattice.slices * lattice.width_px, 3))
            lights[list(lattice.pixels)] = np.stack([list(lattice.x_mm), list(lattice.y_mm), list(lattice.z_mm)], axis=1)
            at = lights[s * lattice.width_px + u]
        else:
            raise VoxelError("the display's geometry is of a kind that this client does not know")
        return self._corrected(at), colors

    def _picture(self, s: Places, across: Floats, up: Floats) -> tuple[Floats, Floats]:
        """Applies the homographies to positions in the slice images."""
        numbers = self.header.geometry.correction.homographies
        if not numbers:
            return across, up
        maps = np.array(list(numbers)).reshape(-1, 3, 3)
        m = maps[s if len(maps) > 1 else np.zeros_like(s)]
        x, y, w = (m[:, row, 0] * across + m[:, row, 1] * up + m[:, row, 2] for row in range(3))
        return x / w, y / w

    def _corrected(self, at: Floats) -> Floats:
        """Returns the true positions of nominal ones."""
        correction = self.header.geometry.correction
        result = at
        if correction.affine:
            affine = np.array(list(correction.affine)).reshape(3, 4)
            result = at @ affine[:, :3].T + affine[:, 3]
        if correction.HasField("displacement"):
            grid = correction.displacement
            size = np.array([grid.nx, grid.ny, grid.nz])
            low = np.array([grid.low_mm.x, grid.low_mm.y, grid.low_mm.z])
            high = np.array([grid.high_mm.x, grid.high_mm.y, grid.high_mm.z])
            numbers = np.array(list(grid.at_mm)).reshape(grid.nz, grid.ny, grid.nx, 3)
            place = np.clip((at - low) / (high - low) * (size - 1), 0, size - 1)
            first = np.minimum(place.astype(int), size - 2)
            share = place - first
            moved = np.zeros_like(at)
            for corner in range(8):
                step = np.array([corner & 1, corner >> 1 & 1, corner >> 2])
                weight = np.where(step == 1, share, 1 - share).prod(axis=1)
                i, j, k = (first + step).T
                moved += weight[:, None] * numbers[k, j, i]
            result = result + moved
        return result

    def _stack_points(self, s: Places, v: Places, u: Places) -> Floats:
        stack = self.header.geometry.planar_stack
        across, up = self._picture(s, _row(stack.width_px, stack.pitch_u_mm, 0, stack.mirror_u)[u],
                                   _row(stack.height_px, stack.pitch_v_mm, 0, stack.mirror_v)[v])
        along = np.array(list(stack.positions_mm))[s]
        flat = stack.normal == pb.PlanarStack.Z
        return np.stack([across, up, along] if flat else [across, along, up], axis=1)

    def _helix_points(self, s: Places, v: Places, u: Places) -> Floats:
        helix = self.header.geometry.helix
        x, y = self._picture(s, _row(helix.width_px, helix.pitch_u_mm, 0, helix.mirror_u)[u],
                             _row(helix.height_px, helix.pitch_v_mm, 0, helix.mirror_v)[v])
        turned = s / helix.slices_per_turn
        begin = helix.phase_turns + (-turned if helix.clockwise else turned)
        z = np.zeros(len(s))
        for blade in range(helix.blades):
            way = np.arctan2(y, x) / (2 * np.pi) - begin - blade / helix.blades
            share = np.mod(-way if helix.left_handed else way, 1) / helix.span_turns
            z = np.where(share < 1, (share - 0.5) * helix.height_mm, z)
        return np.stack([x, y, z], axis=1)

    def _rotor_points(self, s: Places, v: Places, u: Places) -> Floats:
        rotor = self.header.geometry.rotor
        result = np.zeros((len(s), 3))
        for number, panel in enumerate(rotor.panels):
            mine = s % len(rotor.panels) == number
            turned = (s[mine] // len(rotor.panels)) / rotor.slices_per_turn
            angle = 2 * np.pi * (panel.phase_turns + (-turned if rotor.clockwise else turned))
            along = _row(rotor.width_px, panel.pitch_u_mm, panel.shift_u_mm, panel.mirror_u)[u[mine]]
            up = _row(rotor.height_px, panel.pitch_v_mm, panel.shift_v_mm, panel.mirror_v)[v[mine]]
            tilt = np.radians(panel.tilt_deg)
            cos, sin, off = np.cos(angle), np.sin(angle), panel.eccentricity_mm + up * np.sin(tilt)
            result[mine] = np.stack([along * cos - off * sin, along * sin + off * cos, up * np.cos(tilt)], axis=1)
        return result

    def corners(self) -> Floats:
        """Returns the corners of the voxel grid in mm, (8, 3)."""
        grid = self.header.geometry.grid
        low = np.array([grid.origin_mm.x, grid.origin_mm.y, grid.origin_mm.z])
        size = np.array([grid.nx * grid.pitch_mm.x, grid.ny * grid.pitch_mm.y, grid.nz * grid.pitch_mm.z])
        ends = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
        result: Floats = low + ends * size
        return result

    def picture(self, width: int = 512, height: int = 512, azimuth: float = 30.0, elevation: float = 25.0) -> Bytes:
        """Renders the volume as seen from outside, (height, width, 3): lights add up; the grid's edges are drawn in grey."""
        at, colors = self.points()
        grid = self.header.geometry.grid
        pitch = max(grid.pitch_mm.x, grid.pitch_mm.y, grid.pitch_mm.z)
        return picture_.splat(at, colors, self.corners(), pitch, width, height, azimuth, elevation)

    def save_png(self, path: str, width: int = 512, height: int = 512, azimuth: float = 30.0, elevation: float = 25.0) -> None:
        """Writes picture() to a PNG file."""
        with open(path, "wb") as file:
            file.write(picture_.png(self.picture(width, height, azimuth, elevation)))

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, object]:
        return {"text/plain": repr(self), "image/png": picture_.png(self.picture())}
