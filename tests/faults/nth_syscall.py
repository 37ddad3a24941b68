#!/usr/bin/env python3
"""Every n-th system call of the daemon failed once: strace makes one call fail in each thread, in an otherwise ordinary life of the real voxeld
(start; drawing with receipts; a durable commit; captures and watched volumes; the page, metrics and health; an asset;
reloading; the end), and then it is started again on the same state, unharmed.

usage: nth_syscall.py [--calls NAME,…] [--most N] [--sample N] [--seed N] [--list] [--json]

What must hold: no signal ends the daemon, nothing hangs, a start that fails says why, what was told to be shown is shown, what was told to be
durable is there after the next start, and the daemon ends by itself when asked. Paths are in VOXELD and PYTHONPATH; ends with 1 if one did not."""
import argparse
import collections
import contextlib
import json
import os
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable, Optional

import grpc
import numpy as np
import voxeld as voxel

PATIENCE = 8.0  # for what may not come any more
ENDS = 30.0  # for a daemon to end by itself

# What fails, and with what: errors that a system in want gives.
ERRORS = {
    "openat": ["EMFILE"], "read": ["EIO"], "pread64": ["EIO"], "write": ["ENOSPC"], "pwrite64": ["ENOSPC"], "writev": ["EIO"], "fsync": ["EIO"],
    "fdatasync": ["EIO"], "ftruncate": ["ENOSPC"], "fallocate": ["ENOSPC"], "rename": ["EIO"], "unlink": ["EACCES"], "mkdir": ["EACCES"],
    "getdents64": ["EIO"], "flock": ["EWOULDBLOCK"], "fcntl": ["EINVAL"], "fchmod": ["EPERM"], "chmod": ["EPERM"], "newfstatat": ["EACCES"], "fstat": ["EIO"],
    "socket": ["EMFILE"], "bind": ["EADDRINUSE"], "listen": ["EADDRINUSE"], "accept4": ["EMFILE"], "accept": ["ENFILE"], "connect": ["ECONNREFUSED"],
    "sendmsg": ["ENOBUFS"], "recvmsg": ["ECONNRESET"], "sendto": ["ENOBUFS"], "recvfrom": ["ECONNRESET"], "setsockopt": ["ENOPROTOOPT"], "getsockopt": ["EINVAL"],
    "getsockname": ["ENOBUFS"], "getpeername": ["ENOTCONN"], "shutdown": ["ENOTCONN"], "socketpair": ["EMFILE"], "pipe2": ["EMFILE"],
    "epoll_create1": ["EMFILE"], "epoll_ctl": ["ENOMEM"], "epoll_wait": ["EINTR"], "poll": ["EINTR"], "eventfd2": ["EMFILE"], "timerfd_create": ["EMFILE"],
    "timerfd_settime": ["EINVAL"], "memfd_create": ["EMFILE"], "inotify_init1": ["EMFILE"], "mmap": ["ENOMEM"], "mprotect": ["ENOMEM"], "madvise": ["EINVAL"],
    "clone3": ["EAGAIN"], "execve": ["ENOENT"], "prlimit64": ["EPERM"], "sched_getaffinity": ["EINVAL"], "setpriority": ["EACCES"],
}

# Where others decide what becomes of the process when they are refused memory, threads or descriptors.
THEIRS = re.compile(r"/(libgrpc|libgrpc\+\+|libgpr|ld-linux-x86-64|libsqlite3|libtbb)[^/]*\.so")


@dataclass
class Told:
    """What the daemon said, which has to be true."""

    shown: bool = False  # the ball, in the volume of the last capture
    durable: bool = False
    failed: list[str] = field(default_factory=list)  # steps that were refused, with what was said


