"""Encodes shapes that are defined by measures, and implicit shapes, as wire bytes."""
from __future__ import annotations

from typing import Any, Mapping, Optional, Sequence, Union, cast

import numpy as np
import numpy.typing as npt

from . import colors as colors_
from . import wire
from .arrays import as_array, number, positions, require_finite, vector
from .colors import Colors
from .errors import InvalidArray, InvalidValue
from .expressions import Expression
from .shapes import FILLS, PIECE_BYTES, RULES, choice, solid, thickness, vec
from .texture import PictureFile, picture_fields
from .v1 import primitives_pb2 as pb
from .v1 import types_pb2

Color = Optional[Colors]
Formula = Union[str, Expression]

_BOUNDARY_FORMS = {"polyline": pb.Boundary.POLYLINE, "catmull-rom": pb.Boundary.CATMULL_ROM, "b-spline": pb.Boundary.B_SPLINE}
_AXES = {"z": pb.Boundary.Z, "x": pb.Boundary.X, "y": pb.Boundary.Y}


def _rule(rule: str, shell: Optional[float], unit: str) -> dict[str, Any]:
    return dict(rule=choice(RULES, rule, "rule"), shell=thickness(shell, unit, "shell"))


def _curves(curves: Union[npt.ArrayLike, Sequence[npt.ArrayLike]], what: str) -> dict[str, Any]:
    """Encodes one closed curve, (n, 3), or several."""
    try:
        whole = [positions(cast(npt.ArrayLike, curves), what)[0]]
    except InvalidArray:
        if not isinstance(curves, Sequence):
            raise
        whole = [positions(curve, f"{what}[{i}]")[0] for i, curve in enumerate(curves)]
    ends: list[int] = []
    points: list[float] = []
    for curve in whole:
        if len(curve) < 3:
            raise InvalidArray(f"{what}: a closed curve has 3 vertices at least, got {len(curve)}")
        points += [float(c) for c in curve.reshape(-1)]
        ends.append(len(points) // 3)
    return dict(points=points, ends=ends)


def ellipsoid(center: npt.ArrayLike, radii: npt.ArrayLike, *, color: Color = None, fill: str = "surface", rule: str = "thin",
              shell: Optional[float] = None, unit: str = "voxels") -> list[wire.Packed]:
    for radius, axis in zip(vector(radii, "radii"), "xyz"):
        number(radius, f"the radius along {axis}", above=0)
    return solid(color, ellipsoid=pb.Ellipsoid(center=vec(center, "center"), radii=vec(radii, "radii"),
                                               fill=choice(FILLS, fill, "fill"), **_rule(rule, shell, unit)))


def torus(center: npt.ArrayLike, radius: float, tube_radius: float, *, color: Color = None, fill: str = "surface",
          rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels") -> list[wire.Packed]:
    return solid(color, torus=pb.Torus(center=vec(center, "center"), radius=number(radius, "radius", above=0),
                                       tube_radius=number(tube_radius, "tube_radius", above=0),
                                       fill=choice(FILLS, fill, "fill"), **_rule(rule, shell, unit)))


def cone(start: npt.ArrayLike, end: npt.ArrayLike, start_radius: float, end_radius: float, *, round_ends: bool = False,
         color: Color = None, fill: str = "surface", rule: str = "thin", shell: Optional[float] = None,
         unit: str = "voxels") -> list[wire.Packed]:
    return solid(color, cone=pb.Cone(
        start=vec(start, "start"), end=vec(end, "end"), start_radius=number(start_radius, "start_radius", least=0),
        end_radius=number(end_radius, "end_radius", least=0), round_ends=bool(round_ends), fill=choice(FILLS, fill, "fill"),
        **_rule(rule, shell, unit)))


def parallelepiped(center: npt.ArrayLike, edges: npt.ArrayLike, *, color: Color = None, fill: str = "surface",
                   rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels") -> list[wire.Packed]:
    a, b, c = _edges(edges, 3)
    return solid(color, parallelepiped=pb.Parallelepiped(center=vec(center, "center"), edge_a=a, edge_b=b, edge_c=c,
                                                         fill=choice(FILLS, fill, "fill"), **_rule(rule, shell, unit)))


def _edges(edges: npt.ArrayLike, count: int) -> list[types_pb2.Vec3]:
    array, _ = positions(edges, "edges")
    if len(array) != count:
        raise InvalidArray(f"edges must be of shape ({count}, 3), got {array.shape}")
    return [vec(edge, "edges") for edge in array]


def disc(center: npt.ArrayLike, radius: float, *, normal: npt.ArrayLike = (0, 0, 1), inner_radius: float = 0, color: Color = None,
         fill: str = "surface", rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels") -> list[wire.Packed]:
    return solid(color, disc=pb.Disc(center=vec(center, "center"), normal=vec(normal, "normal"),
                                     radius=number(radius, "radius", above=0),
                                     inner_radius=number(inner_radius, "inner_radius", least=0),
                                     fill=choice(FILLS, fill, "fill"), **_rule(rule, shell, unit)))


def patch(corner: npt.ArrayLike, edges: npt.ArrayLike, *, color: Color = None, fill: str = "surface", rule: str = "thin",
          shell: Optional[float] = None, unit: str = "voxels") -> list[wire.Packed]:
    a, b = _edges(edges, 2)
    return solid(color, patch=pb.Patch(corner=vec(corner, "corner"), edge_a=a, edge_b=b, fill=choice(FILLS, fill, "fill"),
                                       **_rule(rule, shell, unit)))


def polygon(curves: Union[npt.ArrayLike, Sequence[npt.ArrayLike]], *, color: Color = None, fill: str = "surface",
            rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels") -> list[wire.Packed]:
    return solid(color, polygon=pb.Polygon(**_curves(curves, "curves"), fill=choice(FILLS, fill, "fill"),
                                           **_rule(rule, shell, unit)))


def height_map(heights: npt.ArrayLike, *, corner: npt.ArrayLike = (-1, -1, 0),
               edges: npt.ArrayLike = ((2, 0, 0), (0, 2, 0)), up: npt.ArrayLike = (0, 0, 1),
               colors: Color = None, cmap: Optional[str] = None, texture: Optional[PictureFile] = None,
               fill: str = "surface", rule: str = "thin", shell: Optional[float] = None,
               unit: str = "voxels") -> list[wire.Packed]:
    """`heights` has the shape (rows, columns). `colors`: one colour, (rows, columns, 3), or with a map (rows, columns)
    numbers."""
    field = as_array(heights, "heights")
    if field.ndim != 2 or min(field.shape) < 2:
        raise InvalidArray(f"heights must be of shape (rows, columns), 2 of each at least, got {field.shape}")
    require_finite(field, "heights")
    samples = np.ascontiguousarray(field, np.float32)
    rows, columns = samples.shape
    first, second = (np.array(vector(edge, "edges"), np.float64) for edge in as_array(edges, "edges").reshape(2, 3))
    start = np.array(vector(corner, "corner"))
    each = colors
    if isinstance(colors, np.ndarray) and colors.ndim == 3:
        each = colors.reshape(-1, colors.shape[2])
    elif cmap is not None and colors is not None:
        each = np.asarray(colors).reshape(-1)
    found = colors_.many(each, rows * columns, cmap)
    uniform = found if isinstance(found, int) else None
    rgb = None if found is None or isinstance(found, int) else np.ascontiguousarray(found[:, :3])
    look: dict[str, Any] = dict(fill=choice(FILLS, fill, "fill"), **_rule(rule, shell, unit))
    most = max(2, PIECE_BYTES // (columns * (4 if rgb is None else 7)))
    if texture is not None:
        look.update(picture_fields(texture))
        if most < rows:
            raise InvalidArray(f"heights: {rows} by {columns} are more than go at once, and a picture lies over all of them; "
                               "leave out rows and columns, or give colors")
    result = []
    for begin in range(0, rows - 1, most - 1):  # a row in common
        end = min(begin + most, rows)
        piece = pb.HeightMap(
            corner=vec(start + second * (begin / (rows - 1)), "corner"), edge_a=vec(first, "edges"),
            edge_b=vec(second * ((end - 1 - begin) / (rows - 1)), "edges"), up=vec(up, "up"), columns=columns, rows=end - begin,
            **look, heights=samples[begin:end].tobytes(),
            colors=b"" if rgb is None else rgb[begin * columns:end * columns].tobytes())
        color = None if uniform is None else pb.Color(rgb=uniform)
        result.append(wire.message(pb.Primitive(color=color, height_map=piece)))
    return result


def implicit(surface: Formula, *, bound: Optional[Formula] = None,
             boundary: Union[None, npt.ArrayLike, Sequence[npt.ArrayLike]] = None, boundary_axis: str = "z",
             boundary_form: str = "polyline", parameters: Optional[Mapping[str, float]] = None, fill: Optional[str] = None, rule: str = "thin",
             shell: Optional[float] = None, unit: str = "voxels",
             domain: Optional[tuple[npt.ArrayLike, npt.ArrayLike]] = None, color: Color = None,
             rgb: Optional[tuple[Formula, Formula, Formula]] = None, level: Optional[Formula] = None,
             cmap: Optional[str] = None) -> list[wire.Packed]:
    if not isinstance(surface, Expression) and (not isinstance(surface, str) or not surface.strip()):
        raise InvalidValue(f"the surface is {surface!r}; give an expression, such as 'x^2 + y^2 + z^2 <= 1'")
    if (level is None) != (cmap is None):
        raise InvalidValue(f"level is {level!r} and cmap is {cmap!r}; each goes with the other")
    shape = pb.Implicit(surface=_text(surface), rule=choice(RULES, rule, "rule"), shell=thickness(shell, unit, "shell"),
                        colormap=cmap or "")
    if bound is not None:
        shape.bound.CopyFrom(_text(bound))
    if boundary is not None:
        shape.boundary.CopyFrom(pb.Boundary(axis=choice(_AXES, boundary_axis, "boundary_axis"),
                                            form=choice(_BOUNDARY_FORMS, boundary_form, "boundary_form"),
                                            **_curves(boundary, "boundary")))
    for name, value in (parameters or {}).items():
        if not name.isidentifier() or not name.isascii():
            raise InvalidValue(f"a parameter is called {name!r}; letters, digits and _ make a name, a digit not first")
        shape.parameter_names += f" {name}" if shape.parameter_names else name
        shape.parameter_values.append(number(value, f"the parameter {name}"))
    if fill is not None:
        shape.fill = choice(FILLS, fill, "fill")
    if domain is not None:
        shape.domain.CopyFrom(types_pb2.Box3(min=vec(domain[0], "domain[0]"), max=vec(domain[1], "domain[1]")))
    if rgb is not None:
        if len(rgb) != 3:
            raise InvalidValue(f"rgb has {len(rgb)} expressions; give red, green and blue")
        for field, text in zip((shape.red, shape.green, shape.blue), rgb):
            field.CopyFrom(_text(text))
    if level is not None:
        shape.level.CopyFrom(_text(level))
    return solid(color, implicit=shape)


def _text(formula: Formula) -> pb.Expression:
    return formula.to_wire() if isinstance(formula, Expression) else pb.Expression(text=formula)
