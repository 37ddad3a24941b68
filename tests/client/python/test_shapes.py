"""Tests the wire encoding of shapes, and that the pieces of large ones add up to the whole."""
import pathlib
import tempfile
import unittest
import unittest.mock
from typing import Any, Sequence

import numpy as np

from voxeld import InvalidArray, InvalidColor, InvalidValue, shapes, wire
from voxeld.v1 import primitives_pb2 as pb

NUMPY = np.random.default_rng(1)


def parsed(shape: Sequence[wire.Packed], most: int = 1 << 20) -> list[pb.Primitive]:
    for one in shape:
        assert len(one) < most, "a piece's message stays below 1 MiB"
    return [pb.Primitive.FromString(one.to_bytes()) for one in shape]


def xyz(vertices: pb.Vertices) -> Any:
    return np.frombuffer(vertices.positions, np.float32).reshape(vertices.count, 3)


def rgb(vertices: pb.Vertices) -> Any:
    width = 4 if vertices.color_type == pb.ELEMENT_TYPE_RGBX8 else 3
    return np.frombuffer(vertices.colors, np.uint8).reshape(vertices.count, width)


def segments_of(primitive: pb.Primitive) -> list[tuple[bytes, bytes]]:
    """Returns the position and colour of each segment as the bytes of its two ends."""
    v = primitive.segments.vertices
    ends = [p.tobytes() + (c.tobytes() if v.colors else b"")
            for p, c in zip(xyz(v), rgb(v) if v.colors else np.zeros(v.count))]
    if primitive.segments.topology == pb.Segments.LIST:
        return list(zip(ends[::2], ends[1::2]))
    pairs = list(zip(ends, ends[1:]))
    if primitive.segments.topology == pb.Segments.LOOP:
        pairs.append((ends[-1], ends[0]))
    return pairs


