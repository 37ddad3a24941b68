"""Tests the wire encoding of curves, arrows, text, frames, splats and gradients, and the errors for wrong arguments."""
import unittest

import numpy as np

import voxeld as voxel
from voxeld import InvalidArray, InvalidColor, InvalidValue, curves, grids, measured, shapes
from voxeld.v1 import primitives_pb2 as pb


def parsed(shape: list) -> pb.Primitive:
    assert len(shape) == 1
    return pb.Primitive.FromString(shape[0].to_bytes())


LINE = np.arange(12, dtype=np.float32).reshape(4, 3)


class Curves(unittest.TestCase):
    def test_curves_come_through(self) -> None:
        curve = parsed(curves.curve(LINE, form="b-spline", closed=True, colors=["red"] * 4, width=2, sampling="cover")).curve
        self.assertEqual((curve.form, curve.closed, curve.thickness.value), (pb.Curve.B_SPLINE, True, 2))
        self.assertEqual((curve.vertices.count, curve.sampling), (4, pb.LINE_SAMPLING_COVER))
        self.assertEqual(curve.vertices.colors[:3], b"\xff\0\0")
        self.assertEqual(np.frombuffer(curve.vertices.positions, np.float32).tolist(), list(range(12)))
        arc = parsed(curves.arc((1, 2, 3), 4, normal=(1, 0, 0), toward=(0, 1, 0), start=0.5, sweep=-1, color="red")).arc
        self.assertEqual((arc.radius, arc.toward.y, arc.start, arc.sweep), (4, 1, 0.5, -1))
        self.assertFalse(parsed(curves.arc((0, 0, 0), 1)).arc.HasField("toward"))
        ellipse = parsed(curves.ellipse((0, 0, 0), (2, 0, 0), (0, 1, 0))).ellipse
        self.assertEqual((ellipse.axis_a.x, ellipse.axis_b.y, ellipse.sweep), (2, 1, 0))
        helix = parsed(curves.helix((0, 0, 0), (0, 0, 3), 1, -2, end_radius=0, width=1)).helix
        self.assertEqual((helix.end.z, helix.turns, helix.HasField("end_radius")), (3, -2, True))
        thick = parsed(curves.bezier_surface(np.zeros((4, 4, 3)), shell=2)).bezier_surface
        self.assertEqual(thick.shell.value, 2)
        surface = parsed(curves.bezier_surface(np.zeros((2, 4, 4, 3)))).bezier_surface
        self.assertEqual(surface.vertices.count, 32)
        arrow = parsed(curves.arrow((0, 0, 0), (1, 0, 0), head_length=0.5, fill="solid")).arrow
        self.assertEqual((arrow.end.x, arrow.head_length, arrow.fill), (1, 0.5, pb.FILL_SOLID))

    def test_what_is_wrong_with_curves_is_said(self) -> None:
        with self.assertRaisesRegex(InvalidArray, "points: got 5; a bezier curve takes 1 and 3 for each span"):
            curves.curve(np.zeros((5, 3)), form="bezier")
        with self.assertRaisesRegex(InvalidArray, "points: got 2; a closed catmull-rom curve takes 3 or more"):
            curves.curve(np.zeros((2, 3)), closed=True)
        self.assertEqual(len(curves.curve(np.zeros((7, 3)), form="bezier")), 1)
        self.assertEqual(len(curves.curve(np.zeros((4, 3)), form="quadratic", closed=True)), 1)
        with self.assertRaisesRegex(InvalidValue, "sweep is 7"):
            curves.arc((0, 0, 0), 1, sweep=7)
        with self.assertRaisesRegex(InvalidValue, "turns is 0"):
            curves.helix((0, 0, 0), (0, 0, 1), 1, 0)
        with self.assertRaisesRegex(InvalidArray, r"patches must be of shape \(4, 4, 3\)"):
            curves.bezier_surface(np.zeros((4, 3)))

    def test_text(self) -> None:
        text = parsed(curves.text("Größe\nΩ", (1, 2, 3), 0.5, facing=(0, -1, 0), up=(0, 0, 1), style="outline", align="right",
                                  wrap=4, font="serif", width=2)).text
        self.assertEqual((text.text, text.height, text.facing.y, text.up.z), ("Größe\nΩ", 0.5, -1, 1))
        self.assertEqual((text.style, text.alignment, text.width), (pb.Text.OUTLINE, pb.Text.RIGHT, 4))
        self.assertEqual((text.font, text.thickness.value), ("serif", 2))
        with self.assertRaisesRegex(InvalidValue, "style is 'bold'; give one of 'filled', 'outline', 'strokes'"):
            curves.text("a", (0, 0, 0), 1, style="bold")

    def test_frames_and_splats(self) -> None:
        self.assertEqual(parsed(shapes.box((0, 0, 0), 1, fill="lines")).box.fill, pb.FILL_LINES)
        self.assertEqual(parsed(shapes.mesh(np.zeros((3, 3)), fill="dots")).mesh.fill, pb.FILL_DOTS)
        self.assertEqual(parsed(shapes.points(LINE, width=3, splat="soft")).points.splat, pb.Points.SOFT)
        self.assertEqual(parsed(shapes.points(LINE, splat="cell")).points.splat, pb.Points.CELL)
        self.assertEqual(parsed(shapes.instance("o", tint="red")).instance.tint.rgb, 0xFF0000)

    def test_gradients(self) -> None:
        by = voxel.Gradient(["black", "white"], along=(1, 0, 0), low=0, high=6)
        colors = parsed(shapes.points(LINE, colors=by)).points.vertices.colors  # x is 0, 3, 6 and 9
        self.assertEqual([colors[i] for i in (0, 3, 6, 9)], [0, 128, 255, 255])
        self.assertEqual(parsed(curves.curve(LINE, colors=by)).curve.vertices.colors, colors)
        scale = parsed(measured.torus((0, 0, 0), 1, 0.2, color=by)).color_scale
        self.assertEqual((list(scale.colors), scale.along.x, scale.high), ([0, 0xFFFFFF], 1, 6))
        self.assertEqual(parsed(measured.torus((0, 0, 0), 1, 0.2, color=voxel.Gradient())).color_scale.colormap, "viridis")
        with self.assertRaisesRegex(InvalidColor, "a gradient's along is 0"):
            shapes.points(LINE, colors=voxel.Gradient(along=(0, 0, 0)))
        with self.assertRaisesRegex(InvalidColor, "tint is a gradient; one colour is right here"):
            shapes.instance("o", tint=by)

    def test_grids(self) -> None:
        field = np.arange(24, dtype=np.uint16).reshape(2, 3, 4)
        shape = parsed(grids.grid(field, values=[0, 10, 23], colors=["black", "red", "white"], opacities=[0, 0.5, 1],
                                  filter="nearest")).volume
        self.assertEqual((shape.grid.size_a, shape.grid.size_b, shape.grid.size_c), (2, 3, 4))
        self.assertEqual((shape.grid.type, shape.grid.filter), (pb.ELEMENT_TYPE_U16, pb.Grid.NEAREST))
        samples = np.frombuffer(shape.grid.samples, np.uint16)
        self.assertEqual(samples[:3].tolist(), [field[0, 0, 0], field[1, 0, 0], field[0, 1, 0]])
        self.assertEqual((shape.grid.corner.x, shape.grid.edge_c.z), (-0.5, 2))
        self.assertEqual((list(shape.transfer.values), list(shape.transfer.colors)), ([0, 10, 23], [0, 0xFF0000, 0xFFFFFF]))
        colored = parsed(grids.grid(np.zeros((2, 2, 2, 4), np.uint8))).volume
        self.assertEqual((colored.grid.type, len(colored.grid.samples)), (pb.ELEMENT_TYPE_RGBA8, 32))
        scaled = parsed(grids.isosurface(field, 11.5, color=voxel.Gradient("plasma", along=(0, 1, 0)))).color_scale
        self.assertEqual((scaled.colormap, scaled.along.y), ("plasma", 1))
        surface = parsed(grids.isosurface(field.astype(float), 11.5, fill="solid", extent=((0, 0, 0), (1, 2, 3)))).isosurface
        self.assertEqual((surface.level, surface.fill, surface.grid.edge_b.y), (11.5, pb.FILL_SOLID, 2))
        self.assertEqual(surface.grid.type, pb.ELEMENT_TYPE_F32)
        with self.assertRaisesRegex(InvalidArray, r"array must be of shape \(nx, ny, nz\)"):
            grids.isosurface([1, 2, 3], 1)
        with self.assertRaisesRegex(InvalidArray, "more than the 1073741824 that go at once"):
            grids.grid(np.broadcast_to(np.uint8(0), (1100, 1100, 1100)))  # which takes no memory
        with self.assertRaisesRegex(InvalidValue, "colors has 1 for 2 values"):
            grids.grid(field, values=[0, 1], colors=["red"])
        with self.assertRaisesRegex(InvalidValue, "give these as well"):
            grids.grid(field, cmap="jet")


if __name__ == "__main__":
    unittest.main()
