import unittest
from typing import Any

import numpy as np

from voxeld import InvalidArray, InvalidColor, colors
from voxeld.color_names import NAMES, map_named, maps


class One(unittest.TestCase):
    def test_every_way_to_say_it(self) -> None:
        for value in ("orange", "Orange", "#ffa500", "#FFA500", "#ffa500ff", (255, 165, 0), (1.0, 165 / 255, 0.0),
                      np.array([255, 165, 0], np.uint8), (255, 165, 0, 7), np.array([1, 165 / 255, 0, 0.5], np.float32)):
            self.assertEqual(colors.one(value), 0xFFA500, value)
        self.assertEqual(colors.one("#f80"), 0xFF8800)
        self.assertEqual(colors.one("tab:orange"), 0xFF7F0E)

    def test_the_list_of_names_is_whole(self) -> None:
        # CSS has 148 with their spellings of grey; matplotlib's palette 10 and one more grey; 8 letters.
        self.assertEqual(len(NAMES), 148 + 11 + 8)
        for pair in ("gray", "darkgray", "dimgray", "lightgray", "slategray", "darkslategray", "lightslategray"):
            self.assertEqual(NAMES[pair], NAMES[pair.replace("gray", "grey")])
        self.assertTrue(all(0 <= rgb <= 0xFFFFFF for rgb in NAMES.values()))

    def refused(self, value: Any, *words: str) -> None:
        with self.assertRaises((InvalidColor, InvalidArray)) as caught:
            colors.one(value)
        for word in words:
            self.assertIn(word, str(caught.exception))

    def test_what_is_wrong_says_so(self) -> None:
        self.refused("oragne", "'oragne'", "'orange'")
        self.refused("#12345", "#rrggbb")
        self.refused((256, 0, 0), "0 to 255", "256")
        self.refused((1.5, 0.0, 0.0), "0 to 1")
        self.refused((1, 0, 0), "1.0")
        self.refused((float("nan"), 0.0, 0.0), "nan")
        self.refused((1, 2), "(2,)")


class Many(unittest.TestCase):
    def refused(self, value: Any, count: int, *words: str, **options: Any) -> None:
        with self.assertRaises((InvalidColor, InvalidArray)) as caught:
            colors.many(value, count, **options)
        for word in words:
            self.assertIn(word, str(caught.exception))

    def test_bytes_go_out_as_they_lie(self) -> None:
        for channels in (3, 4):
            given = np.arange(8 * channels, dtype=np.uint8).reshape(8, channels)
            got = colors.many(given, 8)
            self.assertTrue(np.shares_memory(given, got))

    def test_floats_are_rounded(self) -> None:
        got = colors.many(np.array([[0, 0.5, 1]] * 5), 5)
        np.testing.assert_array_equal(got, [[0, 128, 255]] * 5)

    def test_names(self) -> None:
        np.testing.assert_array_equal(colors.many(["red", "#00f"], 2), [[255, 0, 0], [0, 0, 255]])

    def test_one_for_all(self) -> None:
        self.assertEqual(colors.many("red", 9), 0xFF0000)
        self.assertEqual(colors.many((0.0, 1.0, 0.0), 9), 0x00FF00)
        self.assertIsNone(colors.many(None, 9))

    def test_maps_are_the_servers(self) -> None:
        self.assertGreater(len(maps()), 80)
        for name, stops in maps().items():
            ends = np.array([[c >> 16, c >> 8 & 255, c & 255] for c in (stops[0], stops[-1])])
            np.testing.assert_array_equal(colors.mapped([5, 7], name), ends)
            np.testing.assert_array_equal(colors.mapped([5, 7], name + "_r"), ends[::-1])
            self.assertEqual(map_named(name + "_r"), stops[::-1])
        steps = colors.mapped(np.linspace(0, 1, 256), "tab10")
        self.assertEqual(len(np.unique(steps, axis=0)), 10)
        np.testing.assert_allclose(colors.mapped([0.5], "viridis", 0, 1).astype(int), [[0x21, 0x91, 0x8C]], atol=1)
        for name in ("viridis_r_r", "_r", "sepia"):
            self.assertIsNone(map_named(name))

    def test_maps_of_ones_own_run_straight_from_stop_to_stop(self) -> None:
        got = colors.mapped([5, 5.5, 6, 7], ["#000000", "#ff8000", "#ffffff"])
        np.testing.assert_array_equal(got, [[0] * 3, [128, 64, 0], [255, 128, 0], [255] * 3])

    def test_maps_by_wrong_names_are_told_the_nearest(self) -> None:
        for wrong, hint in (("virdis", "'viridis'?"), ("Viridis_r", "'viridis_r'?"), ("sepia", "turned round, as viridis_r")):
            with self.assertRaises(InvalidColor) as caught:
                colors.mapped([0, 1], wrong)
            self.assertIn(hint, str(caught.exception))

    def test_maps_run_from_the_least_to_the_most(self) -> None:
        np.testing.assert_array_equal(colors.mapped([0, 0.5, 1], "gray"), [[0] * 3, [128] * 3, [255] * 3])
        np.testing.assert_array_equal(colors.mapped([-9, 9], "gray", 0, 1), [[0] * 3, [255] * 3])
        np.testing.assert_array_equal(colors.mapped([3, 3], "gray"), [[0] * 3] * 2)

    def test_what_is_wrong_says_so(self) -> None:
        self.refused(np.zeros((9, 3)), 8, "9 for 8")
        self.refused(np.zeros((3, 8)), 8, "did you mean .T?")
        self.refused(np.full((8, 3), 200.0), 8, "astype(np.uint8)")
        self.refused(np.zeros(8), 8, "cmap='viridis'")
        self.refused(["red"] * 7, 8, "7 names for 8")
        self.refused(np.zeros(7), 8, "(8,)", cmap="gray")
        self.refused(np.zeros(8), 8, "viridis", cmap="virids")
        self.refused(None, 8, "cmap", cmap="gray")


if __name__ == "__main__":
    unittest.main()
