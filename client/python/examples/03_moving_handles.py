#!/usr/bin/env python3
"""A large mesh is sent once; after that each step sends only its transform, 12 numbers."""
import argparse
import time

import numpy as np

import voxeld as voxel

parser = argparse.ArgumentParser()
parser.add_argument("--seconds", type=float, default=2.0)
options = parser.parse_args()


def torus(around: int = 120, across: int = 48) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[type-arg]
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, around, endpoint=False), np.linspace(0, 2 * np.pi, across, endpoint=False))
    ring = 0.65 + 0.25 * np.cos(v)
    at = np.stack([ring * np.cos(u), ring * np.sin(u), 0.25 * np.sin(v)], axis=-1).reshape(-1, 3).astype(np.float32)
    i = np.arange(around * across).reshape(across, around)
    right, up, both = np.roll(i, -1, 1), np.roll(i, -1, 0), np.roll(np.roll(i, -1, 0), -1, 1)
    return at, np.concatenate([np.stack([i, right, both], -1), np.stack([i, both, up], -1)]).reshape(-1, 3)


with voxel.connect(name="moving handles") as v:
    vertices, faces = torus()
    ring = v.mesh("torus", vertices, faces, colors=vertices[:, 2], cmap="viridis")
    begin = time.monotonic()
    while (angle := 60 * (time.monotonic() - begin)) < 60 * options.seconds:
        ring.transform = voxel.rotate("x", angle) @ voxel.rotate("z", 2 * angle)
        assert ring.frame is not None
        ring.frame.wait_shown(timeout=10)  # in step with the display; leave it out to send as fast as may be
    counts = v.counts
    print({kind: counts[kind] for kind in ("accepted", "presented", "unchanged", "superseded")})
    ring.remove()
    assert counts["presented"] > 5 and not v.issues
