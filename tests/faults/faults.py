"""The faults of the daemon, its clients or its surroundings (fault_matrix_test), and where each is reported."""
import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import unittest
from datetime import datetime, timezone
from pathlib import Path
from typing import Callable

import numpy as np
import voxeld as voxel

from cell import HERE, Cell
from polling import LONG, until
from relay import Relay

TOLD = {"log", "health", "moved"}


class Fault:
    log = ""  # pattern of a line logged since the fault began
    health = ""  # pattern of what /healthz said in the meantime
    moved: tuple[str, ...] = ()  # metrics of which each has grown since
    cannot_know: dict[str, str] = {}  # which of the three does not report it, and why

    hurt, engine = "", 'kind = "cpu"\n'  # options of the faulty display, and of the engine
    tls = False
    deadly = False  # the daemon may exit, and is restarted
    clients_are_cut = False

    def environment(self, _folder: str) -> dict[str, str]:
        return {}

    def run(self, cell: Cell) -> None:
        """Causes the fault, checks that it happened, and ends it."""
        cell.watch_health(1.5)

    def untold(self, lines: str, health: str, grown: list[str]) -> list[str]:
        """Returns the places that should have reported the fault and did not."""
        asked = {"log": bool(self.log), "health": bool(self.health), "moved": bool(self.moved)}
        assert {name for name, is_asked in asked.items() if not is_asked} == set(self.cannot_know), "each of the three tells of it, or has a reason why not"
        wrong = []
        if self.log and not re.search(self.log, lines):
            wrong.append(f"no line of the log has {self.log}")
        if self.health and not re.search(self.health, health):
            wrong.append(f"health did not say {self.health}")
        return wrong + [f"{name} has not grown" for name in self.moved if not any(re.fullmatch(name, each) for each in grown)]


def hurt_display(name: str) -> str:
    return rf'voxeld_display_{name}_total\{{display="hurt"\}}'


class TooEarly(Exception):
    """The fault occurred before the load was running."""


class Usb(Fault):
    """A fault of the display's own device, by its plan: {out} is the number of the first affected transfer to the device, {into} that of
    the first from
    it, counted from the start. The reports show that it happened."""

    def __init__(self, plan: str, why: str, *moved: str) -> None:
        self.plan = plan
        lost = why != "transfers failed"
        self.log = rf'lost display=hurt why="{why}' if lost else "transfers failed display=hurt"
        self.health = rf'"display":"hurt","what":"device","why":"[^"]*{why}'
        self.moved = tuple(hurt_display(name) for name in moved)

    def begin_after(self, transfers: int) -> None:
        self.hurt = f'faults = "{self.plan.format(out=transfers, into=transfers // 4)}"\n'

    def run(self, cell: Cell) -> None:
        before = cell.metrics()
        if before['voxeld_display_transfers_failed_total{display="hurt"}'] > 0 or before['voxeld_display_attaches_total{display="hurt"}'] > 1:
            raise TooEarly
        cell.watch_health(5, says=self.health)


class WorkerLost(Fault):
    engine = 'kind = "cpu"\nin_worker = true\nworker_deadline_ns = 500000000\n'
    log = "engine lost, the CPU takes over display=hurt"
    health = r'"display":"hurt","what":"(the last volume is held|the engine is degraded)"'
    moved = (hurt_display("engine_faults"), hurt_display("engine_returns"))

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
        cell.watch_health(1, says=self.health)
        until(lambda: cell.metrics()['voxeld_display_engine_returns_total{display="hurt"}'] > 0, "an engine that is back")


