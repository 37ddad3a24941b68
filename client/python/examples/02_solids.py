#!/usr/bin/env python3
"""Boxes, spheres, cylinders and a mesh, hollow and solid, in one commit."""
import numpy as np

import voxeld as voxel

TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
FACES = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]

with voxel.connect(name="solids") as v:
    with v.batch() as frames:  # one commit for all four
        v.box("box", center=(-0.5, -0.5, 0), size=0.6, color="gold")
        v.sphere("ball", center=(0.5, -0.5, 0), radius=0.35, color="crimson", fill="solid")
        v.cylinder("can", center=(-0.5, 0.5, 0), radius=0.3, height=0.7, color="#4af")
        v.mesh("tetrahedron", TETRAHEDRON, FACES, colors=["red", "lime", "blue", "white"],
               transform=voxel.translate(0.5, 0.5, 0) @ voxel.scale(0.35))
    accepted = frames[0].wait(timeout=10).accepted
    assert accepted is not None and accepted.refused_operations == 0
    entities = v.entities()
    for entity in entities:
        print(entity.key.layer, entity.key.id, entity.kind, entity.vertices, "vertices")
    assert {entity.kind for entity in entities} == {"box", "sphere", "cylinder", "mesh"}
