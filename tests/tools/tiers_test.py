#!/usr/bin/env python3
"""Compares tests/tiers.tsv with this build: it lists each test once, with its tier, and no test that does not exist."""

import json
import os
import subprocess
import sys
import unittest

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
BUILD = os.environ["VOXELD_BUILD"]


def rows():
    with open(os.path.join(ROOT, "tests", "tiers.tsv"), encoding="utf-8") as file:
        return [line.rstrip("\n").split("\t") for line in file][1:]


class TiersTest(unittest.TestCase):
    def test_each_name_stands_there_once(self):
        names = [row[0] for row in rows()]
        self.assertEqual(sorted(set(names)), sorted(names))

    def test_every_test_of_this_build_is_listed_with_its_tier(self):
        listed = subprocess.run([sys.executable, "-B", os.path.join(ROOT, "tools", "tiers.py"), BUILD, "--json"],
                                capture_output=True, text=True, check=True)
        tests = json.loads(listed.stdout)
        self.assertGreater(len(tests), 100)
        tiers = {row[0]: row[2] for row in rows()}
        wrong = []
        for test in tests:
            name = test["test"]
            tier = tiers.get(name)
            if tier is None:
                wrong.append(f"{name} is not listed")
            elif not any(part.startswith(test["tier"] + ":") for part in tier.split(", ")):
                wrong.append(f"{name} is listed as {tier!r}, and runs in the tier {test['tier']}")
        self.assertEqual(wrong, [])

    def test_no_listed_test_is_missing(self):
        listed = subprocess.run([sys.executable, "-B", os.path.join(ROOT, "tools", "tiers.py"), BUILD, "--json"],
                                capture_output=True, text=True, check=True)
        names = {test["test"] for test in json.loads(listed.stdout)}
        with open(os.path.join(BUILD, "CMakeCache.txt"), encoding="utf-8") as file:
            cache = file.read()
        # A machine may have no GPU, and may lack the libraries of optional parts.
        absent = ["gpu."]
        if "ROSCPP_FOUND:INTERNAL=1" not in cache:
            absent += ["e2e.ros", "ros_"]
        missing = [row[0] for row in rows()
                   if row[2].startswith(("default: test", "deep: long")) and row[0] not in names and not row[0].startswith(tuple(absent))]
        self.assertEqual(missing, [])


if __name__ == "__main__":
    unittest.main()
