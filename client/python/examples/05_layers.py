#!/usr/bin/env python3
"""Layers over one another: order, opacity, additive blending, erasing, hiding."""
import voxeld as voxel

with voxel.connect(name="layers") as v:
    base = v.layer("base", order=0)
    glow = v.layer("glow", order=1, blend="add", opacity=0.5)
    cut = v.layer("cut", order=2, blend="erase")
    base.box("block", size=1.2, color="tab:blue", fill="solid")
    glow.sphere("halo", radius=0.8, color="orange", fill="solid")
    cut.cylinder("hole", radius=0.3, height=4, fill="solid")
    whole = v.commit().wait(timeout=10)
    assert whole.accepted is not None
    lit = v.capture(at_least_snapshot=whole.accepted.snapshot).lit

    cut.set(visible=False)
    filled = v.commit().wait(timeout=10)
    assert filled.accepted is not None
    more = v.capture(at_least_snapshot=filled.accepted.snapshot).lit
    print(f"{lit} lit pixels with the hole, {more} without")
    for layer in v.layers():
        print(f"  {layer.layer}: order {layer.order}, opacity {layer.opacity}, {layer.entities} entities")
    assert more > lit > 0 and not v.issues
