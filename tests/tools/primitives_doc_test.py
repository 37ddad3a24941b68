#!/usr/bin/env python3
"""Tests that tools/primitives_doc.py states the unit and the default of every field, and leaves out no guarantee."""

import os
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "..", "tools"))
import primitives_doc as doc  # noqa: E402

FILL = [("unspecified", "SURFACE"), ("surface", ""), ("solid", ""), ("lines", "its edges")]


def row(kind, name, said):
    return doc.table("Shape", [(kind, name, said)], {"Fill": FILL})[1]


class PrimitivesDocTest(unittest.TestCase):
    def test_brackets_say_unit_and_default(self):
        self.assertEqual(row("double", "radius", "> 0 [length; needed]"), "| `radius` | double | length | needed | > 0 |")
        self.assertEqual(row("Vec3", "at", "[length; 0, 0, 0]"), "| `at` | Vec3 | length | 0, 0, 0 |  |")

    def test_types_say_theirs(self):
        self.assertEqual(row("Thickness", "shell", ""),
                         "| `shell` | Thickness | voxels or length | 0: one voxel | how thick the surface is |")
        self.assertEqual(row("Fill", "fill", ""), "| `fill` | Fill | – | `surface` | `surface`, `solid` or `lines` |")

    def test_only_what_a_field_takes_is_named(self):
        self.assertEqual(row("Fill", "fill", "not SOLID; LINES: rows"), "| `fill` | Fill | – | `surface` | `surface` or `lines`; LINES: rows |")
        self.assertEqual(row("Fill", "fill", "SURFACE or SOLID [–; by what it is]"),
                         "| `fill` | Fill | – | by what it is | `surface` or `solid` |")

    def test_a_field_that_says_neither_is_an_error(self):
        with self.assertRaises(SystemExit) as caught:
            row("double", "radius", "> 0")
        self.assertIn("Shape.radius says no unit and default", str(caught.exception))

    def test_guarantees_are_told_by_themselves(self):
        self.assertEqual(doc.paragraphs("A box.\n\nGuarantee: its volume\nis right.\n\nMore."), ("A box.\n\nMore.", "Its volume is right."))

    def test_every_shape_has_a_section_with_its_guarantee_and_pictures(self):
        sections = doc.page().split("\n## ")[1:]
        shapes = [field for _, field in doc.kinds()]
        self.assertEqual([section.split("\n")[0] for section in sections[:len(shapes)]], shapes)
        for section in sections[:len(shapes)]:
            self.assertEqual(section.count("**Guarantee**"), 1, section)
            self.assertGreater(section.count("](images/primitives/"), 0, section)

    def test_a_picture_that_is_missing_is_an_error(self):
        self.assertEqual(doc.picture("points, soft"), "![points, soft](images/primitives/points-soft.png)")
        with self.assertRaises(SystemExit):
            doc.picture("points, none such")


if __name__ == "__main__":
    unittest.main()
