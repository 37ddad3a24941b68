"""Tests the wire encoding of shapes given by their measures, and the errors for wrong measures."""
import unittest

import numpy as np

from voxeld import InvalidArray, InvalidValue, measured
from voxeld.v1 import primitives_pb2 as pb


def parsed(shape: list) -> pb.Primitive:
    assert len(shape) == 1
    return pb.Primitive.FromString(shape[0].to_bytes())


class Measured(unittest.TestCase):
    def test_measures_come_through(self) -> None:
        ellipsoid = parsed(measured.ellipsoid((1, 2, 3), (4, 5, 6), color="red", fill="solid")).ellipsoid
        self.assertEqual((ellipsoid.center.y, ellipsoid.radii.z, ellipsoid.fill), (2, 6, pb.FILL_SOLID))
        torus = parsed(measured.torus((0, 0, 0), 0.5, 0.1, rule="cover", shell=2)).torus
        self.assertEqual((torus.radius, torus.tube_radius, torus.rule), (0.5, 0.1, pb.SURFACE_RULE_COVER))
        self.assertEqual((torus.shell.value, torus.shell.unit), (2, pb.Thickness.VOXELS))
        cone = parsed(measured.cone((0, 0, 0), (0, 0, 2), 1, 0.5, round_ends=True)).cone
        self.assertEqual((cone.end.z, cone.start_radius, cone.end_radius, cone.round_ends), (2, 1, 0.5, True))
        box = parsed(measured.parallelepiped((0, 0, 0), np.eye(3) * 2)).parallelepiped
        self.assertEqual((box.edge_a.x, box.edge_b.y, box.edge_c.z), (2, 2, 2))
        disc = parsed(measured.disc((0, 0, 0), 1, normal=(0, 1, 0), inner_radius=0.25, shell=0.1, unit="units")).disc
        self.assertEqual((disc.normal.y, disc.inner_radius, disc.shell.unit), (1, 0.25, pb.Thickness.UNITS))
        patch = parsed(measured.patch((1, 1, 1), [(1, 0, 0), (0, 1, 0)])).patch
        self.assertEqual((patch.corner.x, patch.edge_b.y), (1, 1))

    def test_surfaces_have_lines_and_dots(self) -> None:
        self.assertEqual(parsed(measured.disc((0, 0, 0), 1, fill="lines")).disc.fill, pb.FILL_LINES)
        self.assertEqual(parsed(measured.patch((0, 0, 0), np.eye(3)[:2], fill="dots")).patch.fill, pb.FILL_DOTS)
        self.assertEqual(parsed(measured.polygon(np.eye(3), fill="lines")).polygon.fill, pb.FILL_LINES)
        self.assertEqual(parsed(measured.height_map(np.zeros((2, 2)), fill="dots")).height_map.fill, pb.FILL_DOTS)
        thick = parsed(measured.height_map(np.zeros((2, 2)), shell=3, rule="cover")).height_map
        self.assertEqual((thick.shell.value, thick.shell.unit, thick.rule), (3, pb.Thickness.VOXELS, pb.SURFACE_RULE_COVER))

    def test_a_picture_lies_over_a_whole_height_map(self) -> None:
        self.assertEqual(parsed(measured.height_map(np.zeros((2, 2)), texture=b"file")).height_map.picture, b"file")
        with self.assertRaisesRegex(InvalidArray, "700 by 1000 are more than go at once"):
            measured.height_map(np.zeros((700, 1000)), texture=b"file")

    def test_curves_are_one_or_several(self) -> None:
        triangle = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
        one = parsed(measured.polygon(triangle)).polygon
        self.assertEqual((list(one.ends), len(one.points)), ([3], 9))
        two = parsed(measured.polygon([np.array(triangle) * 4, np.array(triangle + [(1, 1, 0)])])).polygon
        self.assertEqual((list(two.ends), two.points[3]), ([3, 7], 4))
        with self.assertRaisesRegex(InvalidArray, "a closed curve has 3 vertices at least, got 2"):
            measured.polygon(triangle[:2])

    def test_height_maps_come_in_pieces_with_a_row_in_common(self) -> None:
        heights = np.arange(12, dtype=np.float32).reshape(3, 4)
        whole = parsed(measured.height_map(heights, colors="red")).height_map
        self.assertEqual((whole.columns, whole.rows, whole.edge_b.y), (4, 3, 2))
        self.assertEqual(np.frombuffer(whole.heights, np.float32).tolist(), list(range(12)))
        colored = parsed(measured.height_map(heights, colors=heights, cmap="gray")).height_map
        self.assertEqual((colored.colors[:3], colored.colors[-3:]), (bytes(3), b"\xff" * 3))
        large = np.random.default_rng(2).random((700, 1000), np.float32)
        rows, last = [], None
        for piece in measured.height_map(large, corner=(0, 0, 5), edges=[(1, 0, 0), (0, 699, 0)]):
            self.assertLess(len(piece), 1 << 20)
            one = pb.Primitive.FromString(piece.to_bytes()).height_map
            samples = np.frombuffer(one.heights, np.float32).reshape(one.rows, one.columns)
            self.assertAlmostEqual(one.corner.y, len(rows) - 1 if rows else 0, places=9)
            self.assertAlmostEqual(one.edge_b.y, one.rows - 1, places=9)
            if last is not None:
                self.assertEqual(samples[0].tolist(), last.tolist())
            rows += list(samples[1:] if rows else samples)
            last = samples[-1]
        self.assertTrue(np.array_equal(np.array(rows), large))
        with self.assertRaisesRegex(InvalidArray, r"heights must be of shape \(rows, columns\)"):
            measured.height_map([1, 2, 3])

    def test_the_general_method(self) -> None:
        shape = parsed(measured.implicit("x^2+y^2 <= r", bound="z > 0", boundary=[(0, 0, 0), (1, 0, 0), (0, 1, 0)],
                                         boundary_axis="x", boundary_form="b-spline", parameters={"r": 2, "s": 3}, fill="surface", shell=1.5,
                                         domain=((-1, -1, -1), (1, 1, 1)), level="z", cmap="viridis")).implicit
        self.assertEqual((shape.surface.text, shape.bound.text, shape.level.text), ("x^2+y^2 <= r", "z > 0", "z"))
        self.assertEqual((shape.parameter_names, list(shape.parameter_values)), ("r s", [2, 3]))
        self.assertEqual((shape.boundary.axis, list(shape.boundary.ends)), (pb.Boundary.X, [3]))
        self.assertEqual(shape.boundary.form, pb.Boundary.B_SPLINE)
        self.assertEqual((shape.fill, shape.domain.max.z, shape.colormap), (pb.FILL_SURFACE, 1, "viridis"))
        colored = parsed(measured.implicit("x = 0", rgb=("x", "y", "z"))).implicit
        self.assertEqual((colored.red.text, colored.blue.text, colored.fill), ("x", "z", pb.FILL_UNSPECIFIED))

    def test_what_is_wrong_is_said(self) -> None:
        for wrong, words in (
                (lambda: measured.ellipsoid((0, 0, 0), (1, 0, 1)), "the radius along y must be greater than 0"),
                (lambda: measured.torus((0, 0, 0), 1, -1), "tube_radius must be greater than 0"),
                (lambda: measured.cone((0, 0), (0, 0, 1), 1, 0), "start must be three numbers"),
                (lambda: measured.parallelepiped((0, 0, 0), np.eye(3)[:2]), r"edges must be of shape \(3, 3\)"),
                (lambda: measured.disc((0, 0, 0), 1, rule="thick"), "rule is 'thick'; give one of 'thin', 'cover'"),
                (lambda: measured.implicit(""), "the surface is ''; give an expression"),
                (lambda: measured.implicit("x", level="y"), "each goes with the other"),
                (lambda: measured.implicit("x", rgb=("x", "y")), "rgb has 2 expressions"),
                (lambda: measured.implicit("x", parameters={"2a": 1}), "a parameter is called '2a'")):
            with self.subTest(words):
                with self.assertRaisesRegex((InvalidArray, InvalidValue), words):
                    wrong()


if __name__ == "__main__":
    unittest.main()
