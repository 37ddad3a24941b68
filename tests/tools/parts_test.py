#!/usr/bin/env python3
"""Tests that optional parts (cmake/VoxeldParts.cmake) can be added one after the other with the commands that voxelctl prints."""

import json
import re
import subprocess
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PARTS = ("IMPORTERS", "RECORDING", "LIGHTS", "MARKERS", "ROS", "BENCH", "PYTHON_CLIENT")
PROJECT = f"cmake_minimum_required(VERSION 3.25)\nproject(parts NONE)\ninclude({ROOT}/cmake/VoxeldParts.cmake)\n"


def variables_of(preset: str) -> dict[str, str]:
    """Returns: the cache variables of a configure preset, inherited ones included."""
    presets = {each["name"]: each for each in json.loads((ROOT / "CMakePresets.json").read_text(encoding="utf-8"))["configurePresets"]}
    variables = dict(presets[preset].get("cacheVariables", {}))
    if "inherits" in presets[preset]:
        variables = variables_of(presets[preset]["inherits"]) | variables
    return variables


class Parts(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        (self.folder / "CMakeLists.txt").write_text(PROJECT, encoding="utf-8")

    def configure(self, preset: str, *options: str) -> set[str]:
        """Returns: the parts that are on after configuring as `cmake --preset PRESET OPTIONS` does."""
        of_preset = [f"-D{name}={value}" for name, value in variables_of(preset).items() if name.startswith("VOXELD_")]
        subprocess.run(["cmake", "-S", self.folder, "-B", self.folder / "build", *of_preset, *options], check=True, capture_output=True)
        cache = (self.folder / "build/CMakeCache.txt").read_text(encoding="utf-8")
        return {name for name in PARTS if re.search(rf"^VOXELD_{name}:BOOL=ON$", cache, re.MULTILINE)}

    def test_demo_leaves_them_out(self) -> None:
        self.assertEqual(self.configure("demo"), set())

    def test_a_part_stays_when_another_is_added(self) -> None:
        self.assertEqual(self.configure("demo", "-DVOXELD_IMPORTERS=ON"), {"IMPORTERS"})
        self.assertEqual(self.configure("demo", "-DVOXELD_RECORDING=ON"), {"IMPORTERS", "RECORDING"})
        self.assertEqual(self.configure("demo"), {"IMPORTERS", "RECORDING"})
        self.assertEqual(self.configure("demo", "-DVOXELD_IMPORTERS=OFF"), {"RECORDING"})

    def test_other_builds_have_them(self) -> None:
        self.assertEqual(self.configure("release"), set(PARTS))


if __name__ == "__main__":
    unittest.main()
