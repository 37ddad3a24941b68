#!/usr/bin/env python3
"""A long day in a short time: the real voxeld with three displays, state and http, and clients of every kind that connect, draw, make errors and leave. Its
resident memory, its accounted memory, descriptors, threads and latencies are measured throughout, and lines are fitted to them.

usage: soak.py [--minutes M] [--warm-up M] [--roles NAME,…] [--environment NAME=VALUE]… [--csv FILE] [--svg FILE] [--json]      Paths are in
VOXELD and PYTHONPATH (the client and tests/e2e).

Exits with 1 if a commit has not received all its outcomes, or if something grows: the 95 % confidence interval of its slope (by medians of
elevenths of the samples after warming up) lies above zero by more than GROWTH allows in an hour."""
import argparse
import contextlib
import csv
import json
import multiprocessing as mp
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from multiprocessing.connection import Connection as Pipe
from pathlib import Path
from typing import Any, Callable

import numpy as np
import voxeld as voxel

from polling import until
from programs import ENDS_WITH_US, program

EVERY = 2.0  # seconds between samples
LONG = 60.0
PARTS = 11
WARM_UP = 10
LEAST = 10  # minutes beyond warming up; a shorter run reports its slopes, but only the receipts are judged
# The part of its level by which a quantity may grow in an hour; for integers, the number.
GROWTH = {"resident_mb": 0.02, "anonymous_mb": 0.02, "held_mb": 0.02, "descriptors": 0.5, "threads": 0.5, "p50_ms": 0.5, "p99_ms": 0.5}
WHOLE = ("descriptors", "threads")
DISPLAYS = 3

Stop = Any  # multiprocessing's Event is a function, not a type


class Tally:
    """Counts commits by outcome. Every outcome has to arrive."""

    def __init__(self) -> None:
        self.open: list[voxel.Frame] = []
        self.ends = {"commits": 0, "refused": 0, "dropped": 0, "presented": 0, "unchanged": 0, "superseded": 0, "lost": 0, "not_shown": 0, "missing": 0}

    def add(self, frame: voxel.Frame) -> None:
        self.open.append(frame)
        if len(self.open) > 256:
            self.settle(0)

    def settle(self, patience: float) -> None:
        left = []
        deadline = time.monotonic() + patience
        for frame in self.open:
            if patience:
                with contextlib.suppress(voxel.VoxelError, TimeoutError):  # the result is checked below
                    frame.wait_shown(timeout=max(0.0, deadline - time.monotonic()))
            if not frame.complete:
                left.append(frame)
                continue
            self.ends["commits"] += 1
            if frame.state in ("refused", "dropped"):
                self.ends[frame.state] += 1
            elif frame.state != "accepted" or frame.accepted is None or set(frame.outcomes) != set(frame.accepted.displays):
                self.ends["missing"] += 1
            for outcome in frame.outcomes.values():
                self.ends[outcome.kind if outcome.kind in self.ends else "missing"] += 1
        self.open = left
        if patience:
            self.ends["missing"] += len(left)


def steady(server: str, stop: Stop, tally: Tally, rng: np.random.Generator) -> None:
    """Retained entities that move, 30 commits a second, each waited for."""
    with voxel.connect(server, name="steady", timeout=LONG) as v:
        ball = v.sphere("ball", radius=0.3, color="orange", fill="solid")
        cloud = rng.uniform(-1, 1, (2000, 3)).astype(np.float32)
        turn = 0
        while not stop.is_set():
            turn += 1
            ball.transform = voxel.translate(0.5 * np.cos(turn / 20), 0.5 * np.sin(turn / 20), 0)
            if turn % 10 == 0:
                v.points("cloud", cloud * (1 - turn % 100 / 200))
            frame = v.commit()
            tally.add(frame)
            frame.wait_shown(timeout=LONG)
            stop.wait(1 / 30)
        tally.settle(LONG)


def immediate(server: str, stop: Stop, tally: Tally, rng: np.random.Generator) -> None:
    """Draw batches, faster than any display."""
    with voxel.connect(server, name="immediate", flow="latest", timeout=LONG) as v:
        while not stop.is_set():
            with v.frame("wave") as frame:
                frame.lines("lines", rng.uniform(-1, 1, (40, 2, 3)).astype(np.float32))
            tally.add(frame.ticket)
            stop.wait(0.01)
        tally.settle(LONG)


def passing(server: str, stop: Stop, tally: Tally, rng: np.random.Generator) -> None:
    """Connects, draws, and leaves, in every way."""
    ways: list[Any] = ["clear", 0.2, "keep"]
    owner = b""  # the owner of what is persistent: otherwise each client would leave an owner behind, as it should
    turn = 0
    while not stop.is_set():
        turn += 1
        with voxel.connect(server, name="passing", on_disconnect=ways[turn % 3], owner_token=owner if turn % 3 == 2 else b"", timeout=LONG) as v:
            owner = v.owner_token if turn % 3 == 2 else owner
            layer = v.layer("passing", opacity=0.5, order=turn % 5)
            layer.box("box", size=rng.uniform(0.1, 1, 3), color="green")
            layer.text("word", f"n{turn}", height=0.3, color="white")
            frame = v.commit(durable=turn % 3 == 2)
            tally.add(frame)
            frame.wait_shown(timeout=LONG)
            if turn % 3 == 2:
                frame.wait_durable(LONG)
            tally.settle(LONG)
        stop.wait(0.1)


