"""Renders points of light, and writes PNG files; needs only NumPy and zlib."""
from __future__ import annotations

import struct
import zlib

import numpy as np
import numpy.typing as npt

Bytes = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float64]

BACKGROUND, EDGE, KNEE = 6, 70, 150.0
_EDGES = [(0, 1), (0, 2), (0, 4), (1, 3), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 6), (5, 7), (6, 7)]


def axes(azimuth: float, elevation: float) -> tuple[Floats, Floats, Floats]:
    """Returns the right, up and away vectors of an eye that looks at the middle; angles in degrees, 0, 0 is from −y with z up."""
    a, e = np.radians(azimuth), np.radians(elevation)
    right = np.array([np.cos(a), np.sin(a), 0])
    away = np.array([-np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), -np.sin(e)])
    return right, np.cross(right, away), away


def splat(at: Floats, colors: Bytes, corners: Floats, pitch: float, width: int, height: int, azimuth: float,
          elevation: float) -> Bytes:
    """Renders points as discs of the size of their pitch, without perspective. A point is added with half its light for every
    point in front of it on the same spot; so the image keeps the glow of a volume and its front stands out. Distant points are
    dimmer."""
    right, up, away = axes(azimuth, elevation)
    middle = corners.mean(axis=0)
    flat = np.stack([(corners - middle) @ right, (corners - middle) @ up], axis=1)
    span = np.maximum(flat.max(axis=0) - flat.min(axis=0), 1e-9)
    scale = float(min(width * 0.94 / span[0], height * 0.94 / span[1]))

    def project(points: Floats) -> tuple[Floats, Floats]:
        centred = points - middle
        return width / 2 + scale * (centred @ right), height / 2 - scale * (centred @ up)

    picture = np.full((height * width, 3), float(BACKGROUND))
    for first, second in _EDGES:
        steps = np.linspace(0, 1, 2 * max(width, height))[:, None]
        x, y = project(corners[first] * (1 - steps) + corners[second] * steps)
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        picture[y[inside].astype(int) * width + x[inside].astype(int)] = EDGE
    if len(at):
        x, y = project(at)
        order = np.argsort((at - middle) @ away)  # the nearest first
        depth = ((at - middle) @ away)[order]
        dim = 1 - 0.5 * (depth - depth[0]) / max(float(np.ptp((corners - middle) @ away)), 1e-9)
        x, y, light = x[order], y[order], colors[order] * np.clip(dim, 0, 1)[:, None]
        radius = max(scale * pitch / 2, 0.5)
        reach = int(np.ceil(radius - 0.5))
        left = np.ones(height * width)  # what passes to those behind
        glow = np.zeros((height * width, 3))
        for dy in range(-reach, reach + 1):
            for dx in range(-reach, reach + 1):
                if dx * dx + dy * dy > radius * radius + 0.5:
                    continue
                _add(glow, left, np.floor(x).astype(int) + dx, np.floor(y).astype(int) + dy, light, width, height)
        # Where much light accumulates, compress its strength below 255 and keep its hue.
        peak = np.maximum(glow.max(axis=1), 1e-9)
        pressed = np.where(peak > KNEE, KNEE + (255 - KNEE) * (1 - np.exp((KNEE - peak) / (255 - KNEE))), peak)
        picture = np.maximum(picture, glow * (pressed / peak)[:, None])
    result: Bytes = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    return result.reshape(height, width, 3)


def _add(glow: Floats, left: Floats, x: npt.NDArray[np.int_], y: npt.NDArray[np.int_], light: Floats, width: int,
         height: int) -> None:
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    spot, light = y[inside] * width + x[inside], light[inside]
    if not len(spot):
        return
    # On one spot, the nth point from the front is weighted by 2⁻ⁿ.
    order = np.argsort(spot, kind="stable")
    spot, light = spot[order], light[order]
    first = np.r_[True, spot[1:] != spot[:-1]]
    start = np.flatnonzero(first)
    rank = np.arange(len(spot)) - np.repeat(start, np.diff(np.r_[start, len(spot)]))
    weight = left[spot] * 0.5 ** np.minimum(rank, 60)
    for channel in range(3):
        glow[:, channel] += np.bincount(spot, weight * light[:, channel], len(glow))
    left[spot[start]] *= 0.5


def png(rgb: Bytes) -> bytes:
    """Encodes a (height, width, 3) image as a PNG file."""
    height, width = rgb.shape[:2]

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = np.zeros((height, 1 + 3 * width), np.uint8)  # each after its filter: none
    rows[:, 1:] = rgb.reshape(height, 3 * width)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(rows.tobytes(), 6)) + chunk(b"IEND", b""))
