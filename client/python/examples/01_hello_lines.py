#!/usr/bin/env python3
"""The three axes, and their outcome on each display."""
import voxeld as voxel

with voxel.connect(name="hello") as v:
    v.lines("x", [[-1, 0, 0], [1, 0, 0]], colors="tab:red")
    v.lines("y", [[0, -1, 0], [0, 1, 0]], colors="tab:green")
    v.lines("z", [[0, 0, -1], [0, 0, 1]], colors="tab:blue")
    frame = v.commit()  # comes after all the above
    for outcome in frame.wait_shown(timeout=10).values():
        print(f"{outcome.display}: {outcome.kind}, volume {outcome.volume}")
    assert not v.issues
