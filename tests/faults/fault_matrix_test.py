"""Faults against loads, each cell a test: the real voxeld with a display that is hurt and one that is not, nobody, one client or fifty
that stream, and one more that goes on through all of it.

In every cell: the daemon lives (or ends and is started again, where a fault takes its memory away); the
one that goes on misses nothing; every commit gets all that it is owed; both displays show the same in the end; and the fault's cause is told
by a line of the log, by health, or by a metric that has moved since. Paths are in VOXELD and PYTHONPATH; LOADS says which (idle,one,fifty)."""
import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from typing import Callable

import numpy as np
import voxeld as voxel

from cell import HERE, Cell, GoesOn, same_light
from polling import LONG, until
from relay import Relay

LOADS = {"idle": 0, "one": 1, "fifty": 50}
WATCHDOG = 5.0  # seconds in which a daemon that has ended is there again, and serves


# ---- faults: what is done to the daemon, its clients or its surroundings, and where it is told


class Fault:
    log = ""  # a line of the log since, or of health, that tells of it
    moved = ""  # or a metric that has grown since; both empty: nothing is to be told
    hurt, engine = "", ""  # options of the display that is hurt, and of the engine
    tls = False
    deadly = False  # the daemon may end, and is started again
    clients_are_cut = False

    def environment(self, folder: str) -> dict[str, str]:
        return {}

    def run(self, cell: Cell) -> None:
        """Does it, and takes it back."""
        cell.watch_health(1.5)


class Usb(Fault):
    """The display's own device: by its plan, a second and a half after the start, or from the 100th transfer on."""

    def __init__(self, plan: str) -> None:
        self.hurt = f'faults = "{plan}"\n'
        # What a display has sent again, lost, or come back from.
        self.moved = r'voxeld_display_(slices_resent|volumes_lost|transfers_failed|attaches)_total\{display="hurt"\}'

    def run(self, cell: Cell) -> None:
        cell.watch_health(5)


class WorkerLost(Fault):
    engine = "in_worker = true\nworker_deadline_ns = 500000000\n"
    moved = r'voxeld_display_engine_faults_total'

    def __init__(self, number: int) -> None:
        self.number = number

    def run(self, cell: Cell) -> None:
        hurt = 0
        for pid in Path(f"/proc/{cell.daemon.pid}/task/{cell.daemon.pid}/children").read_text(encoding="ascii").split():
            with contextlib.suppress(OSError):
                if "voxeld-engine" in Path(f"/proc/{pid}/cmdline").read_text(encoding="ascii"):
                    os.kill(int(pid), self.number)
                    hurt += 1
        assert hurt > 0, "no engine in a process of its own"
        cell.watch_health(2)


class Refused(Fault):
    """System calls of the running daemon fail for a while, all of them."""

    moved = "voxeld_state_failures_total"

    def __init__(self, calls: str, error: str) -> None:
        self.calls, self.error = calls, error

    def run(self, cell: Cell) -> None:
        trace = Path(cell.folder, "trace")
        tracer = subprocess.Popen(["strace", "-f", "-qq", "-o", str(trace), "-e", f"trace={self.calls}", "-e", f"inject={self.calls}:error={self.error}", "-e", "signal=none",
                                   "-p", str(cell.daemon.pid)], stderr=subprocess.DEVNULL)
        tasks = Path(f"/proc/{cell.daemon.pid}/task")
        until(lambda: all("TracerPid:\t0" not in Path(task, "status").read_text(encoding="ascii") for task in tasks.iterdir()), "a tracer of all threads")
        with voxel.connect(cell.server, name="keeps", on_disconnect="keep", timeout=LONG) as v:
            v.layer("kept").sphere("ball", radius=0.2)
            frame = v.commit(durable=True)
            frame.wait(LONG)
            until(lambda: trace.exists() and "INJECTED" in trace.read_text(errors="replace"), "a call that failed")
            cell.watch_health(1)
            assert not frame.durable, "nothing can be written, and it was said to be durable"
            tracer.send_signal(signal.SIGINT)
            tracer.wait(LONG)
            try:
                frame.wait_durable(LONG)  # it was not lost: it waited, or was told not to be
            except voxel.NotDurable:
                pass
            v.layer("kept").sphere("ball", radius=0.3)
            v.commit(durable=True).wait_durable(LONG)


