"""Tests the clip shape of a layer on the wire."""
import unittest

from voxeld import ClipBox, ClipCylinder, InvalidArray, InvalidValue, clip, translate


class ClipTest(unittest.TestCase):
    def test_parts_of_every_kind_are_kept_apart(self) -> None:
        message = clip.to_wire([(0, 0, 1, -2), ClipBox((1, 2, 3), (4, 5, 6)),
                                ClipCylinder((0, 0, -1), (0, 0, 1), 2.5), (1, 0, 0, 0)])
        self.assertEqual([(p.a, p.b, p.c, p.d) for p in message.planes], [(0, 0, 1, -2), (1, 0, 0, 0)])
        box, = message.boxes
        self.assertEqual((box.center.y, box.size.z), (2, 6))
        self.assertFalse(box.HasField("transform"))
        cylinder, = message.cylinders
        self.assertEqual((cylinder.start.z, cylinder.end.z, cylinder.radius), (-1, 1, 2.5))

    def test_a_box_has_a_transform(self) -> None:
        box, = clip.to_wire([ClipBox(transform=translate(1, 2, 3))]).boxes
        self.assertEqual(list(box.transform.m), [1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3])

    def test_without_parts_there_is_none_any_more(self) -> None:
        self.assertEqual(clip.to_wire([]).ByteSize(), 0)

    def test_what_is_no_part_is_refused(self) -> None:
        for bad in [(1, 2, 3), "plane", ClipBox(size=(1, 2)), ClipCylinder((0, 0, 0), (0, 0, 1), -1),
                    ClipCylinder((0, 0, 0), (0, float("nan"), 1), 1)]:
            with self.assertRaises((InvalidArray, InvalidValue), msg=repr(bad)):
                clip.to_wire([bad])  # type: ignore[list-item]


if __name__ == "__main__":
    unittest.main()
