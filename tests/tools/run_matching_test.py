#!/usr/bin/env python3
"""Tests which programs tools/run_matching.py builds for a pattern. The project has two tests, none of which has been built."""

import os
import re
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "tools"))
import run_matching  # noqa: E402

PROJECT = """
cmake_minimum_required(VERSION 3.25)
project(two LANGUAGES CXX)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin/tests)
enable_testing()
add_subdirectory(tests)
"""
TESTS = """
add_executable(one_test one_test.cc)
add_executable(host two.cc)
add_executable(guest two.cc)
add_executable(apart two.cc)
set_target_properties(apart PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/elsewhere)
add_test(NAME script.runs_apart COMMAND sh script $<TARGET_FILE:apart>)
add_test(NAME script.installs COMMAND sh script ${CMAKE_BINARY_DIR})
add_test(NAME script.by_environment COMMAND sh script)
set_tests_properties(script.by_environment PROPERTIES ENVIRONMENT "PROGRAMS=$<TARGET_FILE:apart>:$<TARGET_FILE:guest>;FOLDER=${CMAKE_BINARY_DIR}/tests")
add_test(NAME one_test COMMAND one_test --gtest_filter=*)
add_test(NAME host.runs_guest COMMAND host $<TARGET_FILE:guest>)
set_tests_properties(host.runs_guest PROPERTIES LABELS deep)
"""


class RunMatchingTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        files = {"CMakeLists.txt": PROJECT, "tests/CMakeLists.txt": TESTS, "tests/two.cc": "int main() {}",
                 "tests/one_test.cc": "TEST(Lamp, Lights) {}\nTEST_F(LampTest,\n       GoesOut) {}"}
        os.mkdir(os.path.join(folder.name, "tests"))
        for name, text in files.items():
            with open(os.path.join(folder.name, name), "w", encoding="utf-8") as file:
                file.write(text)
        cls.build = os.path.join(folder.name, "build")
        subprocess.run(["cmake", "-G", "Ninja", "-S", folder.name, "-B", cls.build], check=True, capture_output=True)

    def targets(self, pattern):
        tests = [test for test in run_matching.tests_of(self.build) if re.search(pattern, test["name"])]
        return run_matching.targets_of(self.build, tests)

    def test_programs_that_were_never_built_are_built(self):
        self.assertEqual(self.targets("^one_test$"), ["bin/tests/one_test"])
        self.assertEqual(self.targets("runs_guest"), ["bin/tests/guest", "bin/tests/host"])
        self.assertEqual(self.targets("one|host"), ["bin/tests/guest", "bin/tests/host", "bin/tests/one_test"])

    def test_programs_outside_of_bin_are_built(self):
        self.assertEqual(self.targets("runs_apart"), ["elsewhere/apart"])
        self.assertEqual(self.targets("by_environment"), ["bin/tests/guest", "elsewhere/apart"])

    def test_what_uses_the_whole_build_has_all_built(self):
        self.assertEqual(self.targets("installs"), ["all"])
        self.assertEqual(self.targets("."), ["all"])

    def test_cases_are_found_in_the_sources(self):
        self.assertEqual(run_matching.programs_with(self.build, re.compile("Lamp")),
                         {"one_test": {"Lamp.Lights", "LampTest.GoesOut"}})
        self.assertEqual(run_matching.programs_with(self.build, re.compile("Candle")), {})

    def test_is_deep_finds_tests_labelled_deep(self):
        tests = run_matching.tests_of(self.build)
        self.assertEqual([test["name"] for test in tests if run_matching.is_deep(test)], ["host.runs_guest"])


if __name__ == "__main__":
    unittest.main()
