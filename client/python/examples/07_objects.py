#!/usr/bin/env python3
"""An object is defined once and drawn by instances; defining it again changes them all."""
import numpy as np

import voxeld as voxel

with voxel.connect(name="objects") as v:
    with v.object("molecule") as water:
        water.sphere("oxygen", radius=0.12, color="red")
        for side in (-1, 1):
            water.sphere("hydrogen", radius=0.08, color="white", transform=voxel.translate(0.13 * side, 0, 0.1))
    random = np.random.default_rng(3)
    with v.batch() as frames:
        for number in range(30):
            turn = voxel.rotate(random.normal(size=3), random.uniform(0, 360))
            v.instance(f"water/{number}", "molecule", transform=voxel.translate(*random.uniform(-0.8, 0.8, 3)) @ turn)
    frames[0].wait_shown(timeout=10)

    with v.object("molecule") as frozen:
        frozen.box("crystal", size=0.2, color="lightblue")
    outcomes = v.commit().wait_shown(timeout=10)
    print({name: outcome.kind for name, outcome in outcomes.items()}, len(v.entities()), "instances")
    v.remove_object("molecule", cascade=True)
    v.commit().wait(timeout=10)
    assert not v.entities() and not v.issues
