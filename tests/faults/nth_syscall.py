#!/usr/bin/env python3
"""Makes every n-th system call of the daemon fail once: strace makes one call fail in each thread, in one of ten scenarios (scenarios.py) of the real
voxeld: from its start on, or, where another scenario has the same startup, once it is ready. Then it is restarted on the same state, undisturbed.

usage: nth_syscall.py [--scenarios NAME,…] [--calls NAME,…] [--most N] [--sample N] [--seed N] [--part K/N] [--within S]
                      [--jobs N] [--list] [--json]

What must hold: no signal ends the daemon, nothing hangs, a start that fails says why, what was reported as shown is shown, what was reported as
durable is there after the next start, later clients are served, no descriptor and no memory leaks, and the daemon exits by itself
when asked. Paths are in VOXELD and PYTHONPATH; exits with 1 if one of these does not hold.

Results, by scenario and by call:
  lived     it went on                              late     it had not exited 5 s after the request, and terminated itself with the reason
  missed    no thread made so many of these calls   known    a third-party library made the call, and ended the process, or leaked something
  refused   it did not start, and said why          wrong    one of the above does not hold; the lines before say which
  ended     it exited with 1, and said why"""
import argparse
import collections
import contextlib
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Optional

from apart import add_options, chosen, each, positive, verdict
from life import ENDS, Ending, Life, Rest, again, at_rest, descriptors, end, events, judge, leaks, sockets, refuses
from programs import program
from scenarios import SCENARIOS

# The calls that fail, and their errors: those that a system out of resources returns.
ERRORS = {
    "openat": ["EMFILE"], "read": ["EIO"], "pread64": ["EIO"], "write": ["ENOSPC"], "pwrite64": ["ENOSPC"], "writev": ["EIO"], "fsync": ["EIO"],
    "fdatasync": ["EIO"], "ftruncate": ["ENOSPC"], "fallocate": ["ENOSPC"], "rename": ["EIO"], "unlink": ["EACCES"], "mkdir": ["EACCES"],
    "getdents64": ["EIO"], "flock": ["EWOULDBLOCK"], "fcntl": ["EINVAL"], "fchmod": ["EPERM"], "chmod": ["EPERM"], "newfstatat": ["EACCES"], "fstat": ["EIO"],
    "socket": ["EMFILE"], "bind": ["EADDRINUSE"], "listen": ["EADDRINUSE"], "accept4": ["EMFILE"], "accept": ["ENFILE"], "connect": ["ECONNREFUSED"],
    "sendmsg": ["ENOBUFS", "EPIPE"], "recvmsg": ["ECONNRESET"], "sendto": ["ENOBUFS"], "recvfrom": ["ECONNRESET"], "setsockopt": ["ENOPROTOOPT"], "getsockopt": ["EINVAL"],
    "getsockname": ["ENOBUFS"], "getpeername": ["ENOTCONN"], "shutdown": ["ENOTCONN"], "socketpair": ["EMFILE"], "pipe2": ["EMFILE"],
    "epoll_create1": ["EMFILE"], "epoll_ctl": ["ENOMEM"], "epoll_wait": ["EINTR"], "poll": ["EINTR"], "eventfd2": ["EMFILE"], "timerfd_create": ["EMFILE"],
    "timerfd_settime": ["EINVAL"], "memfd_create": ["EMFILE"], "inotify_init1": ["EMFILE"], "mmap": ["ENOMEM"], "mprotect": ["ENOMEM"], "madvise": ["EINVAL"],
    "clone3": ["EAGAIN"], "execve": ["ENOENT"], "prlimit64": ["EPERM"], "sched_getaffinity": ["EINVAL"], "setpriority": ["EACCES"],
}

# Without them libraries use a pipe, which is one descriptor more.
A_PIPE_INSTEAD = ("eventfd2", "epoll_ctl")
# Failures that leave a connection open: a shutdown that did nothing, which never happens to a connected socket that its client keeps open;
# and gRPC, which waits for room after ENOBUFS: nothing ever signals room on a socket that was never full.
LEAVES_IT_OPEN = (("shutdown", "ENOTCONN"), ("sendmsg", "ENOBUFS"))
# Seconds after which a client gives up a connection that nobody answers; it is then closed at both ends.
GIVES_UP = 40.0
# When gRPC cannot use an eventfd to wake an epoll, it polls without one, and has an eventfd for each of its threads instead.
POLLS_INSTEAD = re.compile(r"\(INJECTED\)\n(?: > .*\n)*? > .*grpc_ev_epoll1_posix")
# When oneTBB cannot load its allocator, it takes its memory, half a megabyte, from the C library.
WITHOUT_ALLOCATOR = re.compile(r"\(INJECTED\)\n(?: > .*\n)*? > .*/libtbb\.so")
# The upper bound of that memory in bytes.
ALLOCATORS_SHARE = 1 << 20
# Third-party libraries that decide themselves what becomes of the process when they are refused memory, threads or descriptors.
THEIRS = re.compile(r"/(libgrpc|libgrpc\+\+|libgpr|ld-linux-x86-64|libsqlite3|libtbb)[^/]*\.so")
# Libraries that make a call on behalf of their caller.
BASE = re.compile(r"/(libc|libstdc\+\+|libgcc_s|libm|libabsl_\w+)[^/]*\.so")


