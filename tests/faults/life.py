"""A life of the real voxeld in which tests make something fail: its start, the steps carried out with it (scenarios.py has ten), its exit.

This must hold whatever fails: no signal ends the daemon, nothing hangs, a start that fails says why, what was reported as shown is shown,
and
what was reported as durable is there after the next start."""
import contextlib
import gc
import os
import re
import signal
import socket
import subprocess
import time
import urllib.request
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable, ClassVar, Mapping, Optional

import grpc
import numpy as np
import voxeld as voxel

from programs import ENDS_WITH_US

PATIENCE = 8.0  # seconds to wait for something that may never come
ENDS = 30.0  # seconds for a daemon to exit by itself
HEAP_SPREAD = 256 << 10  # bytes by which one undisturbed life differs from another: 40 KiB were seen
COUNTED_AGAIN = 30.0  # seconds until memory has been counted again on a busy machine: counting may take a thousandth of the time, and time
                      # during which it is preempted counts too


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@dataclass
class Told:
    """The reports of the daemon, which must be true."""

    shown: bool = False  # what the last capture looked for was in its volume
    durable: bool = False  # the layer with the box, which a client asked to be persistent, is durable
    kept: set[str] = field(default_factory=set)  # further entities that are durable
    gone: set[str] = field(default_factory=set)  # entities whose removal is durable
    failed: list[str] = field(default_factory=list)  # steps that were refused, with the error


class Life:
    """Derived classes define the steps."""

    about: ClassVar[str]
    steps: ClassVar[tuple[str, ...]]  # methods, in order; each may be refused, and the next is run all the same
    shows: ClassVar[bool] = True  # if undisturbed, it reports that something is shown
    keeps: ClassVar[bool] = False  # and that it is durable
    from_start: ClassVar[bool] = False  # True: the failure may occur during startup, since startup is part of this life; False: only once
                                        # it is ready

    engine: ClassVar[str] = ""  # more lines for the configuration's section of that name

    def __init__(self, folder: Path, server: str = "") -> None:
        """`server`: more lines for the configuration's section of that name."""
        self.folder = folder
        self.more = server
        self.server = f"unix:{folder}/s"
        self.port, self.pid = 0, 0
        self.process: Optional["subprocess.Popen[str]"] = None
        self.told = Told()

    def prepare(self) -> None:
        """Prepares what exists before the first start; nothing fails then."""

    def listens(self) -> list[str]:
        """Returns the addresses beside the socket."""
        return []

    def security(self) -> str:
        """Returns a section of the configuration, or an empty string."""
        return ""

    def displays(self) -> str:
        return ('[[display]]\nname = "stack"\ndriver = "simulated"\nsize = "12x12x8"\nrate = 100\n'
                '[[display]]\nname = "rotor"\ndriver = "simulated"\ngeometry = "rotor"\nsize = "12x8"\nslices = 24\nrate = 100\n')

    def config(self) -> str:
        self.port = free_port()
        addresses = ", ".join(f'"{address}"' for address in [self.server, *self.listens()])
        return (f'[server]\nlisten = [{addresses}]\nhttp = "127.0.0.1:{self.port}"\n{self.more}\n[state]\ndir = "{self.folder}/state"\n'
                f'[engine]\nkind = "cpu"\n{self.engine}{self.security()}{self.displays()}')

    def start(self, *before: str, environment: Optional[Mapping[str, str]] = None) -> "subprocess.Popen[str]":
        path = self.folder / "voxeld.toml"
        path.write_text(self.config(), encoding="utf-8")
        self.output = (self.folder / "output").open("w+", encoding="utf-8")
        ends_with_us = () if before or environment else ENDS_WITH_US  # only the daemon itself is traced or preloaded
        self.process = subprocess.Popen([*ends_with_us, *before, os.environ["VOXELD"], "--config", str(path), "--log-level", "info"],
                                        stdin=subprocess.DEVNULL, stdout=self.output, stderr=subprocess.STDOUT, text=True, start_new_session=True,
                                        env={**os.environ, **(environment or {})})
        return self.process

    def said(self) -> str:
        return (self.folder / "output").read_text(encoding="utf-8", errors="replace")

    def ready(self, process: "subprocess.Popen[str]") -> bool:
        deadline = time.monotonic() + ENDS
        while time.monotonic() < deadline and process.poll() is None:
            with contextlib.suppress(OSError):  # a daemon whose log cannot be written becomes ready too
                with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/healthz", timeout=PATIENCE) as answer:
                    return bool(answer.read())
            time.sleep(0.01)  # it polls: nothing signals when it listens, and its exit is an answer too
        return False

    # ---- its steps

    def step(self, name: str, what: Callable[[], None]) -> None:
        """Runs one step. A failure is noted and the next step is run; errors that are not the client's own are failures of the test."""
        try:
            what()
        except (voxel.VoxelError, grpc.RpcError, TimeoutError, ConnectionError, OSError, AssertionError, StopIteration) as error:
            said = str(error.details() if isinstance(error, grpc.RpcError) else error)
            self.told.failed.append(f"{name}: {type(error).__name__}: {said.partition(chr(10))[0]}")

    def lived(self, process: "subprocess.Popen[str]", pid: Callable[[], int], once_ready: Callable[[], None] = lambda: None) -> tuple[bool, str]:
        """Returns whether it became ready and ran its steps, and what it reported that was not true. `pid` returns the daemon's own process
        id once it has
        started."""
        is_ready = self.ready(process)
        self.pid = pid()
        if not is_ready:
            return False, ""
        once_ready()
        try:
            self.live()
        except RuntimeError as untrue:
            return True, str(untrue)
        return True, ""

    def went_well(self) -> bool:
        """Returns whether all steps succeeded with the expected reports."""
        return not self.told.failed and self.told.shown == self.shows and self.told.durable == self.keeps

    def live(self) -> None:
        for name in self.steps:
            if self.process is not None and self.process.poll() is not None:
                self.told.failed.append(f"{name}: it had ended")
                return
            self.step(name, getattr(self, name))

    def connect(self, **more: object) -> voxel.Connection:
        return voxel.connect(self.server, timeout=PATIENCE, **more)  # type: ignore[arg-type]

    def draw(self) -> None:
        with self.connect(name="one") as v:
            v.layer("first").sphere("ball", radius=0.5, color="red", fill="solid")
            v.points("cloud", np.zeros((3000, 3), np.float32))
            frame = v.commit()
            outcomes = frame.wait_shown(timeout=PATIENCE)
            assert frame.accepted is not None and outcomes and set(outcomes) == set(frame.accepted.displays), outcomes
            v.lines("wrong", [[0, 0, 0], [1, 0, 0]], colors="blue")
            v.commit().wait(PATIENCE)
            v.displays(timeout=PATIENCE)
            v.stats(timeout=PATIENCE)


