"""The drawing calls, the same for a connection, a layer, a frame and an object."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional

import numpy.typing as npt

from . import shapes
from .colors import Colors
from .draw_curves import DrawCurves
from .draw_measured import Drawn, Make
from .errors import InvalidValue
from .look import Look
from .options import named, no_call
from .texture import PictureFile

__all__ = ["Draw", "Look", "Make", "checked_name"]


def checked_name(name: str, what: str) -> str:
    if not isinstance(name, str) or not name:
        raise InvalidValue(f"the {what} is {name!r}; give a text that is not empty")
    return name


@named
class Draw(DrawCurves[Drawn]):
    """Each call draws one thing under a name; another call with that name replaces it. All take `transform` (4×4 or 3×4),
    `priority` (0 to 126, the higher wins within its layer), `erase` (removes content of lower or equal priority), `lifetime`
    in seconds and `label`, a text for people. Arguments are checked before anything is sent; arrays may be changed again as
    soon as the call returns."""

    if not TYPE_CHECKING:  # hide the fallback from type checkers, so that they report unknown names
        def __getattr__(self, name: str) -> Any:
            raise no_call(self, name)

    def points(self, name: str, positions: npt.ArrayLike, *, colors: Optional[Colors] = None, cmap: Optional[str] = None,
               width: Optional[float] = None, unit: str = "voxels", splat: str = "ball",
               transform: Optional[npt.ArrayLike] = None, priority: int = 0, erase: bool = False,
               lifetime: Optional[float] = None, label: str = "") -> Drawn:
        """Draws a cloud, (n, 3). `width`: each point's diameter, in "voxels" or "units"; by default one voxel. Thick points
        are a "ball", a "soft" one, which fades out, or a "cube"; "cell" draws as `voxels` does."""
        return self._draw(name, shapes.points, (positions,),
                          dict(colors=colors, cmap=cmap, width=width, unit=unit, splat=splat),
                          Look.of(transform, priority, erase, lifetime, label))

    def voxels(self, name: str, cells: npt.ArrayLike, *, colors: Optional[Colors] = None, cmap: Optional[str] = None,
               transform: Optional[npt.ArrayLike] = None, priority: int = 0, erase: bool = False,
               lifetime: Optional[float] = None, label: str = "") -> Drawn:
        """Draws a sparse list of voxels on a lattice of its own, (n, 3) integers: each is the cube of 1 unit from (x, y, z)
        on, under `transform`; neighbouring cells leave no gaps."""
        return self._draw(name, shapes.points, (cells,), dict(colors=colors, cmap=cmap, splat="cell"),
                          Look.of(transform, priority, erase, lifetime, label))

    def lines(self, name: str, positions: npt.ArrayLike, *, colors: Optional[Colors] = None, cmap: Optional[str] = None,
              segment_colors: Optional[Colors] = None, mode: Optional[str] = None, width: Optional[float] = None, unit: str = "voxels", sampling: str = "thin",
              transform: Optional[npt.ArrayLike] = None, priority: int = 0, erase: bool = False,
              lifetime: Optional[float] = None, label: str = "") -> Drawn:
        """Draws (n, 3) as a "strip", a "loop" or "pairs"; or (m, k, 3) as m strips (or loops) of k vertices each. Colours are
        interpolated between vertices; or each segment has its own, `segment_colors`."""
        return self._draw(name, shapes.lines, (positions,),
                          dict(colors=colors, cmap=cmap, segment_colors=segment_colors, mode=mode, width=width, unit=unit, sampling=sampling),
                          Look.of(transform, priority, erase, lifetime, label))

    def mesh(self, name: str, vertices: npt.ArrayLike, faces: Optional[npt.ArrayLike] = None, *,
             colors: Optional[Colors] = None, cmap: Optional[str] = None, face_colors: Optional[Colors] = None,
             texture: Optional[PictureFile] = None, uv: Optional[npt.ArrayLike] = None, rule: str = "thin", fill: str = "surface",
             shell: Optional[float] = None, unit: str = "voxels",
             transform: Optional[npt.ArrayLike] = None, priority: int = 0, erase: bool = False,
             lifetime: Optional[float] = None, label: str = "") -> Drawn:
        """Draws triangles: `faces` are (m, 3) indices; without them, vertices are used three by three. `rule`: "thin" or
        "cover". `fill`: "surface", "lines", "dots" or "solid": the inside of a closed mesh, in one colour. `texture` is a PNG
        or JPEG file's path or bytes, which multiplies colours; `uv` (n, 2) are the vertices' places on it: from (0, 0), its
        upper left corner, to (1, 1); beyond it repeats. `face_colors`, in place of `colors`: one per triangle. `shell`:
        thickness of the surface, in "voxels" or "units"."""
        return self._draw(name, shapes.mesh, (vertices, faces),
                          dict(colors=colors, cmap=cmap, face_colors=face_colors, texture=texture, uv=uv, rule=rule, fill=fill,
                               shell=shell, unit=unit), Look.of(transform, priority, erase, lifetime, label))

    def box(self, name: str, center: npt.ArrayLike = (0, 0, 0), size: npt.ArrayLike = 1.0, *, color: Optional[Colors] = None,
            fill: str = "surface", rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels",
            transform: Optional[npt.ArrayLike] = None, priority: int = 0,
            erase: bool = False, lifetime: Optional[float] = None, label: str = "") -> Drawn:
        """Draws a box. `size`: three edge lengths or one. `fill`: "surface", "solid", "lines" or "dots". `shell`: the
        surface's thickness."""
        return self._draw(name, shapes.box, (center, size), dict(color=color, fill=fill, rule=rule, shell=shell, unit=unit),
                          Look.of(transform, priority, erase, lifetime, label))

    def sphere(self, name: str, center: npt.ArrayLike = (0, 0, 0), radius: float = 0.5, *, color: Optional[Colors] = None,
               fill: str = "surface", rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels",
            transform: Optional[npt.ArrayLike] = None, priority: int = 0,
               erase: bool = False, lifetime: Optional[float] = None, label: str = "") -> Drawn:
        """Draws a sphere; under a transform, an ellipsoid. `fill`: "surface", "solid", "lines" or "dots". `shell`: the
        surface's thickness."""
        return self._draw(name, shapes.sphere, (center, radius), dict(color=color, fill=fill, rule=rule, shell=shell, unit=unit),
                          Look.of(transform, priority, erase, lifetime, label))

    def cylinder(self, name: str, center: npt.ArrayLike = (0, 0, 0), radius: float = 0.5, height: float = 1.0, *,
                 color: Optional[Colors] = None, fill: str = "surface", rule: str = "thin",
                 shell: Optional[float] = None, unit: str = "voxels", transform: Optional[npt.ArrayLike] = None, priority: int = 0, erase: bool = False,
                 lifetime: Optional[float] = None, label: str = "") -> Drawn:
        """Draws a cylinder along z, centred. `fill`: "surface", "solid", "lines" or "dots". `shell`: the surface's thickness."""
        return self._draw(name, shapes.cylinder, (center, radius, height), dict(color=color, fill=fill, rule=rule, shell=shell, unit=unit),
                          Look.of(transform, priority, erase, lifetime, label))

    def volume(self, name: str, array: npt.ArrayLike, *, threshold: Optional[float] = None, cmap: str = "viridis",
               low: Optional[float] = None, high: Optional[float] = None,
               extent: Optional[tuple[npt.ArrayLike, npt.ArrayLike]] = None, transform: Optional[npt.ArrayLike] = None,
               priority: int = 0, erase: bool = False, lifetime: Optional[float] = None, label: str = "") -> Drawn:
        """Draws a field, (nx, ny, nz) numbers or (nx, ny, nz, 3) colours, as points at the centres of its cells: those above
        `threshold` (default: half-way from least to greatest; for colours the brightest channel, 0 to 1). Numbers are coloured
        by `cmap` from `low` to `high`. `extent`: the field's two corners; by default it fills [-1, 1] on its longest axis. A
        field coarser than the display leaves gaps between its points."""
        return self._draw(name, shapes.volume, (array,),
                          dict(threshold=threshold, cmap=cmap, low=low, high=high, extent=extent),
                          Look.of(transform, priority, erase, lifetime, label))

    def instance(self, name: str, of: str, *, color: Optional[Colors] = None, tint: Optional[Colors] = None, transform: Optional[npt.ArrayLike] = None,
                 priority: int = 0, erase: bool = False, lifetime: Optional[float] = None, label: str = "") -> Drawn:
        """Draws the object `of`, with its colours multiplied by `tint`."""
        return self._draw(name, shapes.instance, (checked_name(of, "object"),), dict(color=color, tint=tint),
                          Look.of(transform, priority, erase, lifetime, label))
