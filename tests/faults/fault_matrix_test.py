#!/usr/bin/env python3
"""Faults against loads, each cell a test: the real voxeld with a faulty display and a healthy one, and no client, one client or fifty
that stream, and one more client that must run undisturbed through all of it.

In every cell: the fault happened; the daemon survives (or exits and is restarted, where a fault takes its memory away); the
undisturbed client misses nothing; every commit gets all its outcomes; both displays show the same in the end; and the cause is reported
in a line of the log, by /healthz, and by a metric that has changed, except where the fault says that one of them cannot know it (faults.py).

usage: VOXELD=… PYTHONPATH=… LOADS=idle,one,fifty fault_matrix_test.py [Matrix.test_FAULT_LOAD …]
VOXELD is the daemon, PYTHONPATH the client's wheel and tests/e2e, FAULTY_ENGINE the engine that fails on request (default: tests/faulty_engine beside VOXELD)."""
import contextlib
import os
import sys
import tempfile
import time
import unittest
from pathlib import Path
from typing import Callable

from cell import Cell, GoesOn, same_light
from faults import FAULTS, Fault, Network, TooEarly, Usb
from polling import LONG, until
from programs import program
from relay import Relay

LOADS = {"idle": 0, "one": 1, "fifty": 50}
# USB faults begin after this many transfers: the first of these numbers at which the load is already running.
TRANSFERS = {"idle": (200, 1000, 5000), "one": (400, 1600, 6400), "fifty": (800, 3200, 12800)}
WATCHDOG = 5.0  # seconds within which a daemon that has exited is restarted and serves
if {"-h", "--help"} & set(sys.argv[1:]):
    print(__doc__)
    print("FAULT:", ", ".join(FAULTS))
    sys.exit()
program("VOXELD", "the daemon")


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
                    goes_on = cell.goes_on = GoesOn(cell)
                    stack.callback(goes_on.v.close)
                    stack.callback(goes_on.end)
                cell.begin_load(*more)
                cell.watch_health(0.5)
                before = goes_on.commits if goes_on else 0
                figures, lines = cell.metrics(), len(cell.said())
                fault.run(cell)
                if cell.daemon.poll() is not None:
                    self.assertTrue(fault.deadly, cell.said()[-2000:])
                    began = time.monotonic()
                    cell.start()  # as a service manager would do
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
                grown = [name for name, value in cell.metrics().items() if value > figures.get(name, 0) or name in cell.moved]
                untold = fault.untold(cell.said()[lines:], cell.told, grown)
                self.assertEqual(untold, [], f"{cell.said()[lines:][-3000:]}\nhealth: {sorted(set(cell.told.splitlines()))}")
                cell.daemon.terminate()
                self.assertEqual(cell.daemon.wait(LONG), 0, cell.said()[-2000:])


def add_cells() -> None:
    loads = os.environ.get("LOADS", "idle,one,fifty").split(",")
    if unknown := set(loads) - set(LOADS):
        print(f"{Path(sys.argv[0]).name}: LOADS: there is no {', '.join(sorted(unknown))}; there are {', '.join(LOADS)}", file=sys.stderr)
        sys.exit(2)
    for load in loads:
        for name, fault in FAULTS.items():
            if load == "idle" and name.startswith("network"):
                continue  # no process is behind it
            def test(self: Matrix, fault: Callable[[], Fault] = fault, load: str = load) -> None:
                made = fault()
                if not isinstance(made, Usb):
                    return self.cell(made, LOADS[load])
                for transfers in TRANSFERS[load]:
                    made.begin_after(transfers)
                    with contextlib.suppress(TooEarly):
                        return self.cell(made, LOADS[load])
                    self.doCleanups()
                self.fail("the load was not there before the fault")

            setattr(Matrix, f"test_{name}_{load}", test)


add_cells()
if __name__ == "__main__":
    unittest.main()
