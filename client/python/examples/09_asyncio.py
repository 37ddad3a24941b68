#!/usr/bin/env python3
"""Two tasks draw over one connection, each into its own layer and at its own pace."""
import asyncio

import numpy as np

import voxeld as voxel
from voxeld.aio import Connection, connect, shown


async def wave(v: Connection, frames: int) -> int:
    axis = np.linspace(-0.9, 0.9, 60)
    x, y = (a.ravel() for a in np.meshgrid(axis, axis))
    for number in range(frames):
        z = 0.3 * np.sin(6 * np.hypot(x, y) - 0.4 * number)
        with v.frame("wave") as frame:
            frame.points("surface", np.stack([x, y, z], axis=1), colors=z, cmap="coolwarm")
        await shown(frame, timeout=10)
    return frames


async def moon(v: Connection, steps: int) -> int:
    ball = v.layer("moon").sphere("moon", radius=0.12, color="lightyellow", fill="solid")
    for number in range(steps):
        ball.transform = voxel.rotate("z", 12.0 * number) @ voxel.translate(0.7, 0, 0.6)
        assert ball.frame is not None
        await shown(ball.frame, timeout=10)
    return steps


async def main() -> None:
    async with await connect(name="asyncio", flow="latest") as v:
        done = await asyncio.gather(wave(v, 20), moon(v, 20))
        print(done, {kind: v.counts[kind] for kind in ("accepted", "presented", "superseded", "unchanged")})
        assert v.counts["accepted"] >= sum(done) and not v.issues


asyncio.run(main())
