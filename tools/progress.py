#!/usr/bin/env python3
"""Shows a build's progress: reads what ninja prints, with NINJA_STATUS='@ %f %t ', and shows the share of steps that are done and an
estimate of the time that is left. In a terminal this is one line that is rewritten; otherwise a line every ten seconds.

usage: ninja ... 2>&1 | tools/progress.py LOG    (LOG receives everything that was read)
"""
import re
import select
import sys
import time

STEP = re.compile(rb"@ (\d+) (\d+) (.*)")
EVERY_S = 10.0  # between permanent lines
FIRST_ESTIMATE = 0.03  # The first steps are short: an estimate from them alone would be far too low.


def left(elapsed_s: float, done: int, total: int) -> str:
    if done < 2 or done < total * FIRST_ESTIMATE or elapsed_s < 5:
        return "estimating the time left"
    seconds = elapsed_s * (total - done) / done
    return f"about {seconds / 60:.0f} min left" if seconds >= 90 else f"about {max(5, 5 * round(seconds / 5)):.0f} s left"


def main() -> None:
    live = sys.stdout.isatty()
    begin = shown = time.monotonic()
    done = total = 0
    step = ""
    pending = b""
    with open(sys.argv[1], "ab") as log:
        while True:
            ready, _, _ = select.select([sys.stdin], [], [], 1.0)
            if ready:
                chunk = sys.stdin.buffer.raw.read(65536)
                if not chunk:
                    break
                log.write(chunk)
                log.flush()
                *lines, pending = (pending + chunk).split(b"\n")
                for line in lines:
                    if match := STEP.match(line):
                        done, total = int(match[1]), int(match[2])
                        step = match[3].decode(errors="replace").rsplit("/", 1)[-1]
            now = time.monotonic()
            if not total or now - shown < (0.2 if live else EVERY_S):
                continue
            shown = now
            text = f"build: step {done} of {total}, {int(now - begin)} s, {left(now - begin, done, total)}"
            print(f"\r{text}  {step[:40]}\033[K" if live else text, end="" if live else "\n", flush=True)
    if live and total:
        print("\r\033[K", end="")
    if total:
        print(f"build: {done} of {total} steps in {time.monotonic() - begin:.0f} s", flush=True)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:  # the build also received it and ends itself
        sys.exit(130)