class Points(unittest.TestCase):
    def test_pieces_are_the_whole(self) -> None:
        for count in (0, 1, 65407, 65408, 65409, 200_000):
            at = NUMPY.uniform(-1, 1, (count, 3)).astype(np.float32)
            colors = NUMPY.integers(0, 256, (count, 4), dtype=np.uint8)
            got = [p.points.vertices for p in parsed(shapes.points(at, colors=colors))]
            np.testing.assert_array_equal(np.concatenate([np.zeros((0, 3), np.float32), *map(xyz, got)]), at)
            np.testing.assert_array_equal(np.concatenate([np.zeros((0, 4), np.uint8), *map(rgb, got)]), colors)
            self.assertEqual(len(got), -(-count * 16 // shapes.PIECE_BYTES))

    def test_thickness_and_color(self) -> None:
        (got,) = parsed(shapes.points([[0, 0, 0]], colors="red", width=2, unit="units"))
        self.assertEqual(got.color.rgb, 0xFF0000)
        self.assertEqual(got.points.thickness, pb.Thickness(value=2, unit=pb.Thickness.UNITS))
        with self.assertRaisesRegex(InvalidValue, "'mm'.*'voxels', 'units'"):
            shapes.points([[0, 0, 0]], unit="mm")


class Lines(unittest.TestCase):
    def test_pieces_are_the_whole(self) -> None:
        for count in (2, 7, 150_000):
            for colored in (False, True):
                at = NUMPY.uniform(-1, 1, (count, 3)).astype(np.float32)
                colors = NUMPY.integers(0, 256, (count, 3), dtype=np.uint8) if colored else None
                ends = [p.tobytes() + (b"" if colors is None else colors[i].tobytes()) for i, p in enumerate(at)]
                expected = {"strip": list(zip(ends, ends[1:])), "loop": list(zip(ends, ends[1:] + ends[:1]))}
                if count % 2 == 0:
                    expected["pairs"] = list(zip(ends[::2], ends[1::2]))
                for mode, segments in expected.items():
                    got = [s for p in parsed(shapes.lines(at, colors=colors, mode=mode)) for s in segments_of(p)]
                    self.assertEqual(got, segments, (count, colored, mode))

    def test_strips_side_by_side(self) -> None:
        for strips, vertices in ((1, 2), (5, 2), (4, 7), (30_000, 5)):
            at = NUMPY.uniform(-1, 1, (strips, vertices, 3)).astype(np.float32)
            for mode in ("strip", "loop"):
                expected = []
                for strip in at:
                    ends = [p.tobytes() for p in strip]
                    expected += zip(ends, ends[1:] + (ends[:1] if mode == "loop" else []))
                got = [s for p in parsed(shapes.lines(at, mode=mode)) for s in segments_of(p)]
                self.assertEqual(got, expected)

    def test_what_is_wrong_says_so(self) -> None:
        for at, mode, words in ((np.zeros((1, 3)), "strip", "at least 2"), (np.zeros((3, 3)), "pairs", "even number"),
                                (np.zeros((3, 1, 3)), "strip", "at least 2"), (np.zeros((3, 9)), "strip", r"\(3, 9\), did you mean .T")):
            with self.assertRaisesRegex(InvalidArray, words):
                shapes.lines(at, mode=mode)
        with self.assertRaisesRegex(InvalidValue, "'ring'.*'strip', 'loop', 'pairs'"):
            shapes.lines(np.zeros((2, 3)), mode="ring")


class Mesh(unittest.TestCase):
    def test_pieces_are_the_whole(self) -> None:
        for vertices, faces in ((3, 1), (1000, 5000), (100_000, 60_000)):
            at = NUMPY.uniform(-1, 1, (vertices, 3)).astype(np.float32)
            colors = NUMPY.integers(0, 256, (vertices, 3), dtype=np.uint8)
            index = NUMPY.integers(0, vertices, (faces, 3))
            corners, own = [], []
            for primitive in parsed(shapes.mesh(at, index, colors=colors)):
                v = primitive.mesh.vertices
                used = np.frombuffer(v.indices, np.uint32)
                self.assertEqual(v.index_count, len(used))
                corners.append(xyz(v)[used])
                own.append(rgb(v)[used])
            np.testing.assert_array_equal(np.concatenate(corners), at[index.ravel()])
            np.testing.assert_array_equal(np.concatenate(own), colors[index.ravel()])

    def test_without_faces_three_by_three(self) -> None:
        at = NUMPY.uniform(-1, 1, (300_000, 3)).astype(np.float32)
        got = [p.mesh.vertices for p in parsed(shapes.mesh(at))]
        self.assertTrue(all(v.count % 3 == 0 for v in got))
        np.testing.assert_array_equal(np.concatenate([xyz(v) for v in got]), at)
        with self.assertRaisesRegex(InvalidArray, "multiple of 3"):
            shapes.mesh(at[:4])


class ColorsOfElements(unittest.TestCase):
    """Each segment or face has its own colour: in every piece, the colour is with the element that it was given for."""

    def test_of_segments(self) -> None:
        for mode, vertices, segments in (("strip", 200_000, 199_999), ("loop", 3, 3), ("loop", 200_000, 200_000),
                                         ("pairs", 200_000, 100_000), ("strip", 2, 1)):
            with self.subTest(mode=mode, vertices=vertices):
                at = NUMPY.uniform(-1, 1, (vertices, 3)).astype(np.float32)
                colors = NUMPY.integers(0, 256, (segments, 3), dtype=np.uint8)
                begins = at[::2] if mode == "pairs" else at[:segments]
                got_begins, got = [], []
                for primitive in parsed(shapes.lines(at, mode=mode, segment_colors=colors)):
                    v = primitive.segments.vertices
                    self.assertEqual(v.colors_of, pb.Vertices.ELEMENTS)
                    place = np.frombuffer(v.positions, np.float32).reshape(-1, 3)
                    own = np.frombuffer(v.colors, np.uint8).reshape(-1, 3)
                    step = 2 if primitive.segments.topology == pb.Segments.LIST else 1
                    got_begins.append(place[::step][:len(own)])
                    got.append(own)
                np.testing.assert_array_equal(np.concatenate(got), colors)
                np.testing.assert_array_equal(np.concatenate(got_begins), begins)

    def test_of_faces(self) -> None:
        for faces in (1, 60_000):
            at = NUMPY.uniform(-1, 1, (100_000, 3)).astype(np.float32)
            index = NUMPY.integers(0, len(at), (faces, 3))
            colors = NUMPY.integers(0, 256, (faces, 3), dtype=np.uint8)
            corners, own = [], []
            for primitive in parsed(shapes.mesh(at[:3] if faces == 1 else at, index % 3 if faces == 1 else index, face_colors=colors)):
                v = primitive.mesh.vertices
                self.assertEqual(v.colors_of, pb.Vertices.ELEMENTS)
                corners.append(xyz(v)[np.frombuffer(v.indices, np.uint32)])
                own.append(np.frombuffer(v.colors, np.uint8).reshape(-1, 3))
            np.testing.assert_array_equal(np.concatenate(own), colors)
            np.testing.assert_array_equal(np.concatenate(corners), (at[index % 3] if faces == 1 else at[index]).reshape(-1, 3))

    def test_without_faces_and_by_numbers(self) -> None:
        at = NUMPY.uniform(-1, 1, (300_000, 3)).astype(np.float32)
        got = [p.mesh.vertices for p in parsed(shapes.mesh(at, face_colors=np.arange(100_000.0), cmap="gray"))]
        self.assertGreater(len(got), 1)
        for v in got:
            self.assertEqual(len(v.colors), v.count)
        line, = parsed(shapes.lines(at[:4], segment_colors=[0.0, 0.5, 1.0], cmap="gray"))
        self.assertEqual(len(line.segments.vertices.colors) % 3, 0)
        self.assertEqual(line.segments.vertices.colors_of, pb.Vertices.ELEMENTS)
        one, = parsed(shapes.mesh(at[:6], face_colors="red"))
        self.assertEqual(one.mesh.vertices.colors, b"\xff\0\0" * 2)

    def test_what_is_wrong_says_so(self) -> None:
        at = np.zeros((6, 3))
        for wrong, words in (
                (lambda: shapes.mesh(at, colors="red", face_colors="red"), "give one of them"),
                (lambda: shapes.mesh(at, face_colors=np.zeros((3, 3), np.uint8)), "colors are 3 for 2 faces"),
                (lambda: shapes.lines(at, colors="red", segment_colors="red"), "give one of them"),
                (lambda: shapes.lines(at, segment_colors=np.zeros((6, 3), np.uint8)), "colors are 6 for 5 segments")):
            with self.subTest(words):
                with self.assertRaisesRegex((InvalidValue, InvalidArray, InvalidColor), words):
                    wrong()

    def test_shells(self) -> None:
        for kind, shape in (("box", shapes.box((0, 0, 0), 1, shell=3)), ("sphere", shapes.sphere((0, 0, 0), 1, shell=3)),
                            ("cylinder", shapes.cylinder((0, 0, 0), 1, 1, shell=3))):
            self.assertEqual(getattr(parsed(shape)[0], kind).shell.value, 3)
        self.assertFalse(parsed(shapes.sphere((0, 0, 0), 1))[0].sphere.HasField("shell"))

    def test_shells_of_meshes(self) -> None:
        mesh = parsed(shapes.mesh(np.eye(3), shell=2.5, unit="units"))[0].mesh
        self.assertEqual((mesh.shell.value, mesh.shell.unit), (2.5, pb.Thickness.UNITS))
        self.assertFalse(parsed(shapes.mesh(np.eye(3)))[0].mesh.HasField("shell"))
        with self.assertRaisesRegex(InvalidArray, "shell must be at least 0, got -1"):
            shapes.mesh(np.eye(3), shell=-1)


class Textures(unittest.TestCase):
    AT = np.eye(3, dtype=np.float32)
    UV = [(0, 0), (1, 0.5), (-2, 3)]

    def test_a_file_or_its_bytes(self) -> None:
        with tempfile.NamedTemporaryFile() as file:
            file.write(b"a picture")
            file.flush()
            for source in (b"a picture", bytearray(b"a picture"), file.name, pathlib.Path(file.name)):
                (primitive,) = parsed(shapes.mesh(self.AT, texture=source, uv=self.UV))
                self.assertEqual(primitive.mesh.texture.picture, b"a picture")
        places = np.frombuffer(primitive.mesh.texture.coordinates, np.float32)
        self.assertEqual(places.tolist(), [0, 0, 1, 0.5, -2, 3])
        self.assertEqual(primitive.mesh.vertices.count, 3)
        (plain,) = parsed(shapes.mesh(self.AT))
        self.assertFalse(plain.mesh.HasField("texture"))

    def test_what_is_wrong_says_so(self) -> None:
        with self.assertRaisesRegex(InvalidValue, "texture and uv go together"):
            shapes.mesh(self.AT, texture=b"x")
        with self.assertRaisesRegex(InvalidValue, "texture and uv go together"):
            shapes.mesh(self.AT, uv=self.UV)
        with self.assertRaisesRegex(InvalidArray, r"uv must be of shape \(3, 2\), got \(2, 2\)"):
            shapes.mesh(self.AT, texture=b"x", uv=self.UV[:2])
        with self.assertRaisesRegex(InvalidArray, "uv"):
            shapes.mesh(self.AT, texture=b"x", uv=[(0, 0), (1, np.nan), (0, 1)])
        with self.assertRaisesRegex(InvalidValue, "texture is a int; give a PNG or JPEG file"):
            shapes.mesh(self.AT, texture=5, uv=self.UV)  # type: ignore[arg-type]
        with self.assertRaises(OSError):
            shapes.mesh(self.AT, texture="/nowhere/at/all.png", uv=self.UV)
        many = np.broadcast_to(np.float32(0), (90_000_000, 3))  # which takes no memory here
        with self.assertRaisesRegex(InvalidArray, "more than the 1073741824 that a solid, or one with a texture, may have"):
            with unittest.mock.patch.object(shapes, "positions", lambda at, what: (many, pb.ELEMENT_TYPE_F32)):
                shapes.mesh(many, fill="solid")

    def test_what_is_one_stays_one(self) -> None:
        corners = np.zeros((300_000, 3), np.float32)
        faces = np.arange(300_000).reshape(-1, 3)
        for index in (None, faces):
            (solid,) = parsed(shapes.mesh(corners, index, fill="solid"), 15 << 20)
            self.assertEqual(solid.mesh.vertices.count, 300_000)
            (textured,) = parsed(shapes.mesh(corners, index, texture=b"x", uv=corners[:, :2]), 15 << 20)
            self.assertEqual(textured.mesh.vertices.count, 300_000)


class Solids(unittest.TestCase):
    def test_each(self) -> None:
        (box,) = parsed(shapes.box((1, 2, 3), 2, color="lime", fill="solid", rule="cover"))
        self.assertEqual((box.box.center.y, box.box.size.z, box.box.fill, box.box.rule, box.color.rgb),
                         (2, 2, pb.FILL_SOLID, pb.SURFACE_RULE_COVER, 0x00FF00))
        (sphere,) = parsed(shapes.sphere((1, 2, 3), 4))
        self.assertEqual((sphere.sphere.center.x, sphere.sphere.radius, sphere.HasField("color")), (1, 4, False))
        (cylinder,) = parsed(shapes.cylinder((1, 2, 3), 4, 5))
        self.assertEqual((cylinder.cylinder.radius, cylinder.cylinder.height), (4, 5))
        (instance,) = parsed(shapes.instance("wheel"))
        self.assertEqual(instance.instance.object, "wheel")

    def test_what_is_wrong_says_so(self) -> None:
        for make, word in ((lambda: shapes.box((0, 0, 0), (1, 0, 1)), "along y"), (lambda: shapes.sphere((0, 0), 1), "center"),
                           (lambda: shapes.sphere((0, 0, 0), -1), "radius"), (lambda: shapes.cylinder((0, 0, 0), 1, 0), "height")):
            with self.assertRaisesRegex(InvalidArray, word):
                make()


class Volume(unittest.TestCase):
    def test_the_centres_of_what_is_above(self) -> None:
        field = np.zeros((4, 2, 2))
        field[3, 0, 1] = 10
        (got,) = parsed(shapes.volume(field, cmap="gray", low=0, high=20))
        np.testing.assert_allclose(xyz(got.points.vertices), [[0.75, -0.25, 0.25]])
        np.testing.assert_array_equal(rgb(got.points.vertices), [[128, 128, 128]])
        (got,) = parsed(shapes.volume(field, threshold=-1, extent=((0, 0, 0), (4, 2, 2))))
        self.assertEqual(got.points.vertices.count, 16)
        np.testing.assert_allclose(xyz(got.points.vertices)[-1], [3.5, 1.5, 1.5])

    def test_colors_by_their_brightest_channel(self) -> None:
        field = np.zeros((2, 2, 2, 3), np.uint8)
        field[0, 1, 1] = (10, 200, 0)
        (got,) = parsed(shapes.volume(field, threshold=0.5))
        np.testing.assert_array_equal(rgb(got.points.vertices), [[10, 200, 0]])

    def test_what_is_wrong_says_so(self) -> None:
        with self.assertRaisesRegex(InvalidArray, r"\(4, 4\)"):
            shapes.volume(np.zeros((4, 4)))
        with self.assertRaisesRegex(InvalidArray, "must be less on every axis"):
            shapes.volume(np.zeros((4, 4, 4)), extent=((0, 0, 0), (1, 0, 1)))
        self.assertEqual(shapes.volume(np.zeros((4, 4, 4))), [])


if __name__ == "__main__":
    unittest.main()