class Memory(Fault):
    deadly = clients_are_cut = True
    refused = False

    def run(self, cell: Cell) -> None:
        size = int(re.search(r"VmSize:\s+(\d+)", Path(f"/proc/{cell.daemon.pid}/status").read_text(encoding="ascii"))[1]) * 1024  # type: ignore[index]
        subprocess.run(["prlimit", "--pid", str(cell.daemon.pid), f"--as={size + (8 << 20)}:unlimited"], check=True)
        with contextlib.suppress(voxel.VoxelError, TimeoutError):
            with voxel.connect(cell.server, name="large", timeout=5, on_issue=self.refuse) as v:
                v.points("large", np.zeros((3_000_000, 3), np.float32))
                v.commit().wait(5)
        cell.watch_health(1)
        if cell.daemon.poll() is None:
            subprocess.run(["prlimit", "--pid", str(cell.daemon.pid), "--as=unlimited"], check=True)
            assert self.refused, "it had no memory for it, and nobody was told"
        else:
            assert re.search("cannot go on|bad_alloc|out of memory", cell.said()), cell.said()[-2000:]

    def refuse(self, issue: voxel.Issue) -> None:
        self.refused = self.refused or "memory" in str(issue)


class MemoryCgroup(Fault):
    """Half as much as a client brings, by a control group: the kernel ends the daemon, and whatever watches it starts it again."""

    deadly = clients_are_cut = True

    def run(self, cell: Cell) -> None:
        first = Path("/sys/fs/cgroup/memory")  # version 1; of 2 there is one tree of all
        tree, limit = (first, "memory.limit_in_bytes") if first.is_dir() else (Path("/sys/fs/cgroup"), "memory.max")
        group = tree / f"voxeld-{cell.daemon.pid}"
        try:
            group.mkdir()
        except OSError as error:
            raise unittest.SkipTest(f"no control group for memory can be made here: {error}") from None
        cell.test.addCleanup(group.rmdir)
        size = int(re.search(r"RssAnon:\s+(\d+)", Path(f"/proc/{cell.daemon.pid}/status").read_text(encoding="ascii"))[1]) * 1024  # type: ignore[index]
        (group / "cgroup.procs").write_text(str(cell.daemon.pid), encoding="ascii")
        (group / limit).write_text(str(size + (24 << 20)), encoding="ascii")
        brings = ("import sys, numpy as np, voxeld as voxel\n"
                  "v = voxel.connect(sys.argv[1], name='large', timeout=60)\n"
                  "v.points('large', np.zeros((4_000_000, 3), np.float32))\n"
                  "v.commit().wait(60)\n")
        client = subprocess.Popen([sys.executable, "-c", brings, cell.server], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            cell.daemon.wait(LONG)
        finally:
            client.kill()  # else it would bring the same to the next daemon
            client.wait()
        assert cell.daemon.returncode == -signal.SIGKILL, cell.said()[-2000:]


class Descriptors(Fault):
    log, moved = r"[Tt]oo many open files", "voxeld_(accept_failures|probe_failures)_total"

    def run(self, cell: Cell) -> None:
        most = len(os.listdir(f"/proc/{cell.daemon.pid}/fd")) + 4
        before = subprocess.run(["prlimit", "--pid", str(cell.daemon.pid), "--nofile", "--output=SOFT,HARD", "--noheadings", "--raw"], check=True, capture_output=True, text=True).stdout.split()
        subprocess.run(["prlimit", "--pid", str(cell.daemon.pid), f"--nofile={most}:{before[1]}"], check=True)
        held = []
        for _ in range(30):
            with contextlib.suppress(OSError):
                held.append(socket.create_connection(("127.0.0.1", cell.port), timeout=1))
        cell.watch_health(1.5)
        for each in held:
            each.close()
        subprocess.run(["prlimit", "--pid", str(cell.daemon.pid), f"--nofile={before[0]}:{before[1]}"], check=True)
        cell.watch_health(0.5)


class ClockSteps(Fault):
    """An hour on, and two back. What is measured goes by the clock that does not step."""

    def environment(self, folder: str) -> dict[str, str]:
        self.stamp = Path(folder, "time")
        self.stamp.write_text("+0", encoding="ascii")
        return {"LD_PRELOAD": "/usr/lib/x86_64-linux-gnu/faketime/libfaketimeMT.so.1", "FAKETIME_TIMESTAMP_FILE": str(self.stamp), "FAKETIME_NO_CACHE": "1",
                "DONT_FAKE_MONOTONIC": "1", "FAKETIME_DONT_RESET": "1"}

    def run(self, cell: Cell) -> None:
        for step in ("+3600", "-3600", "+0"):
            self.stamp.write_text(step, encoding="ascii")
            cell.watch_health(0.7)


class StopClient(Fault):
    def run(self, cell: Cell) -> None:
        stopped = cell.load or subprocess.Popen([sys.executable, str(HERE / "clients.py"), cell.server, "1", "20"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        if cell.load is None:
            assert stopped.stdout is not None
            stopped.stdout.readline()
        stopped.send_signal(signal.SIGSTOP)
        cell.watch_health(1.5)
        stopped.send_signal(signal.SIGCONT)
        if cell.load is None:
            stopped.kill()
            stopped.communicate()


class StopDaemon(Fault):
    def run(self, cell: Cell) -> None:
        cell.daemon.send_signal(signal.SIGSTOP)
        cell.watch_health(1.5)  # so long it is stopped, and says nothing
        assert "State:\tT" in Path(f"/proc/{cell.daemon.pid}/status").read_text(encoding="ascii")
        cell.daemon.send_signal(signal.SIGCONT)


class StopViewer(Fault):
    """A page that asks, and does not read."""

    def run(self, cell: Cell) -> None:
        with socket.create_connection(("127.0.0.1", cell.http)) as page:
            page.sendall(f"GET /volumes HTTP/1.1\r\nHost: 127.0.0.1:{cell.http}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                         "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode())
            assert b" 101 " in page.recv(4096)
            for text in (b'{"watch":"well","id":1}', b'{"watch":"hurt","id":2}', *[b'{"stats":true}'] * 50):
                page.sendall(bytes([0x81, 0x80 | len(text), 0, 0, 0, 0]) + text)
            cell.watch_health(2)


class Network(Fault):
    """The clients' way to it, and theirs alone."""

    clients_are_cut = True
    relay: Relay

    def __init__(self, how: str) -> None:
        self.how = how

    def run(self, cell: Cell) -> None:
        relay = self.relay
        if self.how == "stalls":
            relay.stall()
        elif self.how == "halves":
            relay.half = True
        else:
            relay.cut()
        cell.watch_health(1.5)
        relay.go_on()


class Certificates(Fault):
    """The server's certificate is exchanged for one that its clients do not trust, and back. Who is there stays."""

    tls = True

    def run(self, cell: Cell) -> None:
        def dial(ca: str) -> bool:
            with contextlib.suppress(voxel.VoxelError, TimeoutError):
                who = voxel.Credentials(ca=f"{cell.folder}/{ca}.pem", certificate=f"{cell.folder}/first.pem", key=f"{cell.folder}/first.key", server_name="display.example")
                with voxel.connect(f"tls:127.0.0.1:{cell.port}", timeout=2, credentials=who):
                    return True
            return False

        cell.certificate("second")
        assert dial("first")
        cell.install("second")
        until(lambda: dial("second"), "the second certificate")
        assert not dial("first")
        cell.install("first")
        until(lambda: dial("first"), "the first certificate")


FAULTS: dict[str, Callable[[], Fault]] = {
    "usb_stall": lambda: Usb("stall@t100"), "usb_time_out": lambda: Usb("nak:2500@t100"), "usb_babble": lambda: Usb("babble:2@t20/in"), "usb_protocol_error": lambda: Usb("error:8@t100"),
    "usb_short": lambda: Usb("partial:100@t100"), "usb_unplug": lambda: Usb("unplug:600@1500ms"), "usb_reset": lambda: Usb("unplug:30@1500ms"),
    "engine_killed": lambda: WorkerLost(signal.SIGKILL), "engine_hangs": lambda: WorkerLost(signal.SIGSTOP),
    "disk_full": lambda: Refused("pwrite64,ftruncate,fallocate", "ENOSPC"),
    "disk_read_only": lambda: Refused("pwrite64,fdatasync,fsync", "EROFS"),
    "memory_limit": Memory, "memory_cgroup": MemoryCgroup, "descriptors_out": Descriptors, "clock_steps": ClockSteps, "client_stopped": StopClient, "daemon_stopped": StopDaemon, "viewer_stopped": StopViewer,
    "network_stalls": lambda: Network("stalls"), "network_halves": lambda: Network("halves"), "network_cut": lambda: Network("cut"), "certificates_swapped": Certificates,
}


class Matrix(unittest.TestCase):
    def cell(self, fault: Fault, clients: int) -> None:
        with tempfile.TemporaryDirectory(prefix="voxeld-fault-") as folder:
            environment = fault.environment(folder)
            cell = Cell(self, clients, fault.hurt, fault.engine, environment, fault.tls)
            more: tuple[str, ...] = ()
            if isinstance(fault, Network):
                fault.relay = Relay(("127.0.0.1", cell.port))
                self.addCleanup(fault.relay.close)
                cell.via = f"127.0.0.1:{fault.relay.port}"
            if fault.tls:
                cell.via = f"tls:127.0.0.1:{cell.port}"
                more = (f"{cell.folder}/first.pem", f"{cell.folder}/first.key", "display.example")
            with contextlib.ExitStack() as stack:
                goes_on = None
                if not fault.deadly:
                    goes_on = GoesOn(cell)
                    stack.callback(goes_on.end)
                cell.begin_load(*more)
                cell.watch_health(0.5)
                before = goes_on.commits if goes_on else 0
                figures, lines = cell.metrics(), len(cell.said())
                if isinstance(fault, Usb):  # its plan began with the daemon
                    figures = {name: 1.0 for name in figures if "attaches" in name}
                fault.run(cell)
                if cell.daemon.poll() is not None:
                    self.assertTrue(fault.deadly, cell.said()[-2000:])
                    began = time.monotonic()
                    cell.start()  # as whatever watches it does
                    self.assertLess(time.monotonic() - began, WATCHDOG)
                if goes_on:
                    going = goes_on
                    until(lambda: going.commits > before + 10 or going.wrong, "the one that goes on")
                    goes_on.end()
                    self.assertEqual(goes_on.wrong, "")
                    goes_on.v.close()
                sums = cell.end_load()
                if not fault.clients_are_cut:
                    self.assertEqual(sums.get("unknown", 0), 0, sums)
                same_light(cell)
                if fault.log or fault.moved:
                    grown = [name for name, value in cell.metrics().items() if value > figures.get(name, 0)]
                    told = bool(fault.log and re.search(fault.log, cell.said()[lines:] + cell.told))
                    told = told or bool(fault.moved and any(re.match(fault.moved, name) for name in grown))
                    self.assertTrue(told, f"nothing tells of it: {cell.said()[-2000:]}")
                cell.daemon.terminate()
                self.assertEqual(cell.daemon.wait(LONG), 0, cell.said()[-2000:])


def add_cells() -> None:
    for load in os.environ.get("LOADS", "idle,one,fifty").split(","):
        for name, fault in FAULTS.items():
            if load == "idle" and name.startswith("network"):
                continue  # nobody is behind it
            def test(self: Matrix, fault: Callable[[], Fault] = fault, load: str = load) -> None:
                self.cell(fault(), LOADS[load])

            setattr(Matrix, f"test_{name}_{load}", test)


add_cells()
