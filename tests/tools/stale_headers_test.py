#!/usr/bin/env python3
"""Tests that tools/stale_headers.py removes precompiled headers that Ninja considers current although a header in them was upgraded."""

import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

TOOL = Path(__file__).resolve().parents[2] / "tools/stale_headers.py"
RULES = """rule precompile
  command = cat {header} >$out && echo '$out: {header}' >$out.d
  depfile = $out.d
  deps = gcc
build headers/a.hxx.pch: precompile
build headers/b.hxx.pch: precompile
"""


class StaleHeaders(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.header = Path(folder.name, "system/a.h")
        self.build = Path(folder.name, "build")
        self.precompiled = [self.build / f"headers/{name}.hxx.pch" for name in "ab"]
        self.header.parent.mkdir()
        self.build.mkdir()
        (self.build / "build.ninja").write_text(RULES.format(header=self.header), encoding="utf-8")
        self.install("first")
        self.make()

    def install(self, text: str) -> None:
        """Installs a file as dpkg does: it is replaced, and keeps the time at which its package was made."""
        new = self.header.with_suffix(".new")
        new.write_text(text, encoding="utf-8")
        os.utime(new, (1_500_000_000, 1_500_000_000))
        new.rename(self.header)

    def make(self) -> None:
        subprocess.run(["ninja", "-C", self.build], check=True, capture_output=True)

    def run_tool(self) -> str:
        return subprocess.run([sys.executable, "-B", TOOL, self.build], check=True, capture_output=True, text=True).stdout

    def test_nothing_happens_while_no_header_has_changed(self) -> None:
        self.assertEqual(self.run_tool(), "")
        self.assertTrue(all(path.exists() for path in self.precompiled))

    def test_an_upgraded_header_has_them_made_again(self) -> None:
        self.install("second")
        self.make()
        self.assertEqual(self.precompiled[0].read_text(encoding="utf-8"), "first")  # Ninja alone does not notice
        self.assertIn("headers/a.hxx.pch is stale and will be rebuilt", self.run_tool())
        self.make()
        self.assertEqual([path.read_text(encoding="utf-8") for path in self.precompiled], ["second", "second"])

    def test_a_header_that_has_gone_has_them_made_again(self) -> None:
        self.header.unlink()
        self.run_tool()
        self.assertFalse(any(path.exists() for path in self.precompiled))

    def test_a_folder_without_a_build_is_left_alone(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([sys.executable, "-B", TOOL, folder], check=False, capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "", ""))


if __name__ == "__main__":
    unittest.main()