class EngineReports(Fault):
    """An engine in a process of its own answers a frame with an error, as an engine on a GPU does. It is the tests' own engine, which draws
    on the CPU."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.file = Path()
        why = {"dataloss": "a fault that was asked for", "exhausted": "no room, as was asked for"}[kind]
        self.log = f"engine lost, the CPU takes over display=.*{why}"
        self.health = rf'"what":"(the last volume is held|the engine is degraded)","why":"[^"]*{why}'
        what = {"dataloss": "faults", "exhausted": "out_of_memory"}[kind]
        self.moved = (rf"voxeld_display_engine_{what}_total\{{.*", r"voxeld_display_engine_returns_total\{.*")

    def environment(self, folder: str) -> dict[str, str]:
        given = os.environ.get("FAULTY_ENGINE")
        program = Path(given or Path(os.environ["VOXELD"]).parent / "tests" / "faulty_engine")
        assert given is None or program.is_file(), f"FAULTY_ENGINE: there is no file {program}"
        if not program.is_file():
            raise unittest.SkipTest(f"the engine that fails as it is told is not built: {program} (FAULTY_ENGINE)")
        self.engine = f'kind = "cuda"\nworker = "{program.resolve()}"\nworker_deadline_ns = 1000000000\n'
        self.file = Path(folder, "fault")
        return {"VOXELD_FAULT_FILE": str(self.file)}

    def run(self, cell: Cell) -> None:
        file = self.file
        ready = file.with_suffix(".new")
        ready.write_text(self.kind, encoding="ascii")
        ready.rename(file)
        until(lambda: not file.exists(), "a frame that failed")
        cell.watch_health(1, says=self.health)
        until(lambda: any(value > 0 for name, value in cell.metrics().items() if "engine_returns" in name), "an engine that is back")


class Refused(Fault):
    """System calls of the running daemon fail for a while: every one of them."""

    health = r'"what":"state","why":"[^"]*state\.db'
    moved = ("voxeld_state_failures_total",)

    def __init__(self, calls: str, error: str, log: str) -> None:
        self.calls, self.error, self.log = calls, error, f"state cannot be kept.*{log}"

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
            cell.watch_health(1, says=self.health)
            assert not frame.durable, "nothing can be written, and it was said to be durable"
            tracer.send_signal(signal.SIGINT)
            tracer.wait(LONG)
            try:
                frame.wait_durable(LONG)  # it was not lost: it waited, or is known not to be durable
            except voxel.NotDurable:
                pass
            v.layer("kept").sphere("ball", radius=0.3)
            v.commit(durable=True).wait_durable(LONG)


class Memory(Fault):
    log = "the system had no memory"
    health = '"what":"memory"'
    moved: tuple[str, ...] = ("voxeld_process_segments_refused_total",)
    deadly = clients_are_cut = True
    refused = False

    def run(self, cell: Cell) -> None:
        size = int(re.search(r"VmSize:\s+(\d+)", Path(f"/proc/{cell.daemon.pid}/status").read_text(encoding="ascii"))[1]) * 1024  # type: ignore[index]
        # Less than a segment of arrays (32 MiB), and enough for the stacks (8 MiB) of the threads that gRPC starts: gRPC does not notice
        # that a thread was refused, and never does that thread's work. Only the service manager's watchdog detects such a daemon.
        subprocess.run(["prlimit", "--pid", str(cell.daemon.pid), f"--as={size + (28 << 20)}:unlimited"], check=True)
        with contextlib.suppress(voxel.VoxelError, TimeoutError):
            with voxel.connect(cell.server, name="large", timeout=5, on_issue=self.refuse) as v:
                v.points("large", np.zeros((3_000_000, 3), np.float32))
                v.commit().wait(5)
        cell.watch_health(1, says=self.health)
        if cell.daemon.poll() is None:
            subprocess.run(["prlimit", "--pid", str(cell.daemon.pid), "--as=unlimited"], check=True)
            assert self.refused, "it had no memory for it, and nobody was told"
            self.clients_are_cut = False
        else:
            assert cell.daemon.returncode == 1, f"ended with {cell.daemon.returncode}: {cell.said()[-2000:]}"
            self.log, self.health, self.moved = "cannot go on|out of memory", "", ()
            self.cannot_know = {"health": "it has ended", "moved": "it has ended"}

    def refuse(self, issue: voxel.Issue) -> None:
        self.refused = self.refused or "memory" in str(issue)


class MemoryCgroup(Fault):
    """Limits memory to half of what a client sends, by a control group: the kernel kills the daemon, and a supervisor restarts it."""

    deadly = clients_are_cut = True
    cannot_know = dict.fromkeys(TOLD, "the kernel ends it unasked; whoever watches it and the kernel's log say so")

    def run(self, cell: Cell) -> None:
        first = Path("/sys/fs/cgroup/memory")  # version 1; version 2 has one tree for all controllers
        tree, limit = (first, "memory.limit_in_bytes") if first.is_dir() else (Path("/sys/fs/cgroup"), "memory.max")
        group = tree / f"voxeld-{cell.daemon.pid}"
        size = int(re.search(r"RssAnon:\s+(\d+)", Path(f"/proc/{cell.daemon.pid}/status").read_text(encoding="ascii"))[1]) * 1024  # type: ignore[index]
        try:
            group.mkdir()
            cell.test.addCleanup(group.rmdir)
            (group / limit).write_text(str(size + (24 << 20)), encoding="ascii")
            (group / "cgroup.procs").write_text(str(cell.daemon.pid), encoding="ascii")
        except OSError as error:
            raise unittest.SkipTest(f"no control group for memory can be made here: {error}") from None
        brings = ("import sys, numpy as np, voxeld as voxel\n"
                  "v = voxel.connect(sys.argv[1], name='large', timeout=60)\n"
                  "v.points('large', np.zeros((4_000_000, 3), np.float32))\n"
                  "v.commit().wait(60)\n")
        client = subprocess.Popen([sys.executable, "-c", brings, cell.server], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            cell.daemon.wait(LONG)
        finally:
            client.kill()  # otherwise it would send the same to the next daemon
            client.wait()
        assert cell.daemon.returncode == -signal.SIGKILL, cell.said()[-2000:]


class Descriptors(Fault):
    log = "no connection can be accepted why=.Too many open files"
    health = '"what":"connections","why":"no connection could be accepted [^"]*Too many open files'
    moved = ("voxeld_accept_failures_total",)

    def run(self, cell: Cell) -> None:
        most = len(os.listdir(f"/proc/{cell.daemon.pid}/fd")) + 4
        before = subprocess.run(["prlimit", "--pid", str(cell.daemon.pid), "--nofile", "--output=SOFT,HARD", "--noheadings", "--raw"], check=True, capture_output=True, text=True).stdout.split()
        subprocess.run(["prlimit", "--pid", str(cell.daemon.pid), f"--nofile={most}:{before[1]}"], check=True)
        held = []
        for _ in range(30):
            with contextlib.suppress(OSError):
                held.append(socket.create_connection(("127.0.0.1", cell.port), timeout=1))
        cell.watch_health(1.5)  # which needs a descriptor too
        for each in held:
            each.close()
        subprocess.run(["prlimit", "--pid", str(cell.daemon.pid), f"--nofile={before[0]}:{before[1]}"], check=True)
        cell.watch_health(0.5, says=self.health)


class ClockSteps(Fault):
    """The wall clock steps one hour forward, two back, and one forward. Measurements use the clock that does not step."""

    log = r"the wall clock stepped seconds=\+3[56]\d\d"
    health = '"what":"time","why":"the wall clock stepped by'
    moved = ("voxeld_process_clock_steps_total",)

    def environment(self, folder: str) -> dict[str, str]:
        self.stamp = Path(folder, "time")
        self.stamp.write_text("+0", encoding="ascii")
        return {"LD_PRELOAD": "/usr/lib/x86_64-linux-gnu/faketime/libfaketimeMT.so.1", "FAKETIME_TIMESTAMP_FILE": str(self.stamp), "FAKETIME_NO_CACHE": "1",
                "DONT_FAKE_MONOTONIC": "1", "FAKETIME_DONT_RESET": "1"}

    def run(self, cell: Cell) -> None:
        for number, step in enumerate(("+3600", "-3600", "+0"), 1):
            lines = len(cell.said())
            self.stamp.write_text(step, encoding="ascii")
            until(lambda: cell.metrics()["voxeld_process_clock_steps_total"] >= number, "a clock that stepped")
            cell.watch_health(0.7, says=self.health)
            time_of = r"^(\S+) warning the wall clock stepped"
            off = [(datetime.fromisoformat(stamp) - datetime.now(timezone.utc)).total_seconds() for stamp in re.findall(time_of, cell.said()[lines:], re.M)]
            assert off and abs(off[-1] - int(step)) < 300, f"{step}: the log's time is off by {off}"


class StopClient(Fault):
    cannot_know = dict.fromkeys(TOLD, "a client may say nothing for as long as it likes; that its commits stand still is seen here")

    def run(self, cell: Cell) -> None:
        own = None
        if cell.load is None:
            own = subprocess.Popen([sys.executable, str(HERE / "clients.py"), cell.server, "1", "20"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            assert own.stdout is not None
            own.stdout.readline()
        assert cell.goes_on is not None
        stopped, goes_on = own or cell.load, cell.goes_on
        assert stopped is not None

        def theirs() -> float:
            others = goes_on.commits  # commits of one operation each; one may be under way
            return cell.metrics()["voxeld_operations_applied_total"] - others

        begun = theirs()
        until(lambda: theirs() > begun + 3, "a client that streams")
        stopped.send_signal(signal.SIGSTOP)
        at = -1.0
        while abs(theirs() - at) > 2:  # waits until the daemon has taken in what it had sent before
            at = theirs()
            cell.watch_health(0.5)
        at, others = theirs(), goes_on.commits
        cell.watch_health(1.5)
        assert abs(theirs() - at) <= 3, f"{theirs() - at} commits of clients that are stopped"
        assert goes_on.commits > others, "the one that goes on stood still too"
        stopped.send_signal(signal.SIGCONT)
        until(lambda: theirs() > at + 6, "a client that streams again")
        if own is not None:
            own.kill()
            own.communicate()


class StopDaemon(Fault):
    log = r"the daemon did not run seconds=[1-9]"
    health = '"what":"time","why":"the daemon did not run for'
    moved = ("voxeld_process_pauses_total",)

    def run(self, cell: Cell) -> None:
        cell.daemon.send_signal(signal.SIGSTOP)
        cell.watch_health(1.6)  # it stays stopped, and silent, for that long
        assert "State:\tT" in Path(f"/proc/{cell.daemon.pid}/status").read_text(encoding="ascii")
        cell.daemon.send_signal(signal.SIGCONT)
        cell.watch_health(1, says=self.health)


class StopViewer(Fault):
    """A page that watches both displays is stopped, and continued."""

    moved = ("voxeld_volume_watches_asleep_total",)
    cannot_know = dict.fromkeys(TOLD - {"moved"}, "a reader that stops, a page in the background say, is no fault: it is sent nothing more, and costs nothing")

    def run(self, cell: Cell) -> None:
        page = subprocess.Popen([sys.executable, str(HERE / "viewer.py"), str(cell.http), "well", "hurt"], stdout=subprocess.PIPE, text=True)
        try:
            assert page.stdout is not None
            assert page.stdout.readline() == "reads\n"
            asleep = cell.metrics()["voxeld_volume_watches_asleep_total"]
            page.send_signal(signal.SIGSTOP)
            # First, the buffers at both ends have to fill.
            until(lambda: cell.metrics()["voxeld_volume_watches_asleep_total"] >= asleep + 2, "two watches that sleep")
            cell.watch_health(1)
            page.send_signal(signal.SIGCONT)
            assert page.stdout.readline() == "reads again\n"
        finally:
            page.kill()
            page.communicate()


class Network(Fault):
    """Disturbs the network path of the clients, and only theirs."""

    clients_are_cut = True
    relay: Relay

    def __init__(self, how: str) -> None:
        self.how = how
        if how == "stalls":
            self.clients_are_cut = False
            self.moved = (r'voxeld_commit_sending_seconds\{stat="max"\}',)
            self.cannot_know = dict.fromkeys(TOLD - {"moved"}, "a client of which nothing comes may have nothing to say; that commits came late is known once they come")
        else:
            self.log, self.moved = "session taken up again", ("voxeld_sessions_resumed_total",)
            self.cannot_know = {"health": "where clients come from is no health of the daemon's"}

    def run(self, cell: Cell) -> None:
        relay = self.relay
        resumed = cell.metrics()["voxeld_sessions_resumed_total"]
        if self.how == "stalls":
            # The metric covers the last seconds: commits that a busy machine delayed must have left it.
            until(lambda: cell.metrics()['voxeld_commit_sending_seconds{stat="max"}'] < 1, "commits that come in time")
            relay.stall()
        elif self.how == "halves":
            relay.half = True
        else:
            assert relay.cut() >= cell.clients, "connections that were cut"
        cell.watch_health(1.5)
        relay.go_on()
        if self.how == "stalls":
            assert relay.held > 0, "nothing was held"
            until(lambda: cell.metrics()['voxeld_commit_sending_seconds{stat="max"}'] >= 1, "commits that came more than a second late")
            cell.moved.add('voxeld_commit_sending_seconds{stat="max"}')
        else:
            assert self.how == "cut" or relay.halved > 0, "nothing was halved"
            until(lambda: cell.metrics()["voxeld_sessions_resumed_total"] > resumed, "a session that was taken up again")


class Certificates(Fault):
    """The server's certificate is replaced by one that its clients do not trust, and then restored. Existing connections stay."""

    tls = True
    log, moved = "TLS files were read again", ("voxeld_tls_files_taken_total",)
    cannot_know = {"health": "files that are in order are no trouble"}

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