class Life:
    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.server = f"unix:{folder}/s"
        self.port, self.pid = 0, 0
        self.told = Told()

    def config(self) -> str:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        return (f'[server]\nlisten = ["{self.server}"]\nhttp = "127.0.0.1:{self.port}"\n[state]\ndir = "{self.folder}/state"\n'
                '[[display]]\nname = "stack"\ndriver = "simulated"\nsize = "12x12x8"\nrate = 100\n'
                '[[display]]\nname = "rotor"\ndriver = "simulated"\ngeometry = "rotor"\nsize = "12x8"\nslices = 24\nrate = 100\n')

    def start(self, *before: str) -> "subprocess.Popen[str]":
        path = self.folder / "voxeld.toml"
        path.write_text(self.config(), encoding="utf-8")
        self.output = (self.folder / "output").open("w+", encoding="utf-8")
        return subprocess.Popen([*before, os.environ["VOXELD"], "--config", str(path), "--log-level", "info", "--engine", "cpu"],
                                stdin=subprocess.DEVNULL, stdout=self.output, stderr=subprocess.STDOUT, text=True, start_new_session=True)

    def said(self) -> str:
        return (self.folder / "output").read_text(encoding="utf-8", errors="replace")

    def ready(self, process: "subprocess.Popen[str]") -> bool:
        deadline = time.monotonic() + ENDS
        while time.monotonic() < deadline and process.poll() is None:
            with contextlib.suppress(OSError):  # also one whose log cannot be written is ready
                with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/healthz", timeout=PATIENCE) as answer:
                    return bool(answer.read())
            time.sleep(0.01)  # nothing tells when it listens, and its end is an answer too
        return False

    # ---- what it goes through

    def step(self, name: str, what: Callable[[], None]) -> None:
        """What fails is noted and the next goes on; errors that are not the clients' own are the test's."""
        try:
            what()
        except (voxel.VoxelError, grpc.RpcError, TimeoutError, ConnectionError, OSError, AssertionError) as error:
            self.told.failed.append(f"{name}: {type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}")

    def live(self) -> None:
        for name in ("draw", "durable", "lifetimes", "asset", "page", "reload", "capture"):
            self.step(name, getattr(self, name))

    def connect(self, **more: object) -> voxel.Connection:
        return voxel.connect(self.server, timeout=PATIENCE, **more)  # type: ignore[arg-type]

    def draw(self) -> None:
        with self.connect(name="one") as v:
            v.layer("first").sphere("ball", radius=0.5, color="red", fill="solid")
            v.points("cloud", np.zeros((3000, 3), np.float32))
            outcomes = v.commit().wait_shown(timeout=PATIENCE)
            assert len(outcomes) == 2, outcomes
            v.lines("wrong", [[0, 0, 0], [1, 0, 0]], colors="blue")
            v.commit().wait(PATIENCE)
            v.displays(timeout=PATIENCE)
            v.stats(timeout=PATIENCE)

    def durable(self) -> None:
        v = self.connect(name="two", on_disconnect="keep")
        try:
            v.layer("stays").box("box", size=(1, 1, 1), color="white", fill="solid")
            frame = v.commit(durable=True).wait_durable(PATIENCE)
            self.told.durable = bool(frame.durable)
        finally:
            v.close(PATIENCE)

    def lifetimes(self) -> None:
        with self.connect(name="three") as v:
            ball = v.sphere("brief", radius=0.2, color="green")
            ball.transform = voxel.translate(0.1, 0, 0)
            v.commit().wait_shown(timeout=PATIENCE)
            v.entities()
            v.layers()

    def asset(self) -> None:
        with self.connect(name="four") as v:
            v.upload(bytes(200_000))

    def page(self) -> None:
        for path in ("/healthz", "/metrics", "/"):
            with urllib.request.urlopen(f"http://127.0.0.1:{self.port}{path}", timeout=PATIENCE) as answer:
                assert answer.read()

    def reload(self) -> None:
        os.kill(self.pid, signal.SIGHUP)

    def capture(self) -> None:
        with self.connect(name="five", on_disconnect="clear") as v:
            v.layer("last").sphere("ball", radius=0.3, color="red", fill="solid")
            frame = v.commit()
            outcomes = frame.wait_shown(timeout=PATIENCE)
            assert frame.accepted is not None
            picture = v.capture("stack", at_least_snapshot=frame.accepted.snapshot, timeout=PATIENCE).rgb
            red = (picture[..., 0] > 100) & (picture[..., 1] < 50)
            if "stack" in outcomes and outcomes["stack"].kind == "presented" and not red.any():
                raise RuntimeError("it was told to be shown, and is not")
            self.told.shown = bool(red.any())


