#!/usr/bin/env python3
"""A galaxy that turns: a cloud in immediate mode, frame after frame, and a picture of what the display showed.

usage: 04_point_cloud.py [--points N] [--seconds S] [--picture FILE]
"""
import argparse
import time

import numpy as np
import numpy.typing as npt

import voxeld as voxel


class Galaxy:
    """Stars on the arms of two logarithmic spirals and in a bulge; the inner ones go round faster."""

    def __init__(self, stars: int) -> None:
        random = np.random.default_rng(7)
        bulge = random.random(stars) < 0.25
        self.radius = np.where(bulge, np.abs(random.normal(0, 0.12, stars)), random.uniform(0.12, 0.95, stars))
        arm = np.where(random.random(stars) < 0.5, 0, np.pi)
        spread = random.normal(0, 0.16, stars) / (0.35 + self.radius)
        self.angle = np.where(bulge, random.uniform(0, 2 * np.pi, stars), arm + 3.2 * np.log(self.radius + 0.1) + spread)
        self.height = random.normal(0, 1, stars) * np.where(bulge, 0.07, 0.025)
        heat = np.clip(1 - 1.1 * self.radius + random.normal(0, 0.12, stars), 0, 1)
        cold, warm = np.array([70, 110, 255]), np.array([255, 205, 120])
        self.colors = np.zeros((stars, 4), np.uint8)  # the fourth byte is not looked at
        self.colors[:, :3] = (cold + heat[:, None] * (warm - cold)) * random.uniform(0.4, 1, (stars, 1))

    def at(self, seconds: float) -> npt.NDArray[np.float32]:
        angle = self.angle + 0.35 * seconds / (0.2 + self.radius)
        at: npt.NDArray[np.float32] = np.empty((len(angle), 3), np.float32)
        at[:, 0], at[:, 1], at[:, 2] = self.radius * np.cos(angle), self.radius * np.sin(angle), self.height
        return at


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--points", type=int, default=60_000)
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--picture", default="galaxy.png")
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
        assert volume.lit > 100


if __name__ == "__main__":
    main()
