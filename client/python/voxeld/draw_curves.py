"""Drawing calls for curves, surfaces of Bézier patches, arrows, text and grids."""
from __future__ import annotations

from typing import Any, Optional, Sequence, Union

import numpy.typing as npt

from . import curves, grids
from .assets import Asset
from .colors import Colors
from .draw_measured import Drawn, DrawMeasured
from .look import Look
from .options import named


@named
class DrawCurves(DrawMeasured[Drawn]):
    """For lines, `width` is the thickness, in "voxels" or "units" (by default one voxel), and `sampling` is "thin",
    "euclidean" or "cover". `look` is `transform`, `priority`, `erase`, `lifetime` and `label`, as in all calls."""

    def curve(self, name: str, points: npt.ArrayLike, *, form: str = "catmull-rom", closed: bool = False,
              colors: Optional[Colors] = None, cmap: Optional[str] = None, width: Optional[float] = None, unit: str = "voxels",
              sampling: str = "thin", **look: Any) -> Drawn:
        """Draws a smooth line along (n, 3) points: through all of them ("catmull-rom"), near them ("b-spline"), or as Béziers:
        "bezier" (an end, two handles, an end, …) or "quadratic" (an end, a handle, an end, …)."""
        return self._draw(name, curves.curve, (points,), dict(form=form, closed=closed, colors=colors, cmap=cmap, width=width,
                                                              unit=unit, sampling=sampling), Look.of(**look))

    def arc(self, name: str, center: npt.ArrayLike = (0, 0, 0), radius: float = 0.5, *, normal: npt.ArrayLike = (0, 0, 1),
            toward: Optional[npt.ArrayLike] = None, start: float = 0.0, sweep: Optional[float] = None,
            color: Optional[Colors] = None, width: Optional[float] = None, unit: str = "voxels", sampling: str = "thin",
            **look: Any) -> Drawn:
        """Draws a circle, or `sweep` radians of it from `start` on, counter-clockwise as seen from where `normal` points to."""
        return self._draw(name, curves.arc, (center, radius), dict(normal=normal, toward=toward, start=start, sweep=sweep,
                                                                   color=color, width=width, unit=unit, sampling=sampling),
                          Look.of(**look))

    def ellipse(self, name: str, center: npt.ArrayLike = (0, 0, 0), axis_a: npt.ArrayLike = (1, 0, 0),
                axis_b: npt.ArrayLike = (0, 0.5, 0), *, start: float = 0.0, sweep: Optional[float] = None,
                color: Optional[Colors] = None, width: Optional[float] = None, unit: str = "voxels", sampling: str = "thin",
                **look: Any) -> Drawn:
        """Draws the ellipse center + cos(t)·axis_a + sin(t)·axis_b, or an arc of it."""
        return self._draw(name, curves.ellipse, (center, axis_a, axis_b),
                          dict(start=start, sweep=sweep, color=color, width=width, unit=unit, sampling=sampling),
                          Look.of(**look))

    def helix(self, name: str, start: npt.ArrayLike = (0, 0, -0.5), end: npt.ArrayLike = (0, 0, 0.5), radius: float = 0.3,
              turns: float = 3.0, *, end_radius: Optional[float] = None, toward: Optional[npt.ArrayLike] = None,
              color: Optional[Colors] = None, width: Optional[float] = None, unit: str = "voxels", sampling: str = "thin",
              **look: Any) -> Drawn:
        """Draws a line around the axis from `start` to `end`, right-handed, or left-handed if `turns` is less than 0."""
        return self._draw(name, curves.helix, (start, end, radius, turns),
                          dict(end_radius=end_radius, toward=toward, color=color, width=width, unit=unit, sampling=sampling),
                          Look.of(**look))

    def bezier_surface(self, name: str, patches: npt.ArrayLike, *, colors: Optional[Colors] = None, rule: str = "thin",
                       fill: str = "surface", shell: Optional[float] = None, unit: str = "voxels", **look: Any) -> Drawn:
        """Draws bicubic patches, (4, 4, 3) or (n, 4, 4, 3) control points. `fill`: "surface", "lines" (their edges) or "dots".
        `shell`: thickness of the surface, in "voxels" or "units"."""
        return self._draw(name, curves.bezier_surface, (patches,),
                          dict(colors=colors, rule=rule, fill=fill, shell=shell, unit=unit), Look.of(**look))

    def arrow(self, name: str, start: npt.ArrayLike = (0, 0, 0), end: npt.ArrayLike = (0, 0, 1), *, shaft_radius: float = 0.0,
              head_length: Optional[float] = None, head_radius: Optional[float] = None, color: Optional[Colors] = None,
              fill: str = "surface", rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels",
              **look: Any) -> Drawn:
        """Draws an arrow, by default as thin as a voxel, with a head of a quarter of the length."""
        return self._draw(name, curves.arrow, (start, end), dict(shaft_radius=shaft_radius, head_length=head_length,
                                                                 head_radius=head_radius, color=color, fill=fill, rule=rule,
                                                                 shell=shell, unit=unit), Look.of(**look))

    def text(self, name: str, content: str, position: npt.ArrayLike = (0, 0, 0), height: float = 0.2, *,
             facing: npt.ArrayLike = (0, 0, 1), up: Optional[npt.ArrayLike] = None, style: str = "filled", align: str = "left",
             line_spacing: float = 1.0, wrap: Optional[float] = None, font: str = "", depth: float = 0.0,
             color: Optional[Colors] = None, rule: str = "thin", width: Optional[float] = None, unit: str = "voxels",
             **look: Any) -> Drawn:
        """Draws Unicode text; `height` is that of capital letters, and `facing` points to the reader. `style`: "filled" (solid
        with a `depth`), "outline" or "strokes" (single lines, for few voxels). Lines longer than `wrap` are broken."""
        return self._draw(name, curves.text, (content, position, height), dict(
            facing=facing, up=up, style=style, align=align, line_spacing=line_spacing, wrap=wrap, font=font, depth=depth,
            color=color, rule=rule, width=width, unit=unit), Look.of(**look))

    def grid(self, name: str, array: Union[npt.ArrayLike, Asset], *, values: Optional[Sequence[float]] = None,
             colors: Optional[Sequence[Any]] = None, cmap: Optional[str] = None, opacities: Optional[Sequence[float]] = None,
             extent: grids.Extent = None, filter: str = "linear", color: Optional[Colors] = None, **look: Any) -> Drawn:
        """Draws a volume without gaps: (nx, ny, nz) numbers, uint8, uint16 or float32, or (nx, ny, nz, 4) uint8 colours, whose
        fourth channel dims them and hides what is 0. Numbers are coloured by `values`: with one colour each, or a map
        stretched from the first to the last; `opacities` may hide them with 0. Without values, numbers above the middle are
        drawn. `extent`: the two corners; by default it fills [-1, 1] on its longest axis. `filter`: "linear" or "nearest"."""
        return self._draw(name, grids.grid, (array,), dict(values=values, colors=colors, cmap=cmap, opacities=opacities,
                                                           extent=extent, filter=filter, color=color), Look.of(**look))

    def isosurface(self, name: str, array: Union[npt.ArrayLike, Asset], level: float, *, extent: grids.Extent = None,
                   filter: str = "linear", color: Optional[Colors] = None, fill: str = "surface", rule: str = "thin",
                   shell: Optional[float] = None, unit: str = "voxels", **look: Any) -> Drawn:
        """Draws the surface where (nx, ny, nz) numbers reach a level or, as a solid, all that is not below it."""
        return self._draw(name, grids.isosurface, (array, level), dict(
            extent=extent, filter=filter, color=color, fill=fill, rule=rule, shell=shell, unit=unit), Look.of(**look))
