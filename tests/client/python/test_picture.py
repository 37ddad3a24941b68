import os
import struct
import tempfile
import unittest
import zlib
from typing import Any

import numpy as np

from voxeld import Volume, VoxelError, picture
from voxeld.v1 import display_pb2 as pb
from voxeld.v1 import types_pb2


def decode_png(data: bytes) -> Any:
    """An independent reader for the writer's output."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, chunks = 8, {}
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        assert struct.unpack(">I", data[at + 8 + size:at + 12 + size])[0] == zlib.crc32(kind + body)
        chunks[kind] = body
        at += 12 + size
    width, height, depth, kind, *rest = struct.unpack(">IIBBBBB", chunks[b"IHDR"])
    assert (depth, kind, rest) == (8, 2, [0, 0, 0])
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, 1 + 3 * width)
    assert not rows[:, 0].any() and list(chunks)[-1] == b"IEND"
    return rows[:, 1:].reshape(height, width, 3)


def header(slices: int, width: int, height: int, **shape: Any) -> pb.VolumeHeader:
    grid = pb.VoxelGrid(nx=width, ny=height, nz=slices, pitch_mm=types_pb2.Vec3(x=1, y=1, z=1),
                        origin_mm=types_pb2.Vec3(x=-width / 2, y=-height / 2, z=-slices / 2))
    return pb.VolumeHeader(volume=7, display="d", layout=pb.FrameLayout(slices=slices, width=width, height=height),
                           geometry=pb.Geometry(grid=grid, **shape))


class Png(unittest.TestCase):
    def test_it_reads_back(self) -> None:
        rgb = np.random.default_rng(1).integers(0, 256, (5, 7, 3), dtype=np.uint8)
        np.testing.assert_array_equal(decode_png(picture.png(rgb)), rgb)


class Places(unittest.TestCase):
    def lit(self, head: pb.VolumeHeader, s: int, v: int, u: int) -> list[float]:
        rgb = np.zeros((head.layout.slices, head.layout.height, head.layout.width, 3), np.uint8)
        rgb[s, v, u] = (1, 2, 3)
        at, colors = Volume(head, rgb).points()
        np.testing.assert_array_equal(colors, [[1, 2, 3]])
        result: list[float] = np.round(at[0], 9).tolist()
        return result

    def test_planar_stacks(self) -> None:
        stack = pb.PlanarStack(width_px=4, height_px=2, pitch_u_mm=1, pitch_v_mm=2, positions_mm=[-5, 0, 5])
        self.assertEqual(self.lit(header(3, 4, 2, planar_stack=stack), 2, 1, 0), [-1.5, 1, 5])
        stack.normal, stack.mirror_u = pb.PlanarStack.Y, True
        self.assertEqual(self.lit(header(3, 4, 2, planar_stack=stack), 0, 0, 0), [1.5, -5, -1])

    def test_rotors(self) -> None:
        panel = pb.Rotor.Panel(pitch_u_mm=1, pitch_v_mm=1, eccentricity_mm=2, phase_turns=0.25)
        rotor = pb.Rotor(slices_per_turn=4, width_px=4, height_px=2, panels=[pb.Rotor.Panel(pitch_u_mm=1, pitch_v_mm=1), panel])
        self.assertEqual(self.lit(header(8, 4, 2, rotor=rotor), 0, 1, 3), [1.5, 0, 0.5])
        self.assertEqual(self.lit(header(8, 4, 2, rotor=rotor), 2, 1, 3), [0, 1.5, 0.5])   # a quarter turn further
        self.assertEqual(self.lit(header(8, 4, 2, rotor=rotor), 1, 0, 3), [-2, 1.5, -0.5])  # u along y, off along −x
        rotor.clockwise = True
        self.assertEqual(self.lit(header(8, 4, 2, rotor=rotor), 2, 1, 3), [0, -1.5, 0.5])

    def test_lattices(self) -> None:
        lattice = pb.Lattice(width_px=2, slices=2, pixels=[0, 3], x_mm=[1, 2], y_mm=[3, 4], z_mm=[5, 6])
        self.assertEqual(self.lit(header(2, 2, 1, lattice=lattice), 1, 0, 1), [2, 4, 6])


class Chunks(unittest.TestCase):
    def test_slices_go_where_they_belong(self) -> None:
        head = header(4, 3, 2, planar_stack=pb.PlanarStack())
        rgb = np.random.default_rng(2).integers(0, 256, (4, 2, 3, 3), dtype=np.uint8)
        parts = [(0, 1), (1, 4)]
        chunks = [pb.VolumeChunk(header=head)] + [
            pb.VolumeChunk(slices=pb.VolumeSlices(first_slice=a, rgb=rgb[a:b].tobytes())) for a, b in parts]
        np.testing.assert_array_equal(Volume.of(chunks).rgb, rgb)
        with self.assertRaises(VoxelError):
            Volume.of(chunks[1:])


class Splat(unittest.TestCase):
    CORNERS = np.array([[x, y, z] for x in (-8.0, 8.0) for y in (-8.0, 8.0) for z in (-8.0, 8.0)])

    def seen(self, at: Any, azimuth: float, elevation: float) -> Any:
        colors = np.array([[200, 0, 0]] * len(at), np.uint8)
        image = picture.splat(np.array(at, float), colors, self.CORNERS, 1, 101, 101, azimuth, elevation)
        y, x = np.nonzero(image[..., 0] > 120)
        return x.mean() - 50, 50 - y.mean()

    def test_from_the_front_x_is_right_and_z_up(self) -> None:
        x, y = self.seen([[4, 0, 6]], 0, 0)
        self.assertGreater(x, 10)
        self.assertGreater(y, x)

    def test_from_the_side_y_is_right(self) -> None:
        x, _ = self.seen([[0, 5, 0]], 90, 0)
        self.assertGreater(x, 10)

    def test_from_above_y_is_up(self) -> None:
        _, y = self.seen([[0, 5, 0]], 0, 90)
        self.assertGreater(y, 10)

    def test_nothing_lit_is_the_box_alone(self) -> None:
        image = picture.splat(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), self.CORNERS, 1, 64, 64, 30, 30)
        self.assertEqual(set(np.unique(image)), {picture.BACKGROUND, picture.EDGE})

    def test_a_saved_picture_is_the_picture(self) -> None:
        stack = pb.PlanarStack(width_px=4, height_px=4, pitch_u_mm=1, pitch_v_mm=1, positions_mm=[-1.5, -0.5, 0.5, 1.5])
        volume = Volume(header(4, 4, 4, planar_stack=stack), np.full((4, 4, 4, 3), 90, np.uint8))
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "a.png")
            volume.save_png(path, 64, 48)
            with open(path, "rb") as file:
                np.testing.assert_array_equal(decode_png(file.read()), volume.picture(64, 48))
        self.assertEqual(volume.lit, 64)


if __name__ == "__main__":
    unittest.main()