@dataclass
class Result:
    scenario: str
    call: str
    error: str
    n: int
    how: str  # lived, missed, refused, ended, late, known: …
    wrong: str = ""
    failed: list[str] = field(default_factory=list)


def whose(trace: str) -> list[str]:
    """Returns, for each call that failed, the third-party library that made it, by its stack; empty: it was our own code."""
    return [of_stack(stack) for stack in re.findall(r"\(INJECTED\)\n((?: > .*\n)*)", trace)]


def of_stack(stack: str) -> str:
    """Returns the library that made the call, skipping those that only pass it on."""
    for frame in stack.splitlines():
        if match := THEIRS.search(frame):
            return match[1]
        if not BASE.search(frame):
            return ""
    return ""


class Traced:
    """A life under strace, which is attached from the start or once it is ready."""

    def __init__(self, scenario: str, folder: Path, *options: str) -> None:
        self.life = SCENARIOS[scenario](folder)
        self._strace = ["strace", "-f", "-qq", "-o", f"{folder}/trace", "-e", "signal=none", *options]
        self._tracer: Optional["subprocess.Popen[bytes]"] = None
        self.life.prepare()
        if self.life.from_start:
            self._process = self.life.start(*self._strace[:2], "--seccomp-bpf", *self._strace[2:])
        else:
            self._process = self.life.start()

    def lived(self) -> tuple[bool, str]:
        return self.life.lived(self._process, self._pid, (lambda: None) if self.life.from_start else self._attach)

    def alive(self) -> bool:
        return self._process.poll() is None

    def end(self) -> Optional[int]:
        status = end(self._process, self.life.pid)
        if self._tracer is not None:
            try:
                self._tracer.wait(ENDS)
            except subprocess.TimeoutExpired:
                self._tracer.kill()
                self._tracer.wait()
        return status

    def _pid(self) -> int:
        """Returns the daemon's own process id, with or without a tracer as its parent."""
        if not self.life.from_start:
            return self._process.pid
        with contextlib.suppress(OSError, ValueError):
            return int(Path(f"/proc/{self._process.pid}/task/{self._process.pid}/children").read_text(encoding="ascii").split()[0])
        return 0

    def _has_all(self) -> bool:
        with contextlib.suppress(OSError):  # a thread that ends in the meantime
            return all(re.search(r"^TracerPid:\t[1-9]", Path(f"/proc/{self.life.pid}/task/{task}/status").read_text(encoding="ascii"), re.M)
                       for task in os.listdir(f"/proc/{self.life.pid}/task"))
        return False

    def _attach(self) -> None:
        self._tracer = subprocess.Popen([*self._strace, "-p", str(self.life.pid)], stdin=subprocess.DEVNULL)
        deadline = time.monotonic() + ENDS
        while not self._has_all():
            if self._tracer.poll() is not None or time.monotonic() > deadline:
                sys.exit("strace does not come to hold of the daemon")
            time.sleep(0.005)  # it polls: nothing signals when it has all threads


def run(scenario: str, call: str, error: str, n: int, rest: Rest, stacks: bool = False) -> Result:
    """Runs one case. With `stacks`, which is much slower, failures in third-party code are distinguished from failures in ours."""
    with tempfile.TemporaryDirectory(prefix="voxeld-nth-") as name:
        ours = sockets()
        traced = Traced(scenario, Path(name), *(["-k"] if stacks else []), "-e", f"trace={call}",
                        *(["-P", f"{name}/output"] if call == "write" else []),  # other writes in this way are those to events, which
                                                                                 # cannot fail
                        "-e", f"inject={call}:error={error}:when={n}")
        life, leak, much, others = traced.life, "", "", 0
        is_ready, wrong = traced.lived()
        alive = traced.alive()
        if alive and is_ready:
            wrong = wrong or refuses(life)
            most = rest.descriptors + (call in A_PIPE_INSTEAD)
            left = descriptors(life.pid, most, GIVES_UP, ours)
            if left > most and (call, error) not in LEAVES_IT_OPEN:
                leak = f"{left} descriptors are left, of {most}"
                others = left - events(life.pid)
            elif left <= most and not wrong:
                leak = leaks(life, rest)
                much = leak and leaks(life, rest, ALLOCATORS_SHARE)
        status = traced.end()
        found = Path(name, "trace")
        trace = found.read_text(encoding="utf-8", errors="replace") if found.exists() else ""  # it did not get that far
        theirs = whose(trace) if stacks else [""]
        # The call that failed last is what ended the process.
        ending = judge(life, status, is_ready, alive, f"{theirs[-1]} asked, and gives up" if theirs and theirs[-1] else "")
        after = again(life)
        excused = all(theirs) or (others and others <= most and POLLS_INSTEAD.search(trace)) or (not others and not much and WITHOUT_ALLOCATOR.search(trace))
        if leak and not ending.wrong and theirs and excused:
            ending, leak = Ending(f"known: {next(filter(None, theirs))} asked, and keeps what it had"), ""
        wrong = wrong or ending.wrong or leak or after
        missed = ending.how == "lived" and "(INJECTED)" not in trace  # no thread made so many of these calls this time
        return Result(scenario, call, error, n, "leaks" if leak else "missed" if missed else ending.how, wrong, life.told.failed)