def erring(server: str, stop: Stop, tally: Tally, rng: np.random.Generator) -> None:
    """Sends commits that cause issues, queries, and large uploads."""
    with voxel.connect(server, name="erring", on_issue=lambda issue: None, timeout=LONG) as v:
        turn = 0
        while not stop.is_set():
            turn += 1
            v.layer("err").instance("none", "no such object")
            tally.add(v.commit())
            if turn % 5 == 0:
                v.upload(rng.bytes(300_000))
            v.capture(["stack", "rotor", "lattice"][turn % 3], timeout=LONG)
            v.stats(timeout=LONG)
            v.entities()
            stop.wait(0.25)
        tally.settle(LONG)


ROLES: dict[str, Callable[[str, Stop, Tally, np.random.Generator], None]] = {"steady": steady, "immediate": immediate, "passing": passing, "erring": erring}


def role(name: str, server: str, stop: Stop, answer: Pipe) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tally = Tally()
    why = ""
    try:
        ROLES[name](server, stop, tally, np.random.default_rng(len(name)))
    except BaseException as error:  # any exception is the result
        why = f"{type(error).__name__}: {error}"
    answer.send((tally.ends, why))


def sample(pid: int, port: int) -> dict[str, float]:
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    # Resident memory includes mapped files: pages of programs, which are loaded at first use, and are bounded by the size of the files.
    number = {key: int(value) for key, value in re.findall(r"^(VmRSS|RssAnon|Threads):\s+(\d+)", status, re.M)}
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=LONG) as answer:
        held = re.search(r"^voxeld_process_heap_bytes (\S+)", answer.read().decode(), re.M)
    assert held is not None, "nothing tells what is held"
    return {"resident_mb": number["VmRSS"] / 1024, "anonymous_mb": number["RssAnon"] / 1024, "held_mb": float(held[1]) / 2**20, "descriptors": len(os.listdir(f"/proc/{pid}/fd")), "threads": number["Threads"]}


def line_through(times: np.ndarray[Any, Any], values: np.ndarray[Any, Any]) -> tuple[float, float]:
    """Returns the slope in an hour and half of its 95 % interval, of the medians of the parts."""
    parts = [part for part in np.array_split(np.arange(len(times)), PARTS) if len(part)]
    x = np.array([np.median(times[part]) for part in parts]) / 3600
    y = np.array([np.median(values[part]) for part in parts])
    n = len(x)
    if n < 4:
        return 0.0, float("inf")
    slope, level = np.polyfit(x, y, 1)
    rest = y - (slope * x + level)
    error = np.sqrt((rest**2).sum() / (n - 2) / ((x - x.mean()) ** 2).sum())
    t = {9: 2.262, 8: 2.306, 7: 2.365, 6: 2.447, 5: 2.571, 4: 2.776, 3: 3.182, 2: 4.303}[min(9, n - 2)]
    return float(slope), float(t * error)


