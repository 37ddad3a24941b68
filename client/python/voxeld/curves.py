"""Encodes curves, surfaces of Bézier patches, arrows and text as wire bytes."""
from __future__ import annotations

from typing import Any, Optional

import numpy as np
import numpy.typing as npt

from . import colors as colors_
from . import wire
from .arrays import as_array, number, positions
from .colors import Colors
from .errors import InvalidArray, InvalidValue
from .shapes import FILLS, PIECE_BYTES, RULES, SAMPLINGS, choice, packed, solid, split_colors, thickness, vec
from .v1 import primitives_pb2 as pb

Color = Optional[Colors]

_FORMS = {"catmull-rom": (pb.Curve.CATMULL_ROM, 1, 2), "b-spline": (pb.Curve.B_SPLINE, 1, 2), "bezier": (pb.Curve.BEZIER, 3, 4),
          "quadratic": (pb.Curve.QUADRATIC, 2, 3)}
_STYLES = {"filled": pb.Text.FILLED, "outline": pb.Text.OUTLINE, "strokes": pb.Text.STROKES}
_ALIGNMENTS = {"left": pb.Text.LEFT, "center": pb.Text.CENTER, "right": pb.Text.RIGHT}


def _line(width: Optional[float], unit: str, sampling: str) -> dict[str, Any]:
    return dict(thickness=thickness(width, unit), sampling=choice(SAMPLINGS, sampling, "sampling"))


def _within_a_piece(nbytes: int, what: str) -> None:
    if nbytes > PIECE_BYTES:
        raise InvalidArray(f"{what} take {nbytes} bytes, more than the {PIECE_BYTES} that go at once; draw it in parts")


def curve(at: npt.ArrayLike, *, form: str = "catmull-rom", closed: bool = False, colors: Color = None, cmap: Optional[str] = None,
          width: Optional[float] = None, unit: str = "voxels", sampling: str = "thin") -> list[wire.Packed]:
    array, element = positions(at, "points")
    word, step, least = choice(_FORMS, form, "form")
    fits = len(array) % step == 0 and len(array) >= max(step, 3 if step == 1 else step) if closed else (
        len(array) >= least and len(array) % step == 1 % step)
    if not fits:
        right = f"{step} for each span" if closed and step > 1 else "3 or more" if closed else (
            f"1 and {step} for each span" if step > 1 else "2 or more")
        raise InvalidArray(f"points: got {len(array)}; a {'closed ' if closed else ''}{form} curve takes {right}")
    color, each = split_colors(colors_.many(colors_.along(colors, array), len(array), cmap))
    vertices = wire.vertices(array, element, each)
    _within_a_piece(len(vertices), "points")
    head = pb.Curve(form=word, closed=bool(closed), **_line(width, unit, sampling)).SerializeToString()
    return [packed("curve", head, vertices, color)]


def arc(center: npt.ArrayLike, radius: float, *, normal: npt.ArrayLike = (0, 0, 1), toward: Optional[npt.ArrayLike] = None,
        start: float = 0, sweep: Optional[float] = None, color: Color = None, width: Optional[float] = None, unit: str = "voxels",
        sampling: str = "thin") -> list[wire.Packed]:
    return solid(color, arc=pb.Arc(
        center=vec(center, "center"), normal=vec(normal, "normal"), radius=number(radius, "radius", above=0),
        toward=None if toward is None else vec(toward, "toward"), start=number(start, "start"), sweep=_sweep(sweep),
        **_line(width, unit, sampling)))


def ellipse(center: npt.ArrayLike, axis_a: npt.ArrayLike, axis_b: npt.ArrayLike, *, start: float = 0,
            sweep: Optional[float] = None, color: Color = None, width: Optional[float] = None, unit: str = "voxels",
            sampling: str = "thin") -> list[wire.Packed]:
    return solid(color, ellipse=pb.Ellipse(
        center=vec(center, "center"), axis_a=vec(axis_a, "axis_a"), axis_b=vec(axis_b, "axis_b"), start=number(start, "start"),
        sweep=_sweep(sweep), **_line(width, unit, sampling)))