def run_or_excuse(scenario: str, call: str, error: str, n: int, rest: Rest) -> Result:
    """Runs one case. If it ends by a signal, hangs or leaks, it is repeated with stacks: third-party code may have decided so. If not, the
    first result counts."""
    first = run(scenario, call, error, n, rest)
    if first.how not in ("crashed", "hung", "leaks"):
        return first
    for _ in range(3):  # chance decides which thread's call fails
        again_with_stacks = run(scenario, call, error, n, rest, stacks=True)
        if again_with_stacks.how.startswith("known") or again_with_stacks.wrong:
            return again_with_stacks
    return first


def count(scenario: str) -> tuple[str, dict[str, int], Rest]:
    """Returns how often one thread makes each call at most, and what the daemon holds before its exit."""
    with tempfile.TemporaryDirectory(prefix="voxeld-nth-") as name:
        traced = Traced(scenario, Path(name), "-e", f"trace={','.join(ERRORS)}")
        is_ready, wrong = traced.lived()
        life = traced.life
        if is_ready:
            wrong = wrong or ("" if life.went_well() else str(life.told)) or refuses(life)
        rest = at_rest(life, life.pid)
        status = traced.end()
        if not is_ready or wrong or status != 0:
            sys.exit(f"{scenario}: unharmed it failed: {wrong}; it ended with {status}: {life.said()[-2000:]}")
        calls: collections.Counter[tuple[str, str]] = collections.Counter()
        for line in Path(name, "trace").read_text(encoding="utf-8", errors="replace").splitlines():
            if match := re.match(r"(\d+) +(\w+)\(", line):
                calls[match[1], match[2]] += 1
        most: dict[str, int] = {}
        for (_, call), times in calls.items():
            if call in ERRORS:
                most[call] = max(most.get(call, 0), times)
        return scenario, most, rest


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenarios", default=",".join(SCENARIOS), help="only these, by comma (default: all ten: %(default)s)")
    parser.add_argument("--calls", help="only these, by comma")
    parser.add_argument("--most", type=positive, default=1 << 30, help="of each call the first so many")
    add_options(parser)
    parser.add_argument("--list", action="store_true", help="say how often each is called, and how many cases that makes, and end")
    options = parser.parse_args()
    if unknown := set(options.calls.split(",")) - set(ERRORS) if options.calls else set():
        parser.error(f"no such calls: {', '.join(sorted(unknown))}; there are {', '.join(sorted(ERRORS))}")
    scenarios = options.scenarios.split(",")
    if unknown := set(scenarios) - set(SCENARIOS):
        parser.error(f"no such scenarios: {', '.join(sorted(unknown))}; there are {', '.join(SCENARIOS)}")
    program("VOXELD", "the daemon")
    cases = []
    for scenario, counted, rest in sorted(each(count, [(scenario,) for scenario in scenarios], options.jobs)):
        wanted = [call for call in sorted(counted) if not options.calls or call in options.calls.split(",")]
        here = [(scenario, call, error, n, rest) for call in wanted for error in ERRORS[call] for n in range(1, min(counted[call], options.most) + 1)]
        cases += here
        if options.list:
            print(f"{scenario}: {SCENARIOS[scenario].about}")
            print("\n".join(f"  {call} {counted[call]}" for call in wanted))
            print(f"  {len(here)} cases")
    if options.list:
        print(f"{len(cases)} cases")
        return 0
    cases = chosen(cases, lambda case: case[:4], options)
    done = 0

    def tell(last: Result) -> None:
        nonlocal done
        done += 1
        if last.wrong or not options.json and (sys.stderr.isatty() or done % 50 == 0):
            wrong = f"; WRONG: {last.wrong}" if last.wrong else ""
            print(f"{done}/{len(cases)} {last.scenario} {last.call} {last.error} {last.n}: {last.how}{wrong}", file=sys.stderr, flush=True)

    results = each(run_or_excuse, cases, options.jobs, options.within, tell)
    if options.json:
        print(json.dumps([vars(result) for result in results]))
    else:
        kinds = ("lived", "missed", "refused", "ended", "late", "known", "wrong")
        for what in ("scenario", "call"):
            table: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
            for result in results:
                table[getattr(result, what)]["wrong" if result.wrong else result.how.split(":")[0]] += 1
            print(f"{what:<18}" + "".join(f"{kind:>9}" for kind in kinds))
            for name, counted_kinds in sorted(table.items()):
                print(f"{name:<18}" + "".join(f"{counted_kinds[kind]:>9}" for kind in kinds))
        wrong = sum(1 for result in results if result.wrong)
        print(f"{len(results)} cases, {len(cases) - len(results)} left, {wrong} wrong")
    return verdict(results)


if __name__ == "__main__":
    sys.exit(main())
