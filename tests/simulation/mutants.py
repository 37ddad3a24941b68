#!/usr/bin/env python3
"""Plants each of the defects of tests/simulation/mutants.patch in a copy of the tree, one at a time, and has the simulation look for it.

    tests/simulation/mutants.py [--scratch DIR] [--seeds N] [--jobs N] [--json FILE] [NAME …]
    tests/simulation/mutants.py --check     only whether each still fits the tree, and builds nothing

NAME selects the defects whose names contain it; without one, all are planted. A copy of the tree is built in DIR (build/mutants), by the
preset "test". Prints a table: the defect, the first seed that finds it, what was found wrong. Exits with 0 if all were
found.
"""
import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent


def read_defects(names):
    """Returns the defects whose names contain one of `names` (all, if `names` is empty): {name: patch}."""
    defects = {}
    for section in (HERE / "mutants.patch").read_text(encoding="utf-8").split("Defect: ")[1:]:
        name, patch = section.split("\n", 1)
        if not names or any(wanted in name for wanted in names):
            defects[name] = patch
    return defects


def run(command, **options):
    return subprocess.run(command, check=True, **options)


def copy_tree(source):
    """Copies the files of the working tree that git tracks or would track; files that have not changed keep their times."""
    names = run(["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True).stdout.split("\n")
    wanted = {name for name in names if name and (ROOT / name).is_file()}
    for name in wanted:
        new, old = ROOT / name, source / name
        if old.is_file() and old.read_bytes() == new.read_bytes():
            continue
        old.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(new, old)
    for old in source.rglob("*"):
        name = str(old.relative_to(source))
        if old.is_file() and not name.startswith("build/") and name not in wanted:
            old.unlink()
    # The files that the build has fetched, if any.
    data = source / "build" / "data"
    if (ROOT / "build" / "data").exists() and not data.exists():
        data.parent.mkdir(exist_ok=True)
        data.symlink_to((ROOT / "build" / "data").resolve())


def configure(source, build):
    if (build / "build.ninja").exists():
        return
    run(["cmake", "--preset", "test", "-B", build], cwd=source,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def build_simulation(source, build, jobs):
    environment = dict(os.environ, CCACHE_BASEDIR=str(source), CCACHE_NOHASHDIR="1")
    done = subprocess.run(["ninja", "-C", build, f"-j{jobs}", "simulation"], env=environment, capture_output=True,
                          text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"the tree does not build:\n{done.stdout[-3000:]}")


def simulate(build, seeds, jobs):
    """Returns the first seed in which something is wrong, and the error; None: no seed finds one."""
    done = subprocess.run([build / "bin/tests/simulation", "--seeds", f"1..{seeds}", "--jobs", str(jobs), "--quiet", "--json"],
                          capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        return {"seed": 0, "wrong": f"the program ended with {done.returncode}: {done.stderr[-200:]}"}
    failures = json.loads(done.stdout)["failures"]
    return min(failures, key=lambda failure: failure["seed"]) if failures else None


def main():
    parser = argparse.ArgumentParser(description="Plants defects and has the simulation find them.")
    parser.add_argument("--scratch", type=pathlib.Path, default=ROOT / "build" / "mutants")
    parser.add_argument("--seeds", type=int, default=20000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("names", nargs="*")
    options = parser.parse_args()
    source, build = options.scratch.resolve(), options.scratch.resolve() / "build" / "test"
    patches = read_defects(options.names)
    if not patches:
        sys.exit(f"no defect in {HERE / 'mutants.patch'} is called {' or '.join(options.names)}")
    if options.check:
        unfit = [name for name, patch in patches.items()
                 if subprocess.run(["git", "apply", "--check"], input=patch, text=True, cwd=ROOT, check=False).returncode != 0]
        print(f"{len(patches) - len(unfit)} of {len(patches)} fit{': not ' if unfit else ''}{', '.join(unfit)}")
        return 1 if unfit or len(patches) < 20 and not options.names else 0
    copy_tree(source)
    configure(source, build)
    build_simulation(source, build, options.jobs)
    print(f"| defect | seeds until found | what was wrong |\n|---|---|---|", flush=True)
    results = []
    for name, patch in patches.items():
        begun = time.monotonic()
        run(["patch", "-p1", "--quiet"], input=patch, text=True, cwd=source)
        try:
            build_simulation(source, build, options.jobs)
            found = simulate(build, options.seeds, options.jobs)
        finally:
            run(["patch", "-p1", "--quiet", "-R"], input=patch, text=True, cwd=source)
        results.append({"defect": name, "found": found, "seconds": round(time.monotonic() - begun, 1)})
        seed, wrong = (found["seed"], found["wrong"]) if found else ("**none**", f"nothing in {options.seeds} seeds")
        print(f"| {name} | {seed} | {wrong} |", flush=True)
    if options.json:
        options.json.write_text(json.dumps(results, indent=1) + "\n")
    missed = [result["defect"] for result in results if result["found"] is None]
    print(f"{len(results) - len(missed)} of {len(results)} found", flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