def _sweep(sweep: Optional[float]) -> float:
    if sweep is None:
        return 0
    value = number(sweep, "sweep")
    if value == 0 or abs(value) > 2 * np.pi + 1e-6:
        raise InvalidValue(f"sweep is {value}; give radians, -2π to 2π and not 0, or None for all around")
    return value


def helix(start: npt.ArrayLike, end: npt.ArrayLike, radius: float, turns: float, *, end_radius: Optional[float] = None,
          toward: Optional[npt.ArrayLike] = None, color: Color = None, width: Optional[float] = None, unit: str = "voxels",
          sampling: str = "thin") -> list[wire.Packed]:
    if number(turns, "turns") == 0:
        raise InvalidValue("turns is 0; give how often it winds around, less than 0 for left-handed")
    shape = pb.Helix(start=vec(start, "start"), end=vec(end, "end"), radius=number(radius, "radius", above=0),
                     turns=float(turns), toward=None if toward is None else vec(toward, "toward"), **_line(width, unit, sampling))
    if end_radius is not None:
        shape.end_radius = number(end_radius, "end_radius", least=0)
    return solid(color, helix=shape)


def bezier_surface(patches: npt.ArrayLike, *, colors: Color = None, rule: str = "thin",
                   fill: str = "surface", shell: Optional[float] = None, unit: str = "voxels") -> list[wire.Packed]:
    """`patches` has the shape (4, 4, 3) or (n, 4, 4, 3)."""
    field = as_array(patches, "patches")
    if field.ndim not in (3, 4) or field.shape[-3:] != (4, 4, 3):
        raise InvalidArray(f"patches must be of shape (4, 4, 3) or (n, 4, 4, 3), got {field.shape}")
    array, element = positions(field.reshape(-1, 3), "patches")
    color, each = split_colors(colors_.many(colors, len(array)))
    vertices = wire.vertices(array, element, each)
    _within_a_piece(len(vertices), "patches")
    head = pb.BezierSurface(rule=choice(RULES, rule, "rule"), fill=choice(FILLS, fill, "fill"),
                            shell=thickness(shell, unit, "shell")).SerializeToString()
    return [packed("bezier_surface", head, vertices, color)]


def arrow(start: npt.ArrayLike, end: npt.ArrayLike, *, shaft_radius: float = 0, head_length: Optional[float] = None,
          head_radius: Optional[float] = None, color: Color = None, fill: str = "surface", rule: str = "thin",
          shell: Optional[float] = None, unit: str = "voxels") -> list[wire.Packed]:
    return solid(color, arrow=pb.Arrow(
        start=vec(start, "start"), end=vec(end, "end"), shaft_radius=number(shaft_radius, "shaft_radius", least=0),
        head_length=0 if head_length is None else number(head_length, "head_length", above=0),
        head_radius=0 if head_radius is None else number(head_radius, "head_radius", above=0),
        fill=choice(FILLS, fill, "fill"), rule=choice(RULES, rule, "rule"), shell=thickness(shell, unit, "shell")))


def text(content: str, position: npt.ArrayLike, height: float, *, facing: npt.ArrayLike = (0, 0, 1),
         up: Optional[npt.ArrayLike] = None, style: str = "filled", align: str = "left", line_spacing: float = 1.0,
         wrap: Optional[float] = None, font: str = "", depth: float = 0.0, color: Color = None, rule: str = "thin",
         width: Optional[float] = None, unit: str = "voxels") -> list[wire.Packed]:
    if not isinstance(content, str):
        raise InvalidValue(f"the text is {content!r}; give a str")
    return solid(color, text=pb.Text(
        text=content, height=number(height, "height", above=0), position=vec(position, "position"), facing=vec(facing, "facing"),
        up=None if up is None else vec(up, "up"), style=choice(_STYLES, style, "style"),
        alignment=choice(_ALIGNMENTS, align, "align"), line_spacing=number(line_spacing, "line_spacing", above=0),
        width=0 if wrap is None else number(wrap, "wrap", above=0), font=font, depth=number(depth, "depth", least=0),
        rule=choice(RULES, rule, "rule"), thickness=thickness(width, unit)))
