#!/usr/bin/env python3
"""Runs two builds of a Google Benchmark program alternately, and prints the ratio of the second's CPU time to the first's.

    tools/bench/in_turns.py build/plain/bin/voxel-assemble-bench build/release/bin/voxel-assemble-bench --turns 9 --filter '/1/'

A ratio compares two consecutive runs (each goes first every other time), so other load on the machine affects both. The median of the
ratios is printed with quartiles. CPU time is used instead of wall time: for benchmarks with one thread it measures their own work.
"""
import argparse
import json
import statistics
import subprocess


def times(program, options):
    """Returns: {benchmark: nanoseconds of CPU time per iteration}."""
    ran = subprocess.run([program, "--benchmark_format=json", f"--benchmark_filter={options.filter}", f"--benchmark_min_time={options.min_time}"],
                         capture_output=True, text=True, check=True)
    factors = {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9}
    return {one["name"]: one["cpu_time"] * factors[one["time_unit"]] for one in json.loads(ran.stdout)["benchmarks"]}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("without")
    parser.add_argument("with_", metavar="with")
    parser.add_argument("--turns", type=int, default=9)
    parser.add_argument("--filter", default=".")
    parser.add_argument("--min-time", default="0.2")
    options = parser.parse_args()
    ratios, first = {}, {}
    for turn in range(options.turns):
        order = [options.without, options.with_]
        results = {program: times(program, options) for program in (order if turn % 2 == 0 else order[::-1])}
        for name, before in results[options.without].items():
            ratios.setdefault(name, []).append(results[options.with_][name] / before)
            first.setdefault(name, []).append(before)
    for name, those in ratios.items():
        low, middle, high = statistics.quantiles(those, n=4) if len(those) > 1 else those * 3
        print(f"{name:40} {statistics.median(first[name]) / 1e6:10.2f} ms   with / without {statistics.median(those):.3f} ({low:.3f} to {high:.3f})")


if __name__ == "__main__":
    main()
