#!/usr/bin/env python3
"""A field of numbers: two orbitals that separate, drawn as points at the centres of cells above a threshold."""
import numpy as np

import voxeld as voxel

SIZE, STEPS = 48, 8
axis = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")

with voxel.connect(name="field") as v:
    field = v.layer("field")
    for step in range(STEPS):
        apart = 0.6 * step / (STEPS - 1)
        density = sum(np.exp(-14 * ((x - side * apart) ** 2 + y ** 2 + z ** 2)) for side in (-1, 1))
        cloud = field.volume("density", density, threshold=0.35, cmap="inferno", low=0.2, high=2.0)
        assert cloud.frame is not None
        cloud.frame.wait_shown(timeout=10)
    (entity,) = v.entities("field")
    print(f"{entity.vertices} of {SIZE ** 3} cells are above the threshold")
    assert 100 < entity.vertices < SIZE ** 3 / 4
