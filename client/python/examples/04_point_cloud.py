#!/usr/bin/env python3
"""A turning galaxy: a cloud in immediate mode, frame after frame, and a picture of what the display showed.

usage: 04_point_cloud.py [--points N] [--seconds S] [--picture FILE]
"""
import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt

import voxeld as voxel


class Galaxy:
    """Stars on the arms of two logarithmic spirals and in a bulge; the inner ones orbit faster."""

    def __init__(self, stars: int) -> None:
        random = np.random.default_rng(7)
        kind = random.random(stars)
        bulge, disc = kind < 0.12, kind > 0.75
        self.radius = np.where(bulge, np.abs(random.normal(0, 0.09, stars)), 0.1 + 0.87 * random.random(stars) ** 0.8)
        arm = np.where(random.random(stars) < 0.5, 0, np.pi)
        spread = random.normal(0, 0.09, stars) / (0.25 + self.radius)
        free = random.uniform(0, 2 * np.pi, stars)
        self.angle = np.where(bulge | disc, free, arm + 3.6 * np.log(self.radius + 0.08) + spread)
        self.height = random.normal(0, 1, stars) * np.where(bulge, 0.06, 0.02)
        heat = np.clip(1.15 - 1.5 * self.radius + random.normal(0, 0.15, stars), 0, 1)
        cold, warm = np.array([40, 90, 255]), np.array([255, 170, 60])
        self.colors = np.zeros((stars, 4), np.uint8)  # the fourth byte is not looked at
        bright = np.where(disc, 0.25, 1.0) * random.uniform(0.15, 1, stars) ** 2
        self.colors[:, :3] = (cold + heat[:, None] * (warm - cold)) * bright[:, None]

    def at(self, seconds: float) -> npt.NDArray[np.float32]:
        angle = self.angle + 0.15 * seconds / (0.3 + self.radius)
        at: npt.NDArray[np.float32] = np.empty((len(angle), 3), np.float32)
        at[:, 0], at[:, 1], at[:, 2] = self.radius * np.cos(angle), self.radius * np.sin(angle), self.height
        return at


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--points", type=int, default=60_000)
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--picture", default=str(Path(tempfile.gettempdir(), "galaxy.png")))
    options = parser.parse_args()

    galaxy = Galaxy(options.points)
    tilt = voxel.rotate("x", 20)
    with voxel.connect(name="galaxy", flow="latest") as v:
        begin, frame = time.monotonic(), None
        while frame is None or time.monotonic() - begin < options.seconds:
            with v.frame("galaxy") as frame:
                frame.points("stars", galaxy.at(time.monotonic() - begin), colors=galaxy.colors, transform=tilt)
            frame.wait_shown(timeout=10)
        accepted = frame.accepted
        assert accepted is not None
        volume = v.capture(at_least_snapshot=accepted.snapshot)
        volume.save_png(options.picture, width=720, height=560, azimuth=25, elevation=28)
        stages = ", ".join(f"{stage} {ms:.2f} ms" for stage, ms in frame.ticket.latency_ms().items())
        print(f"{v.counts['accepted']} frames; {volume}; {options.picture}")
        print(f"the last frame: {stages or 'the server tells no stages'}")
        assert volume.lit > 0, "the display shows nothing of it"


if __name__ == "__main__":
    main()
