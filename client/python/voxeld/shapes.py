"""Encodes shapes as wire bytes: each function checks its arguments and returns the primitives that represent them.

Clouds, lines and meshes beyond PIECE_BYTES are split into several primitives, so that no message is large; the caller gives
each an id.
"""
from __future__ import annotations

from typing import Any, Iterator, Optional

import numpy as np
import numpy.typing as npt

from . import colors as colors_
from . import wire
from .arrays import Array, as_array, indices, number, positions, require_finite, vector
from .colors import Colors
from .errors import InvalidArray, InvalidValue
from .texture import PictureFile, to_texture
from .v1 import primitives_pb2 as pb
from .v1 import types_pb2

# Limit of a piece's payload; with its head a message stays below 1 MiB.
PIECE_BYTES = (1 << 20) - (2 << 10)
# Limit of shapes that cannot be split: protobuf's. A session raises an error before sending one that exceeds its server's
# max_message_bytes, which is 16 MiB by default.
WHOLE_BYTES = 1 << 30

_MODES = {"strip": pb.Segments.STRIP, "loop": pb.Segments.LOOP, "pairs": pb.Segments.LIST}
SAMPLINGS = {"thin": pb.LINE_SAMPLING_THIN, "euclidean": pb.LINE_SAMPLING_EUCLIDEAN, "cover": pb.LINE_SAMPLING_COVER}
RULES = {"thin": pb.SURFACE_RULE_THIN, "cover": pb.SURFACE_RULE_COVER}
FILLS = {"surface": pb.FILL_SURFACE, "solid": pb.FILL_SOLID, "lines": pb.FILL_LINES, "dots": pb.FILL_DOTS}
_SPLATS = {"ball": pb.Points.BALL, "soft": pb.Points.SOFT, "cube": pb.Points.CUBE, "cell": pb.Points.CELL}
UNITS = {"voxels": pb.Thickness.VOXELS, "units": pb.Thickness.UNITS}


def choice(table: dict[str, Any], value: str, what: str) -> Any:
    if value not in table:
        raise InvalidValue(f"{what} is {value!r}; give one of {', '.join(map(repr, table))}")
    return table[value]


def thickness(value: Optional[float], unit: str, what: str = "width") -> Optional[pb.Thickness]:
    word = choice(UNITS, unit, "unit")
    return None if value is None else pb.Thickness(value=number(value, what, least=0), unit=word)


def packed(kind: str, head: bytes, vertices: wire.Packed, color: Optional[int]) -> wire.Packed:
    """Returns a primitive of that kind; `head` has its fields except the vertices."""
    before = b"" if color is None else pb.Primitive(color=pb.Color(rgb=color)).SerializeToString()
    return vertices.inside(wire.Field.VERTICES[kind], head).inside(wire.Field.KINDS[kind], before)


def split_colors(color: object) -> tuple[Optional[int], Optional[Array]]:
    return (None, color) if isinstance(color, np.ndarray) else (color if isinstance(color, int) else None, None)


def _pieces(count: int, vertex_bytes: int, whole: int = 1, overlap: int = 0) -> Iterator[slice]:
    """Yields ranges of vertices, each a multiple of `whole`, with `overlap` of them in common with the next."""
    most = PIECE_BYTES // vertex_bytes // whole * whole
    begin = 0
    while begin + overlap < count:
        yield slice(begin, min(begin + most, count))
        begin += most - overlap


def points(at: npt.ArrayLike, *, colors: Optional[Colors] = None, cmap: Optional[str] = None,
           width: Optional[float] = None, unit: str = "voxels",
           splat: str = "ball") -> list[wire.Packed]:
    array, element = positions(at, "points")
    color, each = split_colors(colors_.many(colors_.along(colors, array), len(array), cmap))
    head = pb.Points(thickness=thickness(width, unit), splat=choice(_SPLATS, splat, "splat")).SerializeToString()
    size = array.itemsize * 3 + (0 if each is None else each.shape[1])
    return [packed("points", head,
                       wire.vertices(array[r], element, None if each is None else each[r]), color)
            for r in _pieces(len(array), size)]


