#!/usr/bin/env python3
"""Builds and runs the tests whose names match a pattern.

usage: run_matching.py BUILD PATTERN [--jobs N]
PATTERN is a regular expression. It is compared with the names of ctest's tests (core_test, e2e.draw); where none matches, with the
names of GoogleTest's cases (CoreEngine.EngineTimeout). Exit status 1 if a test fails or nothing matches.
"""

import argparse
import json
import os
import re
import subprocess
import sys

CASE = re.compile(r"^\s*(?:TYPED_)?TEST(?:_F|_P)?\(\s*(\w+)\s*,\s*(\w+)\s*\)", re.MULTILINE)
ADDED = re.compile(r"^add_test\(\[=\[(.*?)\]=\] (.*)\)$", re.MULTILINE)


def commands_of(build):
    """Returns: the command of each test by the test's name, from the files that CMake writes for ctest."""
    commands = {}
    for folder, _, names in os.walk(build):
        if "CTestTestfile.cmake" in names:
            with open(os.path.join(folder, "CTestTestfile.cmake"), encoding="utf-8") as file:
                commands.update((name, re.findall('"(.*?)"', words)) for name, words in ADDED.findall(file.read()))
    return commands


def tests_of(build):
    listed = subprocess.run(["ctest", "--test-dir", build, "--show-only=json-v1"], capture_output=True, text=True, check=True)
    tests = json.loads(listed.stdout)["tests"]
    # ctest leaves out the command of a test whose program has not been built yet.
    if any("command" not in test for test in tests):
        commands = commands_of(build)
        for test in tests:
            test.setdefault("command", commands.get(test["name"], []))
    return tests


def is_deep(test):
    """Returns whether the test needs what only tools/setup --dev installs."""
    return any(entry["name"] == "LABELS" and "deep" in entry["value"] for entry in test.get("properties", []))


def exactly(tests):
    """Returns: a ctest regular expression that matches exactly these tests; ctest's syntax differs from Python's."""
    return "^(" + "|".join(re.sub(r"([^A-Za-z0-9_])", r"[\1]", test["name"]) for test in tests) + ")$"


def outputs_of(build):
    """Returns: the paths, relative to `build`, of all files that the build makes."""
    listed = subprocess.run(["ninja", "-C", build, "-t", "targets", "all"], capture_output=True, text=True, check=True)
    return {line.rsplit(": ", 1)[0] for line in listed.stdout.splitlines()}


def targets_of(build, tests):
    """Returns: the files to build: all that the tests' commands and environments name, or "all" if one is given the build folder itself."""
    outputs = outputs_of(build)
    programs = os.path.realpath(build)
    targets = set()
    for test in tests:
        words = test.get("command", [])
        properties = {entry["name"]: entry["value"] for entry in test.get("properties", [])}
        words = words + [word for setting in properties.get("ENVIRONMENT", []) for word in re.split(r"[=:]", setting)]
        for word in words:
            path = os.path.realpath(word)
            if path == programs:
                return ["all"]
            path = os.path.relpath(path, programs)
            if path in outputs:
                targets.add(path)
    return sorted(targets)


def programs_with(build, case_pattern):
    """Returns: test programs by the names of the cases in their sources, with the cases that match."""
    with open(os.path.join(build, "compile_commands.json"), encoding="utf-8") as file:
        entries = json.load(file)
    programs = {}
    for entry in entries:
        # The tests' own sources; CMake 3.25 names the object only in the command.
        target = re.search(r" -o tests/\S*CMakeFiles/(\w+)\.dir/", entry["command"])
        if target is None:
            continue
        paths = [entry["file"]]
        if "/Unity/" in entry["file"] and os.path.exists(entry["file"]):
            with open(entry["file"], encoding="utf-8") as file:
                paths = re.findall(r'#include "([^"]+)"', file.read())
        for path in paths:
            if not os.path.exists(path) or not path.endswith(".cc"):
                continue
            with open(path, encoding="utf-8") as file:
                names = [".".join(found) for found in CASE.findall(file.read())]
            matching = [name for name in names if case_pattern.search(name)]
            if matching:
                programs.setdefault(target.group(1), set()).update(matching)
    return programs


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build")
    parser.add_argument("pattern")
    parser.add_argument("--jobs", default="1")
    arguments = parser.parse_args()
    try:
        pattern = re.compile(arguments.pattern)
    except re.error as error:
        print(f"tools/test: '{arguments.pattern}' is not a valid regular expression: {error}", file=sys.stderr)
        return 2

    def make(targets):
        return subprocess.run(["cmake", "--build", arguments.build, "-j", arguments.jobs, "--target", *targets], check=False).returncode

    tests = [test for test in tests_of(arguments.build) if pattern.search(test["name"])]
    if tests:
        if any(is_deep(test) for test in tests):
            here = os.path.dirname(os.path.abspath(__file__))
            if subprocess.run([os.path.join(here, "setup"), "--dev"], check=False).returncode != 0:
                print("tools/test: warning: tests of the deep tier may fail or be skipped, because tools/setup --dev failed", file=sys.stderr)
        targets = targets_of(arguments.build, tests)
        if targets and make(targets) != 0:
            return 1
        command = ["ctest", "--test-dir", arguments.build, "-j", arguments.jobs, "-R", exactly(tests), "--output-on-failure", "--no-tests=error"]
        return 1 if subprocess.run(command, check=False).returncode else 0

    programs = programs_with(arguments.build, pattern)
    if not programs:
        print(f"tools/test: no ctest test and no GoogleTest case matches '{arguments.pattern}'; to list the tests: tools/test --list", file=sys.stderr)
        return 1
    # Some cases are compiled into an object library that several test programs link; it is not a program itself.
    runnable = {test["command"][0] for test in tests_of(arguments.build) if test.get("command")}
    runnable = {os.path.basename(path): path for path in runnable}
    named = {name: cases for name, cases in programs.items() if name in runnable}
    status = 0
    if len(named) < len(programs):
        shared = ", ".join(sorted(programs.keys() - named.keys()))
        print(f"tools/test: '{arguments.pattern}' also matches GoogleTest cases in {shared}, which several test programs link and which are not"
              " run here; run a program by name, for example: tools/test conformance", file=sys.stderr)
        status = 1
    if named and make(sorted(named)) != 0:
        return 1
    for name, cases in sorted(named.items()):
        # The full names of value-parameterised and typed cases have a prefix or a suffix.
        wanted = ":".join(f"{case}:*/{case}/*:{case.split('.')[0]}/*.{case.split('.')[1]}:*/{case.split('.')[0]}/*.{case.split('.')[1]}"
                          for case in sorted(cases))
        folder = os.path.dirname(runnable[name])
        listed = subprocess.run([runnable[name], f"--gtest_filter={wanted}", "--gtest_list_tests"], cwd=folder, capture_output=True, text=True,
                                check=False)
        # A case is indented; other lines are its suite, or come from GoogleTest.
        if not re.search(r"^  \S", listed.stdout, re.MULTILINE):
            print(f"tools/test: {name} has none of the cases {', '.join(sorted(cases))}, which its sources name", file=sys.stderr)
            status = 1
            continue
        status |= subprocess.run([runnable[name], f"--gtest_filter={wanted}"], cwd=folder, check=False).returncode
    return 1 if status else 0


if __name__ == "__main__":
    sys.exit(main())
