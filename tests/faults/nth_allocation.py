#!/usr/bin/env python3
"""Makes every allocation of the daemon fail once: one allocation fails at each place that allocates memory, in the process and in third-party libraries,
in one of ten scenarios (scenarios.py) of the real voxeld, which is then restarted on the same state, undisturbed. A place is the four calls that
led to it; the list of places comes from lives in which nothing fails, and each place fails in the first scenario that reaches it.

usage: nth_allocation.py [--scenarios NAME,…] [--way once|forever] [--sample N] [--seed N] [--part K/N] [--within S] [--sites HEX,…] [--jobs N] [--list] [--json]

The ways to fail:
  once      one allocation fails (the default)
  forever   from then on every allocation fails

What must hold: where operator new fails, the daemon exits with 1 and one line that says why; where a C library's allocation fails, it survives, or exits like that, or
ends by the abort of a library. In each case nothing hangs, what was reported as shown is shown, what was reported as durable is there
after the next start, and a daemon that survives has no more descriptors and memory than an undisturbed one. Paths are in VOXELD, FAIL_MALLOC (the preloaded
library) and PYTHONPATH; exits with 1 if one of these does not hold.

Results, for each way to fail: lived, refused, ended, late, known, wrong as in nth_syscall.py; missed: no thread reached that place; once:
something was wrong, but not when the case was repeated, as happens on a machine that is busy with other things."""
import argparse
import collections
import json
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from apart import add_options, chosen, each, verdict
from life import Ending, Life, Rest, again, at_rest, descriptors, end, judge, leaks, sockets
from programs import program
from scenarios import SCENARIOS

# Libraries that may end the process when they run out of memory: by an abort, or because they do not check the result (fontconfig,
# OpenSSL).
GIVES_UP = re.compile(r"^(libfontconfig|libcrypto|libssl|libgrpc|libgrpc\+\+|libgpr|libabsl_\w+|libprotobuf|libupb|libtbb|libstdc\+\+|ld-linux-x86-64)[^ ]*\.so")
ENDED = "voxeld: out of memory, exiting"


@dataclass
class Place:
    site: str
    count: int
    stack: list[str]


@dataclass
class Result:
    scenario: str
    way: str
    site: str
    how: str  # lived, refused, ended, late, hung, crashed, missed, known: …
    stack: list[str]  # innermost first
    wrong: str = ""
    once: str = ""  # what was wrong the first time, but not when repeated
    failed: list[str] = field(default_factory=list)


def place_of(line: str) -> Place:
    site, count, *stack = line.split()
    return Place(site, int(count), stack)


def run(scenario: str, way: str, place: Place, rest: Rest) -> Result:
    with tempfile.TemporaryDirectory(prefix="voxeld-nth-") as name:
        life = SCENARIOS[scenario](Path(name))
        life.prepare()
        ours = sockets()
        told = Path(name, "told")
        process = life.start(environment={
            "LD_PRELOAD": os.environ["FAIL_MALLOC"], "FAIL_MALLOC_SITE": place.site, "FAIL_MALLOC_TOLD": str(told),
            "FAIL_MALLOC_TIMES": {"once": "1", "forever": "0"}[way]})
        is_ready, wrong = life.lived(process, lambda: process.pid)
        alive = process.poll() is None
        left = descriptors(process.pid, rest.descriptors, ours=ours)
        leak = leaks(life, rest) if alive and is_ready else ""
        status = end(process, process.pid)
        said = life.said()
        met = told.exists()
        stack = place_of(told.read_text(encoding="ascii")).stack if met else place.stack
        others = next((frame for frame in stack if not frame.startswith("libc.so")), "")
        gives_up = GIVES_UP.match(others)
        if way == "forever" and ENDED in said:
            gives_up = re.match("(anybody)", "anybody")  # which library allocates next is a matter of chance
        ending = judge(life, status, is_ready, alive, f"{gives_up[1]} asked, and gives up" if gives_up else "")
        if is_ready and status == 1 and ENDED in said:
            ending = Ending("ended")  # also when it is already exiting
        after = again(life)
        wrong = wrong or ending.wrong or after
        if not met:
            return Result(scenario, way, place.site, "missed", stack, wrong, failed=life.told.failed)
        if ending.how in ("ended", "refused") and status != 1:
            wrong = wrong or f"it ended with {status}"
        elif ending.how == "ended" and ENDED not in said:
            wrong = wrong or "it ended, and did not say that there was no memory"
        if ending.how == "lived" and left > rest.descriptors:
            wrong = wrong or f"{left} descriptors are left, of {rest.descriptors}"
        elif ending.how == "lived":
            wrong = wrong or leak
        return Result(scenario, way, place.site, ending.how, stack, wrong, failed=life.told.failed)


