"""Drawing calls for shapes that are defined by measures, and for implicit shapes."""
from __future__ import annotations

from typing import Any, Callable, Generic, Mapping, Optional, Sequence, TypeVar, Union

import numpy.typing as npt

from . import measured, wire
from .colors import Colors
from .look import Look
from .measured import Formula
from .options import named
from .texture import PictureFile

Drawn = TypeVar("Drawn", covariant=True)
Make = Callable[..., list[wire.Packed]]
Curves = Union[npt.ArrayLike, Sequence[npt.ArrayLike]]


@named
class DrawMeasured(Generic[Drawn]):
    """In each call, `fill` is "surface" or "solid", `rule` is "thin" or "cover", and `shell` is the thickness of a surface, in
    "voxels" or "units" (by default one voxel). `look` is `transform`, `priority`, `erase`, `lifetime` and `label`, as in all
    calls."""

    def _draw(self, name: str, make: Make, args: tuple[Any, ...], options: dict[str, Any], look: Look) -> Drawn:
        raise NotImplementedError

    def ellipsoid(self, name: str, center: npt.ArrayLike = (0, 0, 0), radii: npt.ArrayLike = (1, 1, 1), *,
                  color: Optional[Colors] = None, fill: str = "surface", rule: str = "thin", shell: Optional[float] = None,
                  unit: str = "voxels", **look: Any) -> Drawn:
        """Draws an ellipsoid along the axes."""
        return self._draw(name, measured.ellipsoid, (center, radii),
                          dict(color=color, fill=fill, rule=rule, shell=shell, unit=unit), Look.of(**look))

    def torus(self, name: str, center: npt.ArrayLike = (0, 0, 0), radius: float = 0.5, tube_radius: float = 0.2, *,
              color: Optional[Colors] = None, fill: str = "surface", rule: str = "thin", shell: Optional[float] = None,
              unit: str = "voxels", **look: Any) -> Drawn:
        """Draws a torus around z: `radius` is that of the circle that the tube follows."""
        return self._draw(name, measured.torus, (center, radius, tube_radius),
                          dict(color=color, fill=fill, rule=rule, shell=shell, unit=unit), Look.of(**look))

    def cone(self, name: str, start: npt.ArrayLike = (0, 0, 0), end: npt.ArrayLike = (0, 0, 1), start_radius: float = 0.5,
             end_radius: float = 0.0, *, round_ends: bool = False, color: Optional[Colors] = None, fill: str = "surface",
             rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels", **look: Any) -> Drawn:
        """Draws from `start` to `end`, with a radius at either end: a cone, a cylinder or, with `round_ends`, a capsule."""
        return self._draw(name, measured.cone, (start, end, start_radius, end_radius),
                          dict(round_ends=round_ends, color=color, fill=fill, rule=rule, shell=shell, unit=unit),
                          Look.of(**look))

    def parallelepiped(self, name: str, center: npt.ArrayLike, edges: npt.ArrayLike, *, color: Optional[Colors] = None,
                       fill: str = "surface", rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels",
                       **look: Any) -> Drawn:
        """Draws a box in any orientation: `edges` are three, (3, 3)."""
        return self._draw(name, measured.parallelepiped, (center, edges),
                          dict(color=color, fill=fill, rule=rule, shell=shell, unit=unit), Look.of(**look))

    def disc(self, name: str, center: npt.ArrayLike = (0, 0, 0), radius: float = 0.5, *, normal: npt.ArrayLike = (0, 0, 1),
             inner_radius: float = 0.0, color: Optional[Colors] = None, fill: str = "surface", rule: str = "thin",
             shell: Optional[float] = None, unit: str = "voxels", **look: Any) -> Drawn:
        """Draws a disc perpendicular to `normal`; with an inner radius, a ring. `fill`: "surface", "lines" or "dots"."""
        return self._draw(name, measured.disc, (center, radius),
                          dict(normal=normal, inner_radius=inner_radius, color=color, fill=fill, rule=rule, shell=shell,
                               unit=unit),
                          Look.of(**look))

    def patch(self, name: str, corner: npt.ArrayLike, edges: npt.ArrayLike, *, color: Optional[Colors] = None,
              fill: str = "surface", rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels",
              **look: Any) -> Drawn:
        """Draws a parallelogram: `edges` are the two at the corner, (2, 3). `fill`: "surface", "lines" or "dots"."""
        return self._draw(name, measured.patch, (corner, edges),
                          dict(color=color, fill=fill, rule=rule, shell=shell, unit=unit), Look.of(**look))

    def polygon(self, name: str, curves: Curves, *, color: Optional[Colors] = None, fill: str = "surface",
                rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels", **look: Any) -> Drawn:
        """Draws a plane polygon: one closed curve, (n, 3), or several, where those inside others are holes. `fill`: "surface",
        "lines" or "dots"."""
        return self._draw(name, measured.polygon, (curves,),
                          dict(color=color, fill=fill, rule=rule, shell=shell, unit=unit), Look.of(**look))

    def height_map(self, name: str, heights: npt.ArrayLike, *, corner: npt.ArrayLike = (-1, -1, 0),
                   edges: npt.ArrayLike = ((2, 0, 0), (0, 2, 0)), up: npt.ArrayLike = (0, 0, 1),
                   colors: Optional[Colors] = None, cmap: Optional[str] = None, texture: Optional[PictureFile] = None,
                   fill: str = "surface", rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels",
                   **look: Any) -> Drawn:
        """Draws a surface over a grid of heights, (rows, columns): along `edges[0]` in a row, along `edges[1]` from row to
        row. `colors` is one colour, (rows, columns, 3), or, with a `cmap`, (rows, columns) numbers. `texture`, a PNG or JPEG
        file's path or bytes, covers the whole surface and multiplies colours. `fill`: "surface", "lines" (rows and columns) or
        "dots"."""
        return self._draw(name, measured.height_map, (heights,),
                          dict(corner=corner, edges=edges, up=up, colors=colors, cmap=cmap, texture=texture, fill=fill,
                               rule=rule, shell=shell, unit=unit), Look.of(**look))

    def implicit(self, name: str, surface: Formula, *, bound: Optional[Formula] = None, boundary: Optional[Curves] = None,
                 boundary_axis: str = "z", boundary_form: str = "polyline",
                 parameters: Optional[Mapping[str, float]] = None, fill: Optional[str] = None,
                 rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels",
                 domain: Optional[tuple[npt.ArrayLike, npt.ArrayLike]] = None, color: Optional[Colors] = None,
                 rgb: Optional[tuple[Formula, Formula, Formula]] = None, level: Optional[Formula] = None, cmap: Optional[str] = None,
                 **look: Any) -> Drawn:
        """Draws an implicit shape: where `surface`, an expression in x, y and z, is 0 or, as an inequality, true, such as "x^2
        + y^2 - z = 0 where x^2 + y^2 <= 1", or built from terms (voxeld.expressions). `bound` is a further condition, and
        `boundary` closed curves, projected along an axis: a "polyline", or smooth, "catmull-rom" through their points or
        "b-spline" near them. `parameters` are the names in expressions. `rgb` are expressions from 0 to 1, `level` one that
        `cmap` maps to colours."""
        return self._draw(name, measured.implicit, (surface,),
                          dict(bound=bound, boundary=boundary, boundary_axis=boundary_axis, boundary_form=boundary_form, parameters=parameters, fill=fill,
                               rule=rule, shell=shell, unit=unit, domain=domain, color=color, rgb=rgb, level=level, cmap=cmap),
                          Look.of(**look))
