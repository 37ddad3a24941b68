#!/usr/bin/env python3
"""Measures the throughput of Open Pixel Control input: `voxelctl input opc`, compared with olad (the Open Lighting Architecture's daemon),
alternately within one run. Each receives the same messages over one connection; a run ends when the receiver has read all of them.
Afterwards every message to voxelctl is accounted for: its statistics must say that it was set. olad does not count.

usage: opc_compare.py --bin DIR [--messages N] [--lights N] [--runs N] [--json]
"""
import argparse
import json
import os
import pwd
import shutil
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Callable

WAIT = 60.0
OTHERS = ("artnet dummy e131 espnet ftdidmx gpio karate kinet milinst opendmx osc pathport renard sandnet shownet spi stageprofi uartdmx "
          "usbdmx usbserial").split()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def until(right: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + WAIT
    while not right():
        if time.monotonic() > deadline:
            raise SystemExit(f"opc_compare: {what} did not come within {WAIT:.0f} s")
        time.sleep(0.001)  # polling, because nothing signals another program's state


def answers(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def send(port: int, block: bytes, blocks: int) -> float:
    """Returns: the seconds until the receiver has read all of them, that is until nothing waits at either end."""
    with socket.create_connection(("127.0.0.1", port), WAIT) as stream:
        mine = stream.getsockname()[1]
        began = time.monotonic()
        for _ in range(blocks):
            stream.sendall(block)
        until(lambda: waiting(mine, port) == 0 and waiting(port, mine) == 0, "the end of reading")
        return time.monotonic() - began


def waiting(local: int, remote: int) -> int:
    """Returns: the bytes that wait to be sent or read at that end of a connection on this machine, as the kernel reports them
    (proc(5))."""
    for line in Path("/proc/net/tcp").read_text(encoding="ascii").splitlines()[1:]:
        _, here, there, _, queues, *_ = line.split()
        if int(here.split(":")[1], 16) == local and int(there.split(":")[1], 16) == remote:
            return sum(int(queue, 16) for queue in queues.split(":"))
    raise SystemExit("opc_compare: the receiver has closed the connection")


class Voxeld:
    def __init__(self, folder: str, binaries: Path, lights: int) -> None:
        self._socket, self.port = f"unix:{folder}/voxeld.sock", free_port()
        self._tally: dict[str, Any] = {}
        self._daemon = subprocess.Popen([binaries / "voxeld", "--listen", self._socket, "--http", "off", "--log-level", "warn", "--engine", "cpu",
                                         "--display", "cube=simulated,size=8x8x8,rate=60"], stdout=subprocess.DEVNULL)
        until(lambda: Path(folder, "voxeld.sock").exists(), "voxeld")
        self._input = subprocess.Popen([binaries / "voxelctl", "--server", self._socket, "--json", "input", "opc", "--size", f"{lights}x1x1",
                                        "--listen", f"127.0.0.1:{self.port}"], stdout=subprocess.PIPE, text=True)
        assert self._input.stdout is not None
        json.loads(self._input.stdout.readline())

    def messages(self) -> int:
        """Ends the receiver. Returns: how many messages were read correctly, by its final count."""
        self._input.terminate()
        out, _ = self._input.communicate(timeout=WAIT)
        tally = json.loads(out.splitlines()[-1])
        if tally["messages"] != tally["set"]:
            raise SystemExit(f"opc_compare: not every message was set: {tally}")
        return int(tally["set"])

    def stop(self) -> None:
        self._input.kill()
        self._daemon.terminate()
        self._daemon.wait(WAIT)


class Olad:
    def __init__(self, folder: str) -> None:
        self.port = free_port()
        listen = f"127.0.0.1:{self.port}"
        files = {"openpixelcontrol": f"enabled = true\nlisten = {listen}\nlisten_{listen}_channel = 0\n", **dict.fromkeys(OTHERS, "enabled = false\n")}
        for name, text in files.items():
            Path(folder, f"ola-{name}.conf").write_text(text, encoding="utf-8")
        user: dict[str, Any] = {}
        if os.geteuid() == 0:  # olad does not run as root
            nobody = pwd.getpwnam("nobody")
            user = {"user": nobody.pw_uid, "group": nobody.pw_gid, "extra_groups": []}
            for path in (Path(folder), *Path(folder).iterdir()):
                os.chown(path, nobody.pw_uid, nobody.pw_gid)
        with Path(folder, "olad.log").open("wb") as log:
            self._process = subprocess.Popen(["olad", "--config-dir", folder, "--http-port", f"{free_port()}", "--rpc-port", f"{free_port()}",
                                              "--no-http-quit", "--no-register-with-dns-sd", "--log-level", "1"], stdout=log, stderr=log, **user)
        until(lambda: answers(self.port), "olad's port")

    def stop(self) -> None:
        self._process.kill()
        self._process.wait(WAIT)


def send_to_olad(block: bytes, blocks: int) -> float:
    """Starts a new olad each time: after a connection has ended it does not always listen again."""
    with tempfile.TemporaryDirectory() as folder:
        olad = Olad(folder)
        try:
            return send(olad.port, block, blocks)
        finally:
            olad.stop()


def told(rates: list[float]) -> dict[str, float]:
    return {"median": statistics.median(rates), "least": min(rates), "most": max(rates)}


def main() -> int:
    parser = argparse.ArgumentParser(description="Open Pixel Control into voxelctl and into olad, messages a second.")
    parser.add_argument("--bin", type=Path, required=True, help="where voxeld and voxelctl are")
    parser.add_argument("--messages", type=int, default=3_000,
                        help="of each run, in hundreds (default: %(default)s; olad 0.10.8 corrupts its heap and ends at some tens of thousands)")
    parser.add_argument("--lights", type=int, default=170, help="of each message (default: %(default)s, a universe of channels, which is olad's most)")
    parser.add_argument("--runs", type=int, default=5, help="of each receiver (default: %(default)s)")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if not (100 <= options.messages and 1 <= options.lights <= 170 and options.runs >= 1):
        parser.error("--messages is at least 100, --lights 1 to 170, --runs at least 1")
    if shutil.which("olad") is None:
        parser.error("olad not found; run tools/setup --test")
    blocks = options.messages // 100
    count = options.lights * 3
    block = (struct.pack(">BBH", 0, 0, count) + bytes(index % 256 for index in range(count))) * 100
    ours: list[float] = []
    theirs: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        voxeld = Voxeld(folder, options.bin, options.lights)
        try:
            for run in range(options.runs):
                if sys.stderr.isatty():
                    print(f"\rrun {run + 1} of {options.runs}", end="", file=sys.stderr)
                ours.append(blocks * 100 / send(voxeld.port, block, blocks))
                theirs.append(blocks * 100 / send_to_olad(block, blocks))
            set_in_all = voxeld.messages()
        finally:
            voxeld.stop()
    if set_in_all != blocks * 100 * options.runs:
        raise SystemExit(f"opc_compare: {set_in_all} of {blocks * 100 * options.runs} messages are accounted for")
    result = {"messages": blocks * 100, "lights": options.lights, "runs": options.runs, "accounted_for": set_in_all, "voxelctl_per_s": told(ours),
              "olad_per_s": told(theirs), "ratio": statistics.median(a / b for a, b in zip(ours, theirs))}
    if options.json:
        print(json.dumps(result))
        return 0
    if sys.stderr.isatty():
        print(file=sys.stderr)
    for name, rates in (("voxelctl input opc", ours), ("olad", theirs)):
        print(f"{name:20} {statistics.median(rates):12,.0f} messages/s  ({min(rates):,.0f} to {max(rates):,.0f})")
    print(f"ratio {result['ratio']:.2f}; {set_in_all:,} messages of {options.lights} lights, all accounted for")
    return 0


if __name__ == "__main__":
    sys.exit(main())
