#!/usr/bin/env python3
"""Runs a number of clients at once, each with a layer of its own. They commit at a fixed rate until a line arrives on standard input; then
each waits
for all outstanding outcomes, and one line of JSON reports the results. For fault_matrix_test and manual use: two lines on standard input
end it.
PYTHONPATH has the client."""
import argparse
import contextlib
import json
import sys
import threading
import time
from typing import Optional

import numpy as np
import voxeld as voxel

LONG = 60.0
parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("server", help="its address, as unix:/run/voxeld.sock")
parser.add_argument("count", type=int, help="how many clients")
parser.add_argument("rate", type=float, help="commits a second, of each")
parser.add_argument("certificate", nargs="?", help="for TLS: a file that is theirs and their authority's in one")
parser.add_argument("key", nargs="?", help="its key")
parser.add_argument("name", nargs="?", help="by which the server goes in its certificate")
options = parser.parse_args()
server, count, rate = options.server, options.count, options.rate
if count < 1 or rate <= 0:
    parser.error(f"count is {count} and rate {rate:g}; there is at least one client, and it commits")
who: Optional[voxel.Credentials] = None
if options.certificate is not None:
    if options.name is None:
        parser.error("a certificate comes with its key and the server's name")
    who = voxel.Credentials(ca=options.certificate, certificate=options.certificate, key=options.key, server_name=options.name)
stop = threading.Event()
ends = {"commits": 0, "presented": 0, "unchanged": 0, "superseded": 0, "lost": 0, "not_shown": 0, "refused": 0, "unknown": 0, "missing": 0}
mutex = threading.Lock()


def settle(frames: list[voxel.Frame]) -> None:
    """Checks that a commit has ended properly: refused, lost with its connection, or accepted with an outcome for each display."""
    deadline = time.monotonic() + LONG
    for frame in frames:
        with contextlib.suppress(voxel.VoxelError, TimeoutError):  # the result is checked below
            frame.wait_shown(timeout=max(0.0, deadline - time.monotonic()))
        with mutex:
            ends["commits"] += 1
            if frame.state == "refused":
                ends["refused"] += 1
            elif frame.state in ("lost", "unknown", "dropped"):
                ends["unknown"] += 1
            elif not frame.complete or frame.accepted is None or set(frame.outcomes) != set(frame.accepted.displays):
                ends["missing"] += 1
            for outcome in frame.outcomes.values():
                ends["unknown" if outcome.kind == "untold" else outcome.kind] += 1


def client(number: int) -> None:
    try:
        stream(number)
    except BaseException:
        begun.release()
        over.release()
        raise


def stream(number: int) -> None:
    places = np.random.default_rng(number).uniform(-1, 1, (20, 3)).astype(np.float32)
    with voxel.connect(server, name=f"client {number}", timeout=LONG, credentials=who) as v:
        layer = v.layer(f"layer {number}")
        layer.points("cloud", places)
        frames: list[voxel.Frame] = [v.commit().wait(LONG)]
        begun.release()
        turn = 0
        while not stop.is_set():
            turn += 1
            layer.points("cloud", np.roll(places, turn % 20, 0) * (1 - turn % 7 / 10))
            try:
                frames.append(v.commit())
            except voxel.BufferFull:
                pass
            if len(frames) > 400:
                settle(frames[:200])
                del frames[:200]
            stop.wait(1 / rate)
        layer.points("cloud", places)  # what must be visible in the end
        frames.append(v.commit())
        settle(frames)
        with mutex:
            ended.append(number)
        over.release()
        all_ended.wait(LONG)  # until then, what it drew stays visible


ended: list[int] = []
begun = threading.Semaphore(0)  # released by each client of which a commit was accepted, or that failed
over = threading.Semaphore(0)  # released by each client that has received every outcome, or that failed
all_ended = threading.Event()
threads = [threading.Thread(target=client, args=(n,)) for n in range(count)]
for thread in threads:
    thread.start()
for _ in range(count):
    begun.acquire(timeout=2 * LONG)
print("ready", flush=True)
sys.stdin.readline()
stop.set()
deadline = time.monotonic() + 2 * LONG
for _ in range(count):
    over.acquire(timeout=max(0.0, deadline - time.monotonic()))
print(json.dumps({**ends, "clients": len(ended)}), flush=True)
sys.stdin.readline()  # until the caller has looked at the displays
all_ended.set()
