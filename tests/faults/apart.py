"""Runs many lives at a time, each with a client process of its own: state that gRPC keeps for one server would disturb the next one."""
import argparse
import concurrent.futures
import multiprocessing as mp
import sys
import threading
import time
import zlib
from multiprocessing.connection import Connection
from typing import Any, Callable, Iterable, Protocol, Sequence, TypeVar

Case = TypeVar("Case", bound=tuple[Any, ...])
Result = TypeVar("Result")

_CONTEXT = mp.get_context("forkserver")
_CONTEXT.set_forkserver_preload(["numpy", "voxeld"])  # read once from the folders in PYTHONPATH
_STARTING = threading.Lock()


def positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"it is {text}; give a number from 1 on")
    return int(text)


def _part(text: str) -> str:
    part, _, parts = text.partition("/")
    if not part.isdecimal() or not parts.isdecimal() or not 1 <= int(part) <= int(parts):
        raise argparse.ArgumentTypeError(f"it is {text}; give K/N, the K-th of N parts, as 1/3")
    return text


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--sample", type=positive, default=0, help="so many of all, by chance (default: all)")
    parser.add_argument("--seed", type=int, default=1, help="of that chance (default: %(default)s)")
    parser.add_argument("--part", type=_part, default="1/1", help="of all that are wanted the K-th of N parts, as K/N: 1/1 is all")
    parser.add_argument("--within", type=float, default=0, help="seconds after which none is begun any more; how many are left is told. 0: any number")
    parser.add_argument("--jobs", type=positive, default=1, help="so many lives at a time")
    parser.add_argument("--json", action="store_true", help="what came of each as JSON, on standard output")


def chosen(cases: Sequence[Case], key: Callable[[Case], object], options: argparse.Namespace) -> list[Case]:
    """Returns the cases that the options select, in random order, so that the cases that are left out resemble those that are run. The
    position of a
    case, and the part that it belongs to, depend only on its key and the seed; adding or removing other cases does not change them."""
    part, parts = (int(number) for number in options.part.split("/"))

    def place(case: Case) -> int:
        return zlib.crc32(f"{options.seed} {key(case)!r}".encode())

    drawn = sorted(cases, key=place)[:options.sample or len(cases)]
    return [case for case in drawn if place(case) % parts == part - 1]


class Judged(Protocol):
    how: str
    wrong: str


def verdict(results: Sequence[Judged]) -> int:
    """Returns the program's exit status: 1 if a result is wrong, or if no case had a failure."""
    if any(result.wrong for result in results):
        return 1
    if all(result.how == "missed" for result in results):
        print("nothing failed in any case, so that none says anything", file=sys.stderr)
        return 1
    return 0


def _send(pipe: Connection, run: Callable[..., Any], case: tuple[Any, ...]) -> None:
    pipe.send(run(*case))


def _apart(run: Callable[..., Result], case: tuple[Any, ...]) -> Result:
    """Returns the result of one case. If the process ends without a result while its case is being set up (for example because another life
    has taken
    its port), the case is run again."""
    for last in (False, True):
        here, there = _CONTEXT.Pipe(duplex=False)
        process = _CONTEXT.Process(target=_send, args=(there, run, case))
        with _STARTING:
            process.start()
        there.close()
        try:
            result: Result = here.recv()
            return result
        except EOFError:
            process.join()
            print(f"{run.__name__}{case} ended with {process.exitcode}", file=sys.stderr)
            if last:
                raise SystemExit(1) from None
        finally:
            process.join()
    raise AssertionError


def each(run: Callable[..., Result], cases: Iterable[tuple[Any, ...]], jobs: int, within: float = 0, tell: Callable[[Result], None] = lambda result: None) -> list[Result]:
    """Calls run(*case) for each case, in order, as far as `jobs` at a time allow, and calls `tell` for each result as it arrives."""
    ends = time.monotonic() + within if within else float("inf")
    left = iter(cases)
    results: list[Result] = []
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        waiting: set["concurrent.futures.Future[Result]"] = set()
        while True:
            while len(waiting) < jobs and time.monotonic() < ends and (case := next(left, None)) is not None:
                waiting.add(pool.submit(_apart, run, case))
            if not waiting:
                return results
            done, waiting = concurrent.futures.wait(waiting, return_when=concurrent.futures.FIRST_COMPLETED)
            for one in done:
                results.append(one.result())
                tell(results[-1])