def _each_element(colors: Optional[Colors], cmap: Optional[str], count: int, what: str) -> Optional[Array]:
    """Returns (count, 3) colours, one per segment or face."""
    found = colors_.many(colors, count, cmap, "segments" if what == "segment_colors" else "faces")
    if found is None:
        return None
    if isinstance(found, int):
        return np.broadcast_to(np.array([found >> 16 & 255, found >> 8 & 255, found & 255], np.uint8), (count, 3))
    if not isinstance(found, np.ndarray):
        raise InvalidValue(f"{what} is a gradient, which runs along vertices; give it as colors")
    return np.ascontiguousarray(found)


def lines(at: npt.ArrayLike, *, colors: Optional[Colors] = None, cmap: Optional[str] = None,
          segment_colors: Optional[Colors] = None, mode: Optional[str] = None, width: Optional[float] = None,
          unit: str = "voxels", sampling: str = "thin") -> list[wire.Packed]:
    """`at` has the shape (n, 3), by default a strip; or (m, k, 3), m strips of k vertices each. `segment_colors`: one per
    segment."""
    if colors is not None and segment_colors is not None:
        raise InvalidValue("colors and segment_colors are given; give one of them")
    array = as_array(at, "lines")
    many = array.ndim == 3 and array.shape[2] == 3
    if many and array.shape[1] < 2:
        raise InvalidArray(f"lines of shape {array.shape} have {array.shape[1]} vertices each; a line has at least 2")
    strips, each_strip = (array.shape[0], array.shape[1]) if many else (1, len(array))
    array, element = positions(array.reshape(-1, 3) if many else at, "lines")
    topology = choice(_MODES, mode or ("strip"), "mode")
    color, each = split_colors(colors_.many(colors_.along(colors, array), len(array), cmap if segment_colors is None else None))
    if many and each_strip > 2 or many and topology == pb.Segments.LOOP:
        # Convert several strips to pairs.
        start = np.arange(len(array)).reshape(strips, each_strip)
        end = np.roll(start, -1, axis=1)
        if topology != pb.Segments.LOOP:
            start, end = start[:, :-1], end[:, :-1]
        order = np.stack([start, end], axis=-1).reshape(-1)
        array, each = array[order], None if each is None else each[order]
    if many:
        topology = pb.Segments.LIST
    if 0 < len(array) < 2 or topology == pb.Segments.LIST and len(array) % 2:
        need = "pairs need an even number" if topology == pb.Segments.LIST else "a line needs at least 2"
        raise InvalidArray(f"lines: got {len(array)} vertices; {need}")
    pairs = topology == pb.Segments.LIST
    segments = len(array) // 2 if pairs else len(array) if topology == pb.Segments.LOOP else max(len(array) - 1, 0)
    own = _each_element(segment_colors, cmap, segments, "segment_colors") if segment_colors is not None else None
    size = array.itemsize * 3 + (0 if each is None else each.shape[1]) + (0 if own is None else own.shape[1])
    if topology == pb.Segments.LOOP and len(array) * size > PIECE_BYTES:
        array = np.concatenate([array, array[:1]])
        each = None if each is None else np.concatenate([each, each[:1]])
        topology = pb.Segments.STRIP
    head = pb.Segments(topology=topology, sampling=choice(SAMPLINGS, sampling, "sampling"),
                       thickness=thickness(width, unit)).SerializeToString()
    whole, overlap = (2, 0) if pairs else (1, 1)
    result = []
    for r in _pieces(len(array), size, whole, overlap):
        if own is not None:
            last = r.stop if topology == pb.Segments.LOOP else r.stop - 1
            part = wire.vertices(array[r], element, own[r.start // 2:r.stop // 2] if pairs else own[r.start:last], of_elements=True)
        else:
            part = wire.vertices(array[r], element, None if each is None else each[r])
        result.append(packed("segments", head, part, color))
    return result


def mesh(at: npt.ArrayLike, faces: Optional[npt.ArrayLike] = None, *, colors: Optional[Colors] = None,
         cmap: Optional[str] = None, face_colors: Optional[Colors] = None, texture: Optional[PictureFile] = None,
         uv: Optional[npt.ArrayLike] = None, rule: str = "thin", fill: str = "surface", shell: Optional[float] = None,
         unit: str = "voxels") -> list[wire.Packed]:
    """Triangles from `faces`, or from the vertices three by three. `face_colors`: one per triangle."""
    if face_colors is not None and (colors is not None or texture is not None):
        raise InvalidValue(f"face_colors are given, and so is {'colors' if colors is not None else 'a texture'}; give one of them")
    array, element = positions(at, "vertices")
    color, each = split_colors(colors_.many(colors_.along(colors, array), len(array), cmap if face_colors is None else None))
    head = pb.Mesh(rule=choice(RULES, rule, "rule"), fill=choice(FILLS, fill, "fill"),
                   texture=to_texture(texture, uv, len(array)), shell=thickness(shell, unit, "shell")).SerializeToString()
    index = None if faces is None else indices(faces, len(array))
    if index is None and len(array) % 3:
        raise InvalidArray(f"vertices: got {len(array)} without faces; triangles need a multiple of 3")
    if index is not None and len(index) == 0:
        return []
    own = None
    if face_colors is not None:
        own = _each_element(face_colors, cmap, len(array) // 3 if index is None else len(index), "face_colors")
    size = array.itemsize * 3 + (0 if each is None else each.shape[1])
    face = 0 if own is None else own.shape[1]
    together = fill == "solid" or texture is not None  # a part of it is not a solid, and each would have the texture
    whole = len(head) + len(array) * size + (0 if index is None else (12 + face) * len(index))
    if together and whole > WHOLE_BYTES:
        raise InvalidArray(f"the mesh takes {whole} bytes, more than the {WHOLE_BYTES} that a solid, or one with a texture, may "
                           "have; draw its surface, draw it in parts, or a coarser one")

    def one(vertices: Array, colored: Optional[Array], corners: Optional[Array], faces_of: slice = slice(None)) -> wire.Packed:
        if own is not None:
            return packed("mesh", head, wire.vertices(vertices, element, own[faces_of], corners, of_elements=True), color)
        return packed("mesh", head, wire.vertices(vertices, element, colored, corners), color)

    if index is None:
        if together:
            return [one(array, each, None)]
        return [one(array[r], None if each is None else each[r], None, slice(r.start // 3, r.stop // 3))
                for r in _pieces(len(array), size + face, 3)]
    if together or index.nbytes + len(array) * size + len(index) * face <= PIECE_BYTES:
        return [one(array, each, index)]
    # Each piece has only the vertices of its own faces, at most three each.
    result = []
    for r in _pieces(len(index), 12 + face + 3 * size):
        used, corners = np.unique(index[r], return_inverse=True)
        result.append(one(array[used], None if each is None else each[used], corners.reshape(-1, 3).astype(np.uint32), r))
    return result


def solid(color: Optional[Colors], **kind: Any) -> list[wire.Packed]:
    """Returns the single primitive of that kind."""
    if isinstance(color, colors_.Gradient):
        return [wire.message(pb.Primitive(color_scale=color.to_wire(), **kind))]
    rgb = None if color is None else pb.Color(rgb=colors_.one(color))
    return [wire.message(pb.Primitive(color=rgb, **kind))]


def vec(values: npt.ArrayLike, what: str) -> types_pb2.Vec3:
    x, y, z = vector(values, what)
    return types_pb2.Vec3(x=x, y=y, z=z)


def box(center: npt.ArrayLike, size: npt.ArrayLike, *, color: Optional[Colors] = None, fill: str = "surface",
        rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels") -> list[wire.Packed]:
    """`size` is three edge lengths, or one for all."""
    edges = np.broadcast_to(as_array(size, "size"), (3,)) if np.ndim(size) == 0 else size
    for edge, axis in zip(vector(edges, "size"), "xyz"):
        number(edge, f"the size along {axis}", above=0)
    return solid(color, box=pb.Box(center=vec(center, "center"), size=vec(edges, "size"),
                                    fill=choice(FILLS, fill, "fill"), rule=choice(RULES, rule, "rule"),
        shell=thickness(shell, unit, "shell")))


def sphere(center: npt.ArrayLike, radius: float, *, color: Optional[Colors] = None, fill: str = "surface",
           rule: str = "thin", shell: Optional[float] = None, unit: str = "voxels") -> list[wire.Packed]:
    return solid(color, sphere=pb.Sphere(center=vec(center, "center"), radius=number(radius, "radius", above=0),
                                          fill=choice(FILLS, fill, "fill"), rule=choice(RULES, rule, "rule"),
        shell=thickness(shell, unit, "shell")))


def cylinder(center: npt.ArrayLike, radius: float, height: float, *, color: Optional[Colors] = None,
             fill: str = "surface", rule: str = "thin", shell: Optional[float] = None,
             unit: str = "voxels") -> list[wire.Packed]:
    return solid(color, cylinder=pb.Cylinder(
        center=vec(center, "center"), radius=number(radius, "radius", above=0), height=number(height, "height", above=0),
        fill=choice(FILLS, fill, "fill"), rule=choice(RULES, rule, "rule"),
        shell=thickness(shell, unit, "shell")))


def instance(of: str, *, color: Optional[Colors] = None, tint: Optional[Colors] = None) -> list[wire.Packed]:
    by = None if tint is None else pb.Color(rgb=colors_.one(tint, "tint"))
    return solid(color, instance=pb.Instance(object=of, tint=by))


def volume(array: npt.ArrayLike, *, threshold: Optional[float] = None, cmap: str = "viridis",
           low: Optional[float] = None, high: Optional[float] = None,
           extent: Optional[tuple[npt.ArrayLike, npt.ArrayLike]] = None) -> list[wire.Packed]:
    """Encodes a field of numbers, (nx, ny, nz), or of colours, (nx, ny, nz, 3), as points at the centres of its cells: those
    whose number, or whose brightest channel from 0 to 1, is above `threshold` (default: half-way between least and greatest).
    These are points, not voxels: a field coarser than the display has gaps. `extent`: the field's corners; by default it fills
    [-1, 1] on its longest axis."""
    field = as_array(array, "volume")
    colored = field.ndim == 4 and field.shape[3] in (3, 4)
    if field.ndim != 3 and not colored:
        raise InvalidArray(f"volume must be of shape (nx, ny, nz), or (nx, ny, nz, 3) for colours, got {field.shape}")
    require_finite(field, "volume")
    if field.size == 0:
        return []
    shape = np.array(field.shape[:3])
    values = field
    if colored:
        values = field[..., :3].max(axis=3) / (1.0 if field.dtype.kind == "f" else 255.0)
    least, most = float(values.min()), float(values.max())
    above = (least + most) / 2 if threshold is None else number(threshold, "threshold")
    where = np.argwhere(values > above)
    if extent is None:
        half = shape / shape.max()
        first, last = -half, half
    else:
        first, last = np.array(vector(extent[0], "extent[0]")), np.array(vector(extent[1], "extent[1]"))
        if not (first < last).all():
            raise InvalidArray(f"extent goes from {first.tolist()} to {last.tolist()}; the first must be less on every axis")
    at = (first + (where + 0.5) / shape * (last - first)).astype(np.float32)
    picked = field[tuple(where.T)]
    each = picked if colored else colors_.mapped(picked, cmap, above if low is None else low, most if high is None else high)
    return points(at, colors=each)