def run_twice(scenario: str, way: str, place: Place, rest: Rest) -> Result:
    """Repeats a case that went wrong. Only a repeated error counts: a machine that is busy with other things makes clients wait, too."""
    first = run(scenario, way, place, rest)
    if not first.wrong:
        return first
    second = run(scenario, way, place, rest)
    if second.wrong:
        second.wrong = f"{first.wrong}; and again: {second.wrong}"
    else:
        second.once = first.wrong
    return second


def places(scenario: str) -> tuple[str, list[Place], Rest]:
    """Returns the places that allocate memory in a life without failures, and what the daemon holds before its exit."""
    with tempfile.TemporaryDirectory(prefix="voxeld-nth-") as name:
        life = SCENARIOS[scenario](Path(name))
        life.prepare()
        process = life.start(environment={"LD_PRELOAD": os.environ["FAIL_MALLOC"], "FAIL_MALLOC_LIST": f"{name}/list"})
        is_ready, wrong = life.lived(process, lambda: process.pid)
        rest = at_rest(life, process.pid)
        status = end(process, process.pid)
        if not is_ready or wrong or not life.went_well() or status != 0:
            sys.exit(f"{scenario}: unharmed it failed: {wrong}{life.told}; it ended with {status}: {life.said()[-2000:]}")
        found = [place_of(line) for line in Path(name, "list").read_text(encoding="ascii").splitlines()]
        return scenario, sorted(found, key=lambda place: place.site), rest


def say(last: Result, at: int, of: int) -> None:
    wrong = f"; WRONG: {last.wrong}" if last.wrong else f"; once: {last.once}" if last.once else ""
    print(f"{at}/{of} {last.scenario} {last.way} {last.site} {' '.join(last.stack[:2])}: {last.how}{wrong}", file=sys.stderr, flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenarios", default=",".join(SCENARIOS), help="only these, by comma (default: all ten: %(default)s)")
    parser.add_argument("--way", choices=["once", "forever"], action="append", help="how it fails, as above; may be given more than once (default: once)")
    parser.add_argument("--sites", help="only these, by comma")
    add_options(parser)
    parser.add_argument("--list", action="store_true", help="say where memory is asked for, and end")
    options = parser.parse_args()
    scenarios = options.scenarios.split(",")
    if unknown := set(scenarios) - set(SCENARIOS):
        parser.error(f"no such scenarios: {', '.join(sorted(unknown))}; there are {', '.join(SCENARIOS)}")
    program("VOXELD", "the daemon")
    program("FAIL_MALLOC", "the library that makes allocations fail")
    found: dict[str, tuple[str, Place, Rest]] = {}
    counted = {scenario: (here, rest) for scenario, here, rest in each(places, [(scenario,) for scenario in scenarios], options.jobs)}
    for scenario in scenarios:
        here, rest = counted[scenario]
        new = [place for place in here if place.site not in found]
        found.update({place.site: (scenario, place, rest) for place in new})
        if options.list:
            for place in new:
                print(scenario, place.site, place.count, *place.stack)
            print(f"{scenario}: {len(here)} places, {len(new)} new, {sum(place.count for place in here)} allocations, {rest.descriptors} descriptors, {rest.heap} bytes")
    if options.list:
        return 0
    wanted = [found[site] for site in sorted(found) if not options.sites or site in options.sites.split(",")]
    cases = []
    for way in options.way or ["once"]:
        cases += [(scenario, way, place, rest) for scenario, place, rest in chosen(wanted, lambda each: each[1].site, options)]
    done = 0

    def tell(last: Result) -> None:
        nonlocal done
        done += 1
        if last.wrong or last.once or not options.json and (sys.stderr.isatty() or done % 50 == 0):
            say(last, done, len(cases))

    results = each(run_twice, cases, options.jobs, options.within, tell)
    if options.json:
        print(json.dumps([vars(result) for result in results]))
    else:
        table: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
        for result in results:
            table[result.way]["wrong" if result.wrong else result.how.split(":")[0]] += 1
            table[result.way]["once"] += bool(result.once)
        kinds = ("lived", "refused", "ended", "late", "known", "missed", "wrong", "once")
        print(f"{'way':<10}" + "".join(f"{kind:>9}" for kind in kinds))
        for way, counts in sorted(table.items()):
            print(f"{way:<10}" + "".join(f"{counts[kind]:>9}" for kind in kinds))
        print(f"{len(results)} cases of {len(found)} places, {len(cases) - len(results)} left, {sum(1 for result in results if result.wrong)} wrong")
    return verdict(results)


if __name__ == "__main__":
    sys.exit(main())
