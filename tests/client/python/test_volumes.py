import unittest
from typing import Any

import numpy as np

from voxeld import VoxelError
from voxeld.v1 import display_pb2 as pb
from voxeld.volumes import Volume


def header(slices: int, width: int, height: int) -> pb.VolumeHeader:
    result = pb.VolumeHeader(volume=1, display="d")
    result.layout.slices, result.layout.width, result.layout.height = slices, width, height
    return result


def points(head: pb.VolumeHeader, *lit: tuple[int, int, int]) -> Any:
    rgb = np.zeros((head.layout.slices, head.layout.height, head.layout.width, 3), np.uint8)
    for s, v, u in lit:
        rgb[s, v, u] = 255
    return Volume(head, rgb).points()[0]


class Points(unittest.TestCase):
    def stack(self) -> pb.VolumeHeader:
        head = header(2, 4, 2)
        stack = head.geometry.planar_stack
        stack.width_px, stack.height_px, stack.pitch_u_mm, stack.pitch_v_mm = 4, 2, 1, 2
        stack.positions_mm[:] = [-1, 3]
        return head

    def test_stacks(self) -> None:
        np.testing.assert_allclose(points(self.stack(), (1, 1, 0)), [[-1.5, 1, 3]])

    def test_corrections(self) -> None:
        head = self.stack()
        correction = head.geometry.correction
        correction.affine[:] = [0, -1, 0, 10, 1, 0, 0, 20, 0, 0, 2, 30]
        np.testing.assert_allclose(points(head, (1, 1, 0)), [[9, 18.5, 36]])
        correction.homographies[:] = [2, 0, 1, 0, 2, 0, 0, 0, 2]
        np.testing.assert_allclose(points(head, (1, 1, 0)), [[9, 19, 36]])
        del correction.affine[:]
        del correction.homographies[:]
        grid = correction.displacement
        grid.nx = grid.ny = grid.nz = 2
        grid.low_mm.x = grid.low_mm.y = grid.low_mm.z = -4
        grid.high_mm.x = grid.high_mm.y = grid.high_mm.z = 4
        grid.at_mm[:] = [0, 0, 0, 1, 0, 0] * 4
        np.testing.assert_allclose(points(head, (1, 1, 0)), [[-1.5 + 2.5 / 8, 1, 3]])

    def test_rotors_with_a_tilt(self) -> None:
        head = header(4, 2, 2)
        rotor = head.geometry.rotor
        rotor.slices_per_turn, rotor.width_px, rotor.height_px = 4, 2, 2
        rotor.panels.add(pitch_u_mm=2, pitch_v_mm=2, eccentricity_mm=3, tilt_deg=30)
        # A quarter turn further: u is along y, the eccentricity along −x.
        np.testing.assert_allclose(points(head, (1, 1, 1)), [[-3.5, 1, np.cos(np.pi / 6)]], atol=1e-6)

    def test_helices(self) -> None:
        head = header(4, 4, 4)
        helix = head.geometry.helix
        helix.slices_per_turn, helix.width_px, helix.height_px = 4, 4, 4
        helix.pitch_u_mm = helix.pitch_v_mm = helix.span_turns = helix.blades = 1
        helix.height_mm, helix.radius_mm = 8, 5
        # At 45° from where the blade begins, it has risen by an eighth; in the next slice, a quarter turn later, it is an eighth below the
        # top.
        np.testing.assert_allclose(points(head, (0, 2, 2)), [[0.5, 0.5, -3]])
        np.testing.assert_allclose(points(head, (1, 2, 2)), [[0.5, 0.5, 3]])
        helix.left_handed = True
        np.testing.assert_allclose(points(head, (1, 2, 2)), [[0.5, 0.5, -3]])

    def test_what_is_not_known_is_said(self) -> None:
        with self.assertRaises(VoxelError):
            points(header(1, 1, 1), (0, 0, 0))


if __name__ == "__main__":
    unittest.main()
