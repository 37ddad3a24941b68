#!/usr/bin/env python3
"""Every n-th system call of the daemon failed once: strace makes one call fail in each thread, in an otherwise ordinary life of the real voxeld
(start; drawing with receipts; a durable commit; captures and watched volumes; the page, metrics and health; an asset;
reloading; the end), and then it is started again on the same state, unharmed.

usage: nth_syscall.py [--calls NAME,…] [--most N] [--sample N] [--seed N] [--jobs N] [--list] [--json]

What must hold: no signal ends the daemon, nothing hangs, a start that fails says why, what was told to be shown is shown, what was told to be
durable is there after the next start, whoever comes afterwards is served, no descriptor is left, and the daemon ends by itself when asked. Paths are in VOXELD and PYTHONPATH; ends with 1 if one did not."""
import argparse
import collections
import concurrent.futures
import contextlib
import json
import multiprocessing
import random
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from life import Life, again, descriptors, end, judge, refuses
from programs import program

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

# Without them libraries use a pipe, which is one descriptor more.
A_PIPE_INSTEAD = ("eventfd2", "epoll_ctl")
# Seconds after which a client gives up a connection on which nobody answers, and it is closed at both ends.
GIVES_UP = 40.0
# Where others decide what becomes of the process when they are refused memory, threads or descriptors.
THEIRS = re.compile(r"/(libgrpc|libgrpc\+\+|libgpr|ld-linux-x86-64|libsqlite3|libtbb)[^/]*\.so")


@dataclass
class Result:
    call: str
    error: str
    n: int
    how: str  # lived, missed, refused, ended, late, known: …
    wrong: str = ""
    failed: list[str] = field(default_factory=list)


def pid_of(tracer: "subprocess.Popen[str]") -> int:
    """The daemon beneath its tracer."""
    with contextlib.suppress(OSError, ValueError):
        return int(Path(f"/proc/{tracer.pid}/task/{tracer.pid}/children").read_text(encoding="ascii").split()[0])
    return 0


def whose(trace: str) -> str:
    """The library of others that made the call that failed first, by its stack; empty: it was our own."""
    at = trace.find("(INJECTED)")
    stack = re.match(r"\n((?: > .*\n)*)", trace[at + len("(INJECTED)"):]) if at >= 0 else None
    found = THEIRS.search(stack[1]) if stack else None
    return found[1] if found else ""


def run(call: str, error: str, n: int, most_descriptors: int, stacks: bool = False) -> Result:
    """With `stacks`, much slower, what others' code does when it is refused is told from what ours does."""
    with tempfile.TemporaryDirectory(prefix="voxeld-nth-") as name:
        life = Life(Path(name))
        tracer = life.start("strace", "-f", "-qq", *(["-k"] if stacks else []), "--seccomp-bpf", "-o", f"{name}/trace", "-e", f"trace={call}",
                            *(["-P", f"{name}/output"] if call == "write" else []),  # what else is written to this way are events, which cannot fail
                            "-e", f"inject={call}:error={error}:when={n}", "-e", "signal=none")
        is_ready, wrong = life.lived(tracer, lambda: pid_of(tracer))
        alive = tracer.poll() is None
        if alive and is_ready:
            wrong = wrong or refuses(life)
            most = most_descriptors + (call in A_PIPE_INSTEAD)
            left = descriptors(life.pid, most, GIVES_UP)
            if left > most:
                wrong = wrong or f"{left} descriptors are left, of {most}"
        status = end(tracer, life.pid)
        trace = Path(name, "trace").read_text(encoding="utf-8", errors="replace")
        theirs = whose(trace) if stacks else ""
        ending = judge(life, status, is_ready, alive, f"{theirs} asked, and gives up" if theirs else "")
        after = again(Path(name), life.told)
        wrong = wrong or ending.wrong or after
        missed = ending.how == "lived" and "(INJECTED)" not in trace  # no thread made so many of these calls this time
        return Result(call, error, n, "missed" if missed else ending.how, wrong, life.told.failed)