@dataclass
class Result:
    call: str
    error: str
    n: int
    how: str  # lived, refused, ended, late, known: …
    wrong: str = ""
    failed: list[str] = field(default_factory=list)


def pid_of(tracer: "subprocess.Popen[str]") -> int:
    """The daemon beneath its tracer."""
    with contextlib.suppress(OSError, ValueError):
        return int(Path(f"/proc/{tracer.pid}/task/{tracer.pid}/children").read_text(encoding="ascii").split()[0])
    return 0


def end(tracer: "subprocess.Popen[str]", pid: int) -> Optional[int]:
    """Its exit status when it was asked to end; None: it had to be killed."""
    if pid:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGTERM)
    try:
        return tracer.wait(ENDS)
    except subprocess.TimeoutExpired:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(tracer.pid, signal.SIGKILL)
        tracer.wait()
        return None


def whose(trace: str) -> str:
    """The library of others that made the call that failed first, by its stack; empty: it was our own."""
    at = trace.find("(INJECTED)")
    stack = re.match(r"\n((?: > .*\n)*)", trace[at + len("(INJECTED)"):]) if at >= 0 else None
    found = THEIRS.search(stack[1]) if stack else None
    return found[1] if found else ""


def run(call: str, error: str, n: int, stacks: bool = False) -> Result:
    """With `stacks`, much slower, what others' code does when it is refused is told from what ours does."""
    with tempfile.TemporaryDirectory(prefix="voxeld-nth-") as name:
        life = Life(Path(name))
        tracer = life.start("strace", "-f", "-qq", *(["-k"] if stacks else []), "--seccomp-bpf", "-o", f"{name}/trace", "-e", f"trace={call}",
                            *(["-P", f"{name}/output"] if call == "write" else []),  # what else is written to this way are events, which cannot fail
                            "-e", f"inject={call}:error={error}:when={n}", "-e", "signal=none")
        is_ready = life.ready(tracer)
        life.pid = pid_of(tracer)
        wrong = ""
        if is_ready:
            try:
                life.live()
            except RuntimeError as untrue:
                wrong = str(untrue)
        alive = tracer.poll() is None
        status = end(tracer, life.pid)
        said = life.said()
        theirs = whose(Path(name, "trace").read_text(encoding="utf-8", errors="replace")) if stacks else ""
        reason = f"{theirs} asked, and gives up" if theirs else ""
        if status is None:
            how, wrong = "hung", "it did not end when it was asked to"
        elif status < 0 or status > 128:
            how = f"known: {reason}" if reason else "crashed"
            wrong = wrong or ("" if reason else f"it ended by signal {abs(status) % 128}: {said.strip().splitlines()[-1:] }")
        elif not is_ready:
            how = "refused"
            wrong = "" if said.strip() and status != 0 else f"it ended with {status} before it was ready, and said nothing"
        elif alive:
            late = "did not end in time" in said  # others wait for threads that they did not get; it is ended, and says so
            how = "late" if late else "lived"
            wrong = wrong or ("" if status == 0 or late else f"it ended with {status} when it was asked to: {said.strip().splitlines()[-1:]}")
        else:
            how = "ended"
            wrong = wrong or ("" if reason or re.search(r"^voxeld: .|error|failed|cannot", said, re.I | re.M) else f"it ended with {status} and did not say why")
        # Unharmed, on the same state.
        again = Life(Path(name))
        process = again.start()
        again.pid = process.pid
        if not again.ready(process):
            wrong = wrong or f"it does not start any more: {again.said().strip().splitlines()[-1:]}"
        elif life.told.durable:
            again.step("durable after", lambda: again_has(again, wrong_if))
            if again.told.failed:
                wrong = wrong or f"what was told to be durable is not there: {again.told.failed}"
        if end(process, process.pid) is None:
            wrong = wrong or "the next one did not end"
        return Result(call, error, n, how, wrong, life.told.failed)