def refuses(life: Life) -> str:
    """Returns why another client that draws, after several attempts, is not served; empty: it is served, as it must be whatever failed once."""
    told, life.told = life.told, Told()
    try:
        for _ in range(8):  # each thread that had not answered yet may meet a failure of its own
            life.told.failed.clear()
            life.step("draw afterwards", life.draw)
            if not life.told.failed:
                return ""
        return f"it serves nobody afterwards: {life.told.failed}"
    finally:
        life.told = told


def sockets() -> int:
    """Returns the sockets of this process. Python closes a channel that nobody holds when it collects garbage, so it collects now."""
    gc.collect()
    found = 0
    for name in os.listdir("/proc/self/fd"):
        with contextlib.suppress(OSError):
            found += os.readlink(f"/proc/self/fd/{name}").startswith("socket:")
    return found


def descriptors(pid: int, most: int, patience: float = PATIENCE, ours: int = 1 << 20) -> int:
    """Returns how many descriptors a process has, once there are at most `most`, or after a while. Each connection takes two: those of the
    sockets
    beyond `ours` that this process still has open are not the daemon's doing, and are not counted."""
    deadline = time.monotonic() + patience
    while True:
        try:
            have = len(os.listdir(f"/proc/{pid}/fd"))
        except OSError:
            return 0
        if have > most:
            have -= 2 * max(sockets() - ours, 0)
        if have <= most or time.monotonic() > deadline:
            return have
        time.sleep(0.02)  # it polls: connections close by themselves, and nothing signals when


