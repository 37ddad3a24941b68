#!/usr/bin/env python3
"""One connection draws, another watches the scene: first the whole scene, then its changes."""
import voxeld as voxel

with voxel.connect(name="painter") as painter, voxel.connect(name="watcher") as watcher:
    ball = painter.layer("shared").sphere("ball", radius=0.3, color="tomato")
    assert ball.frame is not None
    ball.frame.wait(timeout=10)
    seen: list[str] = []
    for changes in watcher.watch_scene("shared", timeout=30):
        print(changes)
        seen += [f"{entity.info.key.id} at {list(entity.info.transform.m)[3::4]}" for entity in changes.entities]
        seen += [f"{key.id} gone" for key in changes.removed_entities]
        if len(seen) == 1:
            ball.transform = voxel.translate(0.5, 0, 0)
        elif not seen[-1].endswith("gone"):
            ball.remove()
        else:
            break
    print(seen)
    assert seen == ["ball at [0.0, 0.0, 0.0]", "ball at [0.5, 0.0, 0.0]", "ball gone"]
