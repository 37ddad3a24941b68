#!/usr/bin/env python3
"""Measures what hostile clients cost others: the time to be served beside silent connections, and memory.

usage: attacks.py [--repetitions N] [--limit BYTES] [--json] [ports | instances | owners | entities | shapes | curves] ...

  ports      /healthz beside 1,000 silent connections to its port; a new gRPC client beside 300 to its; the same while such
             connections are opened all the time
  instances  one instance that expands to a million parts, then to as many as are admitted; resident memory at its peak and after
             the owner has left
  owners     instances of 1,000 parts from three owners at once, each until one is refused; resident memory as above
  entities   points as entities of their own until one is refused; the same
  shapes     3,000 spheres that fill the display, in one commit; resident memory as above
  curves     12,000 curves across the display, in one commit; resident memory as above

Paths are in VOXELD and PYTHONPATH (the client and tests/e2e). Times are of one machine: compare runs, not numbers."""
import argparse
import json
import re
import resource
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from pathlib import Path
from types import TracebackType
from typing import Callable

import numpy as np
import voxeld as voxel
from polling import until
from programs import program

PATIENCE = 60.0
LEFT_FOR = 10.0  # seconds that a daemon has to release what an owner held


class Daemon:
    def __init__(self, limit: int) -> None:
        self.folder = tempfile.TemporaryDirectory(prefix="voxeld-attacks-")
        config = Path(self.folder.name, "voxeld.toml")
        config.write_text("".join(f"{line}\n" for line in (
            "[limits]", f"max_memory_bytes = {limit}", f"max_scene_bytes = {limit}", f"max_bytes_per_owner = {limit}",
            "max_entities_per_owner = 16_000_000")), encoding="ascii")
        self.grpc, self.http = (free_port() for _ in range(2))
        self.process = subprocess.Popen(
            [program("VOXELD", "the daemon"), "--config", config, "--listen", f"127.0.0.1:{self.grpc}", "--http", f"127.0.0.1:{self.http}"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        until(self.shows, "the daemon shows something", PATIENCE)

    def __enter__(self) -> "Daemon":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.process.terminate()
        status = self.process.wait(PATIENCE)
        self.folder.cleanup()
        if kind is None and status != 0:
            raise SystemExit(f"the daemon exited with {status}")

    def get(self, path: str) -> str:
        with urllib.request.urlopen(f"http://127.0.0.1:{self.http}{path}", timeout=PATIENCE) as answer:
            return str(answer.read().decode())

    def shows(self) -> bool:
        try:
            return 'state="showing"} 1' in self.get("/metrics")
        except OSError:  # the daemon does not listen yet
            return False

    def memory_mib(self, what: str = "VmRSS") -> float:
        status = Path(f"/proc/{self.process.pid}/status").read_text(encoding="ascii")
        found = re.search(rf"{what}:\s+(\d+)", status)
        return int(found[1]) / 1024 if found else 0.0

    def left_mib(self) -> float:
        """Returns the resident memory in MiB, LEFT_FOR seconds after the owners have left. The wait is part of the measurement."""
        time.sleep(LEFT_FOR)
        return self.memory_mib()

    def idle_mib(self) -> float:
        """Returns the resident memory in MiB after an owner with a small moving scene has left. By then the display has allocated its own buffers."""
        with self.connect("first") as v:
            for step in range(100):
                v.box("all", size=2 - 0.01 * step)
                commit = v.commit()
            commit.wait_shown(PATIENCE)
        return self.left_mib()

    def connect(self, name: str, issues: list[str] | None = None) -> voxel.Connection:
        seen: list[str] = [] if issues is None else issues
        return voxel.connect(f"127.0.0.1:{self.grpc}", name=name, timeout=PATIENCE, on_issue=lambda issue: seen.append(str(issue)))


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def silent(port: int, count: int) -> list[socket.socket]:
    strangers = []
    for _ in range(count):
        stranger = socket.socket()
        stranger.setblocking(False)
        stranger.connect_ex(("127.0.0.1", port))
        strangers.append(stranger)
    return strangers


def milliseconds(work: object) -> float:
    begin = time.perf_counter()
    work()  # type: ignore[operator]
    return (time.perf_counter() - begin) * 1000


def ports(repetitions: int, limit: int) -> dict[str, list[float]]:
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    rows: dict[str, list[float]] = {}
    with Daemon(limit) as daemon:
        def commit() -> None:
            with daemon.connect("another") as v:
                v.commit().wait(PATIENCE)

        def beside(port: int, count: int, work: object) -> float:
            strangers = silent(port, count)
            taken = milliseconds(work)
            for stranger in strangers:
                stranger.close()
            return taken

        rows["/healthz beside 1,000 silent connections, ms"] = [
            beside(daemon.http, 1000, lambda: daemon.get("/healthz")) for _ in range(repetitions)]
        rows["a new gRPC client beside 300 silent connections, ms"] = [beside(daemon.grpc, 300, commit) for _ in range(repetitions)]
        ended = threading.Event()

        def storm() -> None:
            held: list[socket.socket] = []
            while not ended.wait(0.02):
                held += silent(daemon.grpc, 50)
                for stranger in held[:-300]:
                    stranger.close()
                held = held[-300:]

        thread = threading.Thread(target=storm)
        thread.start()
        rows["a new gRPC client beside 2,500 new silent connections a second, ms"] = [milliseconds(commit) for _ in range(repetitions)]
        ended.set()
        thread.join()
    return rows


def after(daemon: Daemon, idle: float) -> dict[str, list[float]]:
    return {"resident at its peak, MiB": [daemon.memory_mib("VmHWM")], "idle before, MiB": [idle],
            f"resident {LEFT_FOR:.0f} s after the owner left, MiB": [daemon.left_mib()]}


def instances(_: int, limit: int) -> dict[str, list[float]]:
    with Daemon(limit) as daemon:
        idle = daemon.idle_mib()
        issues: list[str] = []
        with daemon.connect("owner", issues) as v:
            with v.object("o0") as dots:
                for i in range(10):
                    dots.points(f"p{i}", np.array([[0.01 * i, 0.2, 0.3]], np.float32))
            for depth in range(1, 6):
                with v.object(f"o{depth}") as each:
                    for i in range(10):
                        each.instance(f"i{i}", f"o{depth - 1}", transform=voxel.translate(0.001 * i, 0, 0))
            v.instance("million", "o5")
            v.commit().wait(PATIENCE)
            refused = len(issues)
            admitted = 0
            while len(issues) == refused and admitted < 100:
                v.instance(f"some/{admitted}", "o3")  # 10⁴ parts
                v.commit().wait_shown(PATIENCE)
                admitted += 1
        rows: dict[str, list[float]] = {"instances of a million parts refused": [refused], "parts admitted": [(admitted - 1) * 10_000]}
        rows.update(after(daemon, idle))
        return rows


def owners(_: int, limit: int) -> dict[str, list[float]]:
    with Daemon(limit) as daemon:
        idle = daemon.idle_mib()
        admitted = [0, 0, 0]
        ready = threading.Barrier(len(admitted), timeout=PATIENCE)
        errors: list[BaseException] = []

        def attack(number: int) -> None:
            issues: list[str] = []
            with daemon.connect(f"owner {number}", issues) as v:
                with v.object("dots") as dots:
                    for i in range(1000):
                        dots.points(f"p{i}", np.array([[0.001 * i, 0.2, 0.3]], np.float32))
                v.commit().wait(PATIENCE)
                ready.wait()
                while not issues and admitted[number] < 4000:
                    for _ in range(20):
                        v.instance(f"some/{admitted[number]}", "dots")
                        admitted[number] += 1
                    v.commit().wait(PATIENCE)

        def guarded(number: int) -> None:
            try:
                attack(number)
            except BaseException as error:  # raised again below, in the waiting thread
                errors.append(error)

        threads = [threading.Thread(target=guarded, args=(number,)) for number in range(len(admitted))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        if errors:
            raise errors[0]
        rows: dict[str, list[float]] = {"parts sent by the three": [sum(admitted) * 1000]}
        rows.update(after(daemon, idle))
        return rows


def until_refused(limit: int, most: int, at_once: int, put: "Callable[[voxel.Layer, str], None]") -> dict[str, list[float]]:
    """Inserts entities, `at_once` in each commit, until one is refused or `most` have been inserted. Returns the
    measurements."""
    with Daemon(limit) as daemon:
        idle = daemon.idle_mib()
        issues: list[str] = []
        count = 0
        with daemon.connect("owner", issues) as v:
            layer = v.layer("many")
            while not issues and count < most:
                for _ in range(at_once):
                    put(layer, f"e{count}")
                    count += 1
                v.commit().wait_shown(10 * PATIENCE)
        rows: dict[str, list[float]] = {"entities sent until one was refused, or all": [count]}
        rows.update(after(daemon, idle))
        return rows


def entities(_: int, limit: int) -> dict[str, list[float]]:
    point = np.array([[0.1, 0.2, 0.3]], np.float32)
    return until_refused(limit, 4_000_000, 20_000, lambda layer, name: layer.points(name, point))


def shapes(_: int, limit: int) -> dict[str, list[float]]:
    return until_refused(limit, 3_000, 3_000, lambda layer, name: layer.sphere(name, radius=1.5, fill="solid"))


def curves(_: int, limit: int) -> dict[str, list[float]]:
    points = np.array([[-1, -1, -1], [1, -1, 1], [-1, 1, 1], [1, 1, -1]], np.float32)
    return until_refused(limit, 12_000, 12_000, lambda layer, name: layer.curve(name, points, form="bezier"))


def main() -> int:
    attacks = {"ports": ports, "instances": instances, "owners": owners, "entities": entities, "shapes": shapes, "curves": curves}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("attack", nargs="*", help="which of them (none: all)")
    parser.add_argument("--repetitions", type=int, default=10, help="of each time (default: 10)")
    parser.add_argument("--limit", type=int, default=1 << 30, help="max_memory_bytes (default: 1 GiB)")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if unknown := set(options.attack) - set(attacks):
        parser.error(f"unknown attacks: {', '.join(sorted(unknown))}; known: {', '.join(attacks)}")
    rows: dict[str, list[float]] = {}
    for name in options.attack or attacks:
        rows.update({f"{name}: {what}": values for what, values in attacks[name](options.repetitions, options.limit).items()})
    if options.json:
        print(json.dumps(rows))
    else:
        for what, values in rows.items():
            spread = f" ({min(values):.1f} to {max(values):.1f})" if len(values) > 1 else ""
            print(f"{what}: {statistics.median(values):.1f}{spread}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