def run_or_excuse(call: str, error: str, n: int, most_descriptors: int) -> Result:
    """What ends it by a signal, or hangs, is made again with stacks: others' code may have decided so. If not, the first time counts."""
    first = run(call, error, n, most_descriptors)
    if first.how not in ("crashed", "hung"):
        return first
    second = run(call, error, n, most_descriptors, stacks=True)
    return second if second.how.startswith("known") or second.wrong else first


def count() -> tuple[dict[str, int], int]:
    """How often a thread calls each at the most, and how many descriptors there are before the end."""
    with tempfile.TemporaryDirectory(prefix="voxeld-nth-") as name:
        life = Life(Path(name))
        tracer = life.start("strace", "-f", "-qq", "-o", f"{name}/trace", "-e", f"trace={','.join(ERRORS)}", "-e", "signal=none")
        if not life.ready(tracer):
            sys.exit(f"voxeld does not start: {life.said()}")
        life.pid = pid_of(tracer)
        life.live()
        if life.told.failed or not life.told.shown or not life.told.durable or refuses(life):
            sys.exit(f"unharmed it failed: {life.told}")
        rest = descriptors(life.pid, 0)  # what it comes down to
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
        return most, rest


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calls", help="only these, by comma")
    parser.add_argument("--most", type=int, default=1 << 30, help="of each call the first so many")
    parser.add_argument("--sample", type=int, default=0, help="so many of all, by chance")
    parser.add_argument("--seed", type=int, default=1, help="of that chance (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=1, help="so many lives at a time")
    parser.add_argument("--list", action="store_true", help="say how often each is called, and how many cases that makes, and end")
    parser.add_argument("--json", action="store_true", help="what came of each as JSON, on standard output")
    options = parser.parse_args()
    unknown = set(options.calls.split(",")) - set(ERRORS) if options.calls else set()
    if unknown:
        parser.error(f"no such calls: {', '.join(sorted(unknown))}; there are {', '.join(sorted(ERRORS))}")
    program("VOXELD", "the daemon")
    counted, most_descriptors = count()
    wanted = options.calls.split(",") if options.calls else sorted(counted)
    cases = [(call, error, n) for call in wanted for error in ERRORS[call] for n in range(1, min(counted.get(call, 0), options.most) + 1)]
    if options.list:
        print("\n".join(f"{call} {counted.get(call, 0)}" for call in wanted))
        print(f"{len(cases)} cases")
        return 0
    if options.sample:
        cases = random.Random(options.seed).sample(cases, min(options.sample, len(cases)))
    results = []
    # Each life has a client's process of its own: what gRPC keeps of one server would be in the next one's way.
    with concurrent.futures.ProcessPoolExecutor(options.jobs, multiprocessing.get_context("spawn"), max_tasks_per_child=1) as jobs:
        for i, last in enumerate(jobs.map(run_or_excuse, *zip(*cases), [most_descriptors] * len(cases))):
            results.append(last)
            if last.wrong or not options.json and (sys.stderr.isatty() or i % 50 == 49):
                print(f"{i + 1}/{len(cases)} {last.call} {last.error} {last.n}: {last.how}{'; WRONG: ' + last.wrong if last.wrong else ''}", file=sys.stderr, flush=True)
    if options.json:
        print(json.dumps([vars(result) for result in results]))
    else:
        table: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
        for result in results:
            table[result.call]["wrong" if result.wrong else result.how.split(":")[0]] += 1
        print(f"{'call':<18}{'lived':>7}{'missed':>8}{'refused':>9}{'ended':>7}{'late':>7}{'known':>7}{'wrong':>7}")
        for call, kinds in sorted(table.items()):
            print(f"{call:<18}" + "".join(f"{kinds[kind]:>{width}}" for kind, width in (("lived", 7), ("missed", 8), ("refused", 9), ("ended", 7), ("late", 7), ("known", 7), ("wrong", 7))))
        wrong = sum(1 for result in results if result.wrong)
        print(f"{len(results)} cases, {wrong} wrong")
    return 1 if any(result.wrong for result in results) else 0


if __name__ == "__main__":
    sys.exit(main())
