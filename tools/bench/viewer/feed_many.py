#!/usr/bin/env python3
"""Feeds the page's memory benchmark: clouds of varying sizes, one commit each, as fast as they are accepted. For every input line it
commits `each` of them, waits until the last is shown, and prints the total so far. usage: feed_many.py SERVER COMMITS EACH"""
import sys

import numpy as np

import voxeld as voxel

server, commits, each = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
random = np.random.default_rng(1)
most = 6000
places = (random.random((most, 3)) * 2 - 1).astype(np.float32)
made = 0
with voxel.connect(server, name="feed") as v:
    for _ in sys.stdin:
        for _ in range(min(each, commits - made)):
            count = int(random.integers(1, most))
            cloud = v.points("cloud", places[:count])
            made += 1
        cloud.frame.wait_shown(timeout=60)
        print(made, flush=True)
