#!/usr/bin/env python3
"""Checks that tests/tiers.tsv lists each test of this build (of the stage VOXELD_STAGE) once, with its tier, and lists no test that does
not exist."""

import json
import os
import re
import subprocess
import sys
import unittest

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
BUILD = os.environ["VOXELD_BUILD"]
STAGE = os.environ["VOXELD_STAGE"]


def rows():
    with open(os.path.join(ROOT, "tests", "tiers.tsv"), encoding="utf-8") as file:
        return [line.rstrip("\n").split("\t") for line in file][1:]


class TiersTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        listed = subprocess.run([sys.executable, "-B", os.path.join(ROOT, "tools", "tiers.py"), BUILD, "--json"],
                                capture_output=True, text=True, check=True)
        # The stage package runs only the tests with its label.
        cls.tests = {test["test"]: test["tier"] for test in json.loads(listed.stdout) if STAGE != "package" or "package" in test["labels"]}
        with open(os.path.join(BUILD, "CMakeCache.txt"), encoding="utf-8") as file:
            cls.cache = file.read()
        cls.long = "VOXELD_LONG_TESTS:BOOL=ON" in cls.cache

    def is_listed(self, test, places):
        """Returns: whether `places`, such as "default: test" or "deep: asan", include the stage in which this build runs the test."""
        if STAGE == "package":
            return "deep: package" in places or "full: package" in places
        if STAGE == "test":
            return ("default: test" if self.tests[test] == "default" else "deep: long") in places
        # The full tier runs more tests under a sanitizer than the list says.
        return f"deep: {STAGE}" in places or (self.long and bool(places))

    def test_each_name_stands_there_once(self):
        names = [row[0] for row in rows()]
        self.assertEqual(sorted(set(names)), sorted(names))

    def test_every_test_of_this_build_is_listed_with_its_tier(self):
        self.assertGreater(len(self.tests), 3)
        places = {row[0]: re.findall(r"(?:default|deep|full): \w+", row[2]) for row in rows()}
        wrong = [name for name in self.tests if not self.is_listed(name, places.get(name, []))]
        self.assertEqual(wrong, [], "not listed, or with another tier")

    def test_no_listed_test_is_missing(self):
        # A machine may have no GPU, and may lack the libraries of optional parts.
        absent = ["gpu."]
        if "ROSCPP_FOUND:INTERNAL=1" not in self.cache:
            absent += ["e2e.ros", "ros_"]
        if os.geteuid() != 0:
            absent += ["e2e.booted", "e2e.installed"]
        here = ("default: test", "deep: long") if STAGE == "test" else (f"deep: {STAGE}",)
        missing = [row[0] for row in rows() if any(place in row[2] for place in here)
                   and row[0] not in self.tests and not row[0].startswith(tuple(absent))]
        self.assertEqual(missing, [])


if __name__ == "__main__":
    unittest.main()