def wrong_if(right: bool, what: str) -> None:
    if not right:
        raise AssertionError(what)


def again_has(life: Life, check: Callable[[bool, str], None]) -> None:
    with life.connect(name="after") as v:
        names = [entity.key.id for entity in v.entities()]
        check("box" in names, f"entities are {names}")


def count() -> dict[str, int]:
    """How often a thread calls each at the most."""
    with tempfile.TemporaryDirectory(prefix="voxeld-nth-") as name:
        life = Life(Path(name))
        tracer = life.start("strace", "-f", "-qq", "-o", f"{name}/trace", "-e", f"trace={','.join(ERRORS)}", "-e", "signal=none")
        if not life.ready(tracer):
            sys.exit(f"voxeld does not start: {life.said()}")
        life.pid = pid_of(tracer)
        life.live()
        if life.told.failed or not life.told.shown or not life.told.durable:
            sys.exit(f"unharmed it failed: {life.told}")
        if (status := end(tracer, life.pid)) != 0:
            sys.exit(f"unharmed it ended with {status}: {life.said()}")
        calls: collections.Counter[tuple[str, str]] = collections.Counter()
        for line in Path(name, "trace").read_text(encoding="utf-8", errors="replace").splitlines():
            if match := re.match(r"(\d+) +(\w+)\(", line):
                calls[match[1], match[2]] += 1
        most: dict[str, int] = {}
        for (_, call), times in calls.items():
            if call in ERRORS:
                most[call] = max(most.get(call, 0), times)
        return most


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calls", help="only these, by comma")
    parser.add_argument("--most", type=int, default=1 << 30, help="of each call the first so many")
    parser.add_argument("--sample", type=int, default=0, help="so many of all, by chance")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--list", action="store_true", help="say how many there are, and end")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    counted = count()
    wanted = options.calls.split(",") if options.calls else sorted(counted)
    cases = [(call, error, n) for call in wanted for error in ERRORS[call] for n in range(1, min(counted.get(call, 0), options.most) + 1)]
    if options.list:
        print("\n".join(f"{call} {times}" for call, times in sorted(counted.items())))
        print(f"{len(cases)} cases")
        return 0
    if options.sample:
        cases = random.Random(options.seed).sample(cases, min(options.sample, len(cases)))
    results = []
    for i, case in enumerate(cases):
        last = run(*case)
        if last.how in ("crashed", "hung"):
            last = run(*case, stacks=True)
        results.append(last)
        if last.wrong or not options.json and (sys.stderr.isatty() or i % 50 == 49):
            print(f"{i + 1}/{len(cases)} {last.call} {last.error} {last.n}: {last.how}{'; WRONG: ' + last.wrong if last.wrong else ''}", file=sys.stderr, flush=True)
    if options.json:
        print(json.dumps([vars(result) for result in results]))
    else:
        table: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
        for result in results:
            table[result.call]["wrong" if result.wrong else result.how.split(":")[0]] += 1
        print(f"{'call':<18}{'lived':>7}{'refused':>9}{'ended':>7}{'late':>7}{'known':>7}{'wrong':>7}")
        for call, kinds in sorted(table.items()):
            print(f"{call:<18}" + "".join(f"{kinds[kind]:>{width}}" for kind, width in (("lived", 7), ("refused", 9), ("ended", 7), ("late", 7), ("known", 7), ("wrong", 7))))
        wrong = sum(1 for result in results if result.wrong)
        print(f"{len(results)} cases, {wrong} wrong")
    return 1 if any(result.wrong for result in results) else 0


if __name__ == "__main__":
    sys.exit(main())
