#!/usr/bin/env python3
"""Tests which files tools/analyze.py compiles after headers have changed, and with which options."""

import os
import sys
import unittest

sys.dont_write_bytecode = True
ROOT = os.path.realpath(os.path.join(os.path.dirname(__file__), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "tools"))
import analyze  # noqa: E402


class AnalyzeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        os.chdir(ROOT)

    def test_headers_that_include_a_changed_one_are_affected(self):
        included_by = {"a.h": ["b.h", "a.cc"], "b.h": ["c.h", "tests/small_stack.h"], "c.h": ["b.h"]}
        self.assertEqual(analyze.affected(["a.h", "x.cc"], included_by), ["a.h", "b.h", "c.h", "tests/small_stack.h"])

    def test_a_header_with_a_source_of_its_name_is_compiled_by_it(self):
        self.assertEqual(analyze.affected(["common/text/printable.h"], {}), ["common/text/printable.cc"])

    def test_includers_are_found_as_the_compiler_finds_headers(self):
        included_by = analyze.includers()
        self.assertIn("common/text/printable.cc", included_by["common/text/printable.h"])
        self.assertIn("display/drivers/voxlink/firmware/voxlink_device.c", included_by["display/drivers/voxlink/firmware/voxlink_parts.h"])
        self.assertIn("client/cpp/src/client.cc", included_by["client/cpp/voxeld/client.h"])

    def test_a_header_gets_the_options_of_the_nearest_source(self):
        source = os.path.realpath("common/text/printable.cc")
        entry = {"file": source, "directory": "/build", "command": f"/usr/bin/clang++-16 -DA -o x.o -c {source}"}
        found = analyze.header_entry("common/toml/parse_toml.h", {"common/toml/parse_toml.h": ["y.h", "z.cu"], "y.h": ["common/text/printable.cc"]},
                                     {source: entry})
        self.assertEqual(analyze.analysis_command("syntax", "", "", found)[:2], ["/usr/bin/clang++-16", "-DA"])
        self.assertEqual(found["command"].split()[-3:], ["-x", "c++", os.path.realpath("common/toml/parse_toml.h")])
        self.assertIsNone(analyze.header_entry("y.h", {}, {source: entry}))

    def test_a_file_that_no_source_includes_is_a_finding(self):
        self.assertIn("not part of the build", analyze.run("syntax", "", "common/toml/parse_toml.h", {}))
        self.assertEqual(analyze.run("syntax", "", "gpu/cuda/draw-inl.h", {}), "")


if __name__ == "__main__":
    unittest.main()