def draw(path: str, rows: list[dict[str, float]]) -> None:
    import matplotlib  # type: ignore[import]  # python3-matplotlib; for the picture alone

    matplotlib.use("svg")
    import matplotlib.pyplot as plt  # type: ignore[import]

    figure, axes = plt.subplots(len(GROWTH), 1, sharex=True, figsize=(8, 8))
    for axis, key in zip(axes, GROWTH):
        axis.plot([row["minutes"] for row in rows], [row[key] for row in rows], linewidth=0.8)
        axis.set_ylabel(key.replace("_", " "))
        axis.set_ylim(bottom=0)
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("minutes")
    figure.tight_layout()
    figure.savefig(path)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=45, help="how long (default: %(default)s)")
    parser.add_argument("--warm-up", type=float, default=None, help=f"minutes from its start of which slopes know nothing (default: {WARM_UP}, or a third of a short run)")
    parser.add_argument("--roles", default=",".join(ROLES), help="which clients there are (default: %(default)s)")
    parser.add_argument("--environment", action="append", default=[], metavar="NAME=VALUE", help="for the daemon; may be repeated. To compare allocators: "
                        "GLIBC_TUNABLES=glibc.malloc.tcache_count=0, or LD_PRELOAD=LIBRARY")
    parser.add_argument("--csv", help="a file for each measurement, a line each")
    parser.add_argument("--svg", help="a file for a picture of them")
    parser.add_argument("--json", action="store_true", help="what came of it as JSON, on standard output")
    options = parser.parse_args()
    warm_up = options.warm_up if options.warm_up is not None else min(WARM_UP, options.minutes / 3)
    judged = options.minutes - warm_up >= LEAST
    voxeld = program("VOXELD", "the daemon")
    with tempfile.TemporaryDirectory(prefix="voxeld-soak-") as folder:
        server = f"unix:{folder}/s"
        log = open(f"{folder}/log", "w+", encoding="utf-8")
        # Assets and dormant sessions reach these limits after a minute or two, so that what is kept stays constant, and eviction happens
        # all the time.
        Path(f"{folder}/voxeld.toml").write_text("[limits]\nmax_assets = 64\nmax_sessions = 64\n", encoding="utf-8")
        daemon = subprocess.Popen(
            [*ENDS_WITH_US, voxeld, "--config", f"{folder}/voxeld.toml", "--listen", server, "--http", "127.0.0.1:0", "--state-dir", f"{folder}/state", "--log-level", "info", "--engine", "cpu",
             "--display", "stack=simulated,size=24x24x16,rate=60", "--display", "rotor=simulated,geometry=rotor,size=24x16,slices=60,rate=30",
             "--display", "lattice=simulated,profile=" + str(Path(__file__).parents[2] / "display/profiles/lattice-8.toml")],
            stdout=log, stderr=subprocess.STDOUT, env=dict(os.environ, **dict(each.split("=", 1) for each in options.environment)))

        def listens() -> int:
            said = Path(f"{folder}/log").read_text(encoding="utf-8")
            assert daemon.poll() is None, f"voxeld does not start: {said}"
            match = re.search(r"http://127\.0\.0\.1:(\d+)/", said)
            return int(match[1]) if match else 0

        port = until(listens, "voxeld's page")
        stop = mp.Event()
        clients = []
        for name in options.roles.split(","):
            here, there = mp.Pipe()
            process = mp.Process(target=role, args=(name, server, stop, there))
            process.start()
            clients.append((name, process, here))
        rows: list[dict[str, float]] = []
        began = time.monotonic()
        told = began
        with voxel.connect(server, name="soak", timeout=LONG) as v:
            while (now := time.monotonic()) - began < options.minutes * 60 and daemon.poll() is None and all(p.is_alive() for _, p, _ in clients):
                stats = v.stats(timeout=LONG)
                shown = stats.displays[0].commit_to_presented
                rows.append({"minutes": (now - began) / 60, **sample(daemon.pid, port), "p50_ms": shown.p50_ns / 1e6, "p99_ms": shown.p99_ns / 1e6})
                if now - told > 60 and not options.json:
                    told = now
                    print(" ".join(f"{key} {value:.1f}" for key, value in rows[-1].items()), file=sys.stderr, flush=True)
                stop.wait(max(0.0, EVERY - (time.monotonic() - now)))
            stop.set()
            answers = {name: (pipe.recv() if pipe.poll(3 * LONG) else ({}, "no answer")) for name, _, pipe in clients}
            for _, process, _ in clients:
                process.join(LONG)
            last = v.stats(timeout=LONG)
        daemon.terminate()
        status = daemon.wait(LONG)
        wrong = [f"{name} ended: {why}" for name, (_, why) in answers.items() if why]
        if status != 0:
            wrong.append(f"voxeld ended with {status}: {Path(f'{folder}/log').read_text(encoding='utf-8')[-2000:]}")
        sums: dict[str, int] = {}
        for ends, _ in answers.values():
            for key, count in ends.items():
                sums[key] = sums.get(key, 0) + count
        if sums.get("missing", 1) or not sums.get("commits"):
            wrong.append(f"receipts are missing: {sums}")
        if any(display.commits_pending for display in last.displays):
            wrong.append("commits are pending still")
        slopes = {}
        warm = [row for row in rows if row["minutes"] >= warm_up]
        times = np.array([row["minutes"] * 60 for row in warm])
        for key, part in GROWTH.items():
            values = np.array([row[key] for row in warm])
            slope, half = line_through(times, values)
            level = float(np.median(values))
            slopes[key] = {"median": level, "least": float(values.min()), "most": float(values.max()), "an_hour": slope, "half_interval": half}
            if not judged:
                continue
            if slope - half > (part if key in WHOLE else part * level):
                wrong.append(f"{key} grows by {slope:.3f} an hour (± {half:.3f}) from {level:.1f}")
    if options.csv:
        with open(options.csv, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0].keys())
            writer.writeheader()
            writer.writerows(rows)
    if options.json:
        print(json.dumps({"minutes": rows[-1]["minutes"], "receipts": sums, "slopes": slopes, "wrong": wrong}))
    else:
        print(f"{rows[-1]['minutes']:.1f} minutes, {len(rows)} samples; " + ", ".join(f"{count} {key}" for key, count in sums.items()))
        for key, each in slopes.items():
            print(f"{key}: median {each['median']:.2f} ({each['least']:.2f} to {each['most']:.2f}), {each['an_hour']:+.3f} an hour (± {each['half_interval']:.3f})")
        print("\n".join(f"WRONG: {each}" for each in wrong) or ("nothing grows, nothing is owed" if judged else "nothing is owed"))
    if options.svg:
        draw(options.svg, rows)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
