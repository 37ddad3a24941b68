#!/usr/bin/env python3
"""So many clients at once, each with a layer of its own, which commit at a rate until a line comes in; then each waits for all that it is
owed, and a line of JSON says what became of everything.
usage: clients.py SERVER COUNT RATE [CERTIFICATE KEY NAME], the certificate being its own and its authority's in one."""
import contextlib
import json
import sys
import threading
import time
from typing import Optional

import numpy as np
import voxeld as voxel

LONG = 60.0
server, count, rate = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
who: Optional[voxel.Credentials] = None
if len(sys.argv) > 4:
    who = voxel.Credentials(ca=sys.argv[4], certificate=sys.argv[4], key=sys.argv[5], server_name=sys.argv[6])
stop = threading.Event()
ends = {"commits": 0, "presented": 0, "unchanged": 0, "superseded": 0, "lost": 0, "not_shown": 0, "refused": 0, "unknown": 0, "missing": 0}
mutex = threading.Lock()


def settle(frames: list[voxel.Frame]) -> None:
    """A commit has ended as it should: refused, lost with its connection, or accepted with an outcome for each display."""
    deadline = time.monotonic() + LONG
    for frame in frames:
        with contextlib.suppress(voxel.VoxelError, TimeoutError):  # what came of it is looked at below
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
        over.release()
        raise


def stream(number: int) -> None:
    places = np.random.default_rng(number).uniform(-1, 1, (20, 3)).astype(np.float32)
    with voxel.connect(server, name=f"client {number}", timeout=LONG, credentials=who) as v:
        layer = v.layer(f"layer {number}")
        frames: list[voxel.Frame] = []
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
        layer.points("cloud", places)  # what is to be seen in the end
        frames.append(v.commit())
        settle(frames)
        with mutex:
            ended.append(number)
        over.release()
        all_ended.wait(LONG)  # until then what it drew stays


ended: list[int] = []
over = threading.Semaphore(0)  # for each client that has all that it is owed, or that failed
all_ended = threading.Event()
threads = [threading.Thread(target=client, args=(n,)) for n in range(count)]
for thread in threads:
    thread.start()
print("ready", flush=True)
sys.stdin.readline()
stop.set()
deadline = time.monotonic() + 2 * LONG
for _ in range(count):
    over.acquire(timeout=max(0.0, deadline - time.monotonic()))
print(json.dumps({**ends, "clients": len(ended)}), flush=True)
sys.stdin.readline()  # until what is shown has been looked at
all_ended.set()
