#!/usr/bin/env python3
"""Feeds the page's benchmark: points all over a rotor that move with every commit. Prints a JSON line for each commit that was shown: when
it was made (ms, Unix time), and in which volume it was shown, when its last byte was sent. usage: feed.py SERVER POINTS RATE SECONDS"""
import json
import sys
import time

import numpy as np

import voxeld as voxel

server, points, rate, seconds = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4])
random = np.random.default_rng(1)
radius, angle = np.sqrt(random.random(points)) * 0.98, random.random(points) * 2 * np.pi
places = np.stack([radius * np.cos(angle), radius * np.sin(angle), (random.random(points) - 0.5) * 0.98], 1).astype(np.float32)
colors = random.integers(60, 255, (points, 3), dtype=np.uint8)
with voxel.connect(server, name="feed") as v:
    began = time.monotonic()
    for step in range(max(1, int(rate * seconds))):
        places[:, 2] = (places[:, 2] + 0.51) % 1.0 - 0.5
        made = time.time() * 1000
        cloud = v.points("cloud", places, colors=colors)
        (outcome,) = cloud.frame.wait_shown(timeout=20).values()
        volume = outcome.volume
        print(json.dumps({"made": made, "volume": volume, "shown": time.time() * 1000}), flush=True)
        left = began + (step + 1) / rate - time.monotonic()
        if left > 0:
            time.sleep(left)  # keeps the requested rate
    if rate * seconds < 1:
        time.sleep(seconds)
