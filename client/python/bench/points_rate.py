#!/usr/bin/env python3
"""Measures how many point clouds (16 bytes per point: float32 × 3 and RGBX) are sent in a second, and the CPU time that each costs.
Prints JSON; exits with 1 if some were not accepted, or one cost more than --most-cpu-ms.

usage: points_rate.py [--server ADDRESS] [--points N] [--frames N] [--flow POLICY] [--most-cpu-ms T]
Run the daemon without a display, or the figure includes the display's rate; by default it has one:
    echo 'display = []' >none.toml; voxeld --config none.toml --listen unix:/tmp/v.sock --http off
"""
from __future__ import annotations

import argparse
import json
import resource
import sys
import time

import numpy as np

import voxeld as voxel


def main() -> int:
    parser = argparse.ArgumentParser(description="frames of points a second")
    parser.add_argument("--server", help="HOST:PORT or unix:PATH (default: as voxelctl)")
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--frames", type=int, default=90)
    parser.add_argument("--warm-up", type=int, default=10, help="frames before the clock starts")
    parser.add_argument("--flow", default="reliable", choices=["reliable", "latest", "drop_oldest"])
    parser.add_argument("--ahead", type=int, default=3, help="frames drawn before the first of them is accepted")
    parser.add_argument("--most-cpu-ms", type=float, help="of processor time that a frame may take this process")
    options = parser.parse_args()

    random = np.random.default_rng(1)
    clouds = [random.uniform(-1, 1, (options.points, 3)).astype(np.float32) for _ in range(2)]
    colors = random.integers(0, 256, (options.points, 4), dtype=np.uint8)
    with voxel.connect(options.server, name="points_rate", outcomes=False, flow=options.flow) as v:
        tickets: list[voxel.Frame] = []
        began, used, draw_s = 0.0, resource.getrusage(resource.RUSAGE_SELF), 0.0
        for number in range(options.warm_up + options.frames):
            if number == options.warm_up:
                for ticket in tickets:
                    ticket.wait(60)
                tickets, draw_s = [], 0.0
                began, used = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF)
            start = time.perf_counter()
            with v.frame("cloud") as frame:
                frame.points("points", clouds[number % 2], colors=colors)
            draw_s += time.perf_counter() - start
            tickets.append(frame.ticket)
            if options.flow == "reliable" and len(tickets) > options.ahead:
                tickets[-1 - options.ahead].wait(60)
        for ticket in tickets:
            if ticket.state != "dropped":
                ticket.future().result(60)
        seconds = time.perf_counter() - began
        now = resource.getrusage(resource.RUSAGE_SELF)
        cpu_s = now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime
        arrived = sum(ticket.state == "accepted" for ticket in tickets)
        print(json.dumps({
            "points": options.points, "frames": options.frames, "accepted": arrived, "flow": options.flow,
            "seconds": round(seconds, 3), "frames_per_second": round(arrived / seconds, 2),
            "megabytes_per_second": round(arrived * options.points * 16 / seconds / 1e6, 1),
            "draw_ms": round(1000 * draw_s / options.frames, 2),
            "client_cores": round(cpu_s / seconds, 2), "client_cpu_ms": round(1000 * cpu_s / options.frames, 2),
            "counts": v.counts}))
    faults = []
    if options.flow == "reliable" and arrived != options.frames:
        faults.append(f"{options.frames - arrived} of {options.frames} frames were not accepted")
    if options.most_cpu_ms is not None and 1000 * cpu_s / options.frames > options.most_cpu_ms:
        faults.append(f"a frame took {1000 * cpu_s / options.frames:.2f} ms of processor time, more than {options.most_cpu_ms}")
    print("; ".join(faults), file=sys.stderr, end="\n" if faults else "")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