def metric(port: int, name: str) -> int:
    """Returns the value that the daemon reports; -1: it reports none."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=PATIENCE) as answer:
            found = re.search(rf"^{name} (\S+)", answer.read().decode(), re.M)
            return int(float(found[1])) if found else -1
    except OSError:
        return -1


def heap(port: int, most: int) -> int:
    """Returns the bytes that it has allocated, once they are at most `most`, or after a while. -1: it does not report them."""
    deadline = time.monotonic() + COUNTED_AGAIN
    while not 0 <= (have := metric(port, "voxeld_process_heap_bytes")) <= most and time.monotonic() < deadline:
        time.sleep(0.05)  # it polls: memory is released gradually, and nothing signals when
    return have


def events(pid: int) -> int:
    """Returns how many of a process's descriptors are eventfds."""
    with contextlib.suppress(OSError):
        return sum(os.readlink(f"/proc/{pid}/fd/{name}") == "anon_inode:[eventfd]" for name in os.listdir(f"/proc/{pid}/fd"))
    return 0


@dataclass(frozen=True)
class Rest:
    """The resources that a daemon holds before its exit, when no client is connected."""
    descriptors: int
    heap: int  # bytes allocated


def at_rest(life: Life, pid: int) -> Rest:
    """Returns what it holds once closed connections are gone: once the number of descriptors has not changed since memory was last counted."""
    deadline = time.monotonic() + PATIENCE
    have, since = -1, 0.0
    while True:
        now = descriptors(pid, 1 << 20)
        if now != have:
            have, since = now, time.monotonic()
        elif time.monotonic() > min(since + 1.2, deadline):  # memory is counted each second
            return Rest(have, metric(life.port, "voxeld_process_heap_bytes"))
        time.sleep(0.02)  # it polls: nothing signals when


def leaks(life: Life, most: Rest, more: int = 0) -> str:
    """Returns the memory left beyond `more` and what an undisturbed life leaves, for a life in which its clients missed nothing; empty: no leak."""
    allowed = most.heap + HEAP_SPREAD + more
    if life.told.failed or 0 <= (left := heap(life.port, allowed)) <= allowed:
        return ""
    return f"{left} bytes are left allocated, of {most.heap}" if left >= 0 else "it does not tell what it has allocated"


def end(process: "subprocess.Popen[str]", pid: int) -> Optional[int]:
    """Returns its exit status after it was asked to exit; None: it had to be killed."""
    if pid:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGTERM)
    try:
        return process.wait(ENDS)
    except subprocess.TimeoutExpired:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return None


@dataclass
class Ending:
    how: str  # lived, refused, ended, late, hung, crashed, known: …
    wrong: str = ""


def judge(life: Life, status: Optional[int], is_ready: bool, alive: bool, reason: str = "") -> Ending:
    """Returns the ending of a life that exited with `status`. `alive`: it ran until it was asked to exit. `reason`: the failure hit code of
    others, which
    ends the process by its own decision."""
    said = life.said()
    if status is None:
        return Ending("hung", "it did not end when it was asked to")
    if status < 0 or status > 128:
        if reason:
            return Ending(f"known: {reason}")
        return Ending("crashed", f"it ended by signal {abs(status) % 128}: {said.strip().splitlines()[-1:]}")
    if not is_ready:
        return Ending("refused", "" if said.strip() and status != 0 else f"it ended with {status} before it was ready, and said nothing")
    if alive:
        late = "did not end in time" in said  # libraries wait for threads that they did not get; the daemon then exits by itself, and says
                                              # so
        fine = status == 0 or late
        return Ending("late" if late else "lived", "" if fine else f"it ended with {status} when it was asked to: {said.strip().splitlines()[-1:]}")
    told = reason or re.search(r"^voxeld: .|error|failed|cannot", said, re.I | re.M)
    return Ending("ended", "" if told else f"it ended with {status} and did not say why")


def again(before: Life) -> str:
    """Starts it once more, undisturbed, on the same state. Returns what was wrong then; empty: nothing."""
    life, told = type(before)(before.folder), before.told
    process = life.start()
    life.pid = process.pid
    wrong = ""
    if not life.ready(process):
        wrong = f"it does not start any more: {life.said().strip().splitlines()[-1:]}"
    elif told.durable:
        life.step("durable after", lambda: has_kept(life, told))
        if life.told.failed:
            wrong = f"what was told to be durable is not there: {life.told.failed}"
    if end(process, process.pid) is None:
        wrong = wrong or "the next one did not end"
    return wrong


def has_kept(life: Life, told: Told) -> None:
    with life.connect(name="after") as v:
        names = {entity.key.id for entity in v.entities()}
        if not {"box", *told.kept} <= names or names & told.gone:
            raise AssertionError(f"entities are {sorted(names)}, durable were box and {sorted(told.kept)}, and gone {sorted(told.gone)}")