class CertificateBroken(Fault):
    """The server's key is replaced by the key of another certificate. The previous pair stays in force."""

    tls = True
    log = "TLS files are wrong: .*is not the key of the certificate"
    health = '"what":"access","why":"[^"]*is not the key of the certificate'
    moved = ("voxeld_tls_files_refused_total",)

    def run(self, cell: Cell) -> None:
        cell.certificate("second")
        cell.install("first", key="second")
        cell.watch_health(2.5, says=self.health)
        cell.install("first")
        cell.watch_health(1.5)


FAULTS: dict[str, Callable[[], Fault]] = {
    "usb_stall": lambda: Usb("stall@t{out}", "transfers failed", "transfers_failed"),
    "usb_time_out": lambda: Usb("nak:2500@t{out}", "transfers failed", "transfers_failed"),
    "usb_babble": lambda: Usb("babble:2@t{into}/in", "transfers failed", "transfers_failed"),
    "usb_protocol_error": lambda: Usb("error:8@t{out}", "transfers failed 6 times in a row", "transfers_failed", "volumes_lost", "attaches"),
    "usb_short": lambda: Usb("partial:100@t{out}", "transfers failed", "transfers_failed"),
    "usb_unplug": lambda: Usb("unplug:600@t{out}", "the device was unplugged", "attaches"),
    "usb_reset": lambda: Usb("unplug:30@t{out}", "the device was unplugged", "attaches"),
    "engine_killed": lambda: WorkerLost(signal.SIGKILL), "engine_hangs": lambda: WorkerLost(signal.SIGSTOP),
    "engine_reports_an_error": lambda: EngineReports("dataloss"), "device_memory_full": lambda: EngineReports("exhausted"),
    "disk_full": lambda: Refused("pwrite64,ftruncate,fallocate", "ENOSPC", "full"),
    "disk_read_only": lambda: Refused("pwrite64,fdatasync,fsync", "EROFS", "I/O error"),
    "memory_limit": Memory, "memory_cgroup": MemoryCgroup, "descriptors_out": Descriptors, "clock_steps": ClockSteps, "client_stopped": StopClient, "daemon_stopped": StopDaemon, "viewer_stopped": StopViewer,
    "network_stalls": lambda: Network("stalls"), "network_halves": lambda: Network("halves"), "network_cut": lambda: Network("cut"),
    "certificates_swapped": Certificates, "certificate_broken": CertificateBroken,
}
