import unittest
from typing import Any

import numpy as np

from voxeld import InvalidArray, arrays, transforms
from voxeld.v1 import primitives_pb2 as pb


class Positions(unittest.TestCase):
    def refused(self, values: Any, *words: str) -> None:
        with self.assertRaises(InvalidArray) as caught:
            arrays.positions(values, "points")
        for word in words:
            self.assertIn(word, str(caught.exception))

    def test_three_types_go_out_as_they_lie(self) -> None:
        for dtype, element in ((np.float32, pb.ELEMENT_TYPE_F32), (np.int16, pb.ELEMENT_TYPE_I16),
                               (np.int32, pb.ELEMENT_TYPE_I32)):
            given = np.arange(12).reshape(4, 3).astype(dtype)
            got, kind = arrays.positions(given)
            self.assertTrue(np.shares_memory(given, got))
            self.assertEqual(kind, element)

    def test_others_are_converted_once(self) -> None:
        for given, dtype in ((np.zeros((2, 3)), np.float32), (np.zeros((2, 3), np.float16), np.float32),
                             (np.ones((2, 3), np.uint8), np.int32), ([[1, 2, 3]], np.int32), ([[1, 2, 3.5]], np.float32)):
            got, _ = arrays.positions(given)
            self.assertEqual(got.dtype, dtype)
            np.testing.assert_array_equal(got, np.asarray(given))

    def test_what_is_not_contiguous_is_made_so(self) -> None:
        given = np.arange(24, dtype=np.float32).reshape(4, 6)[:, ::2]
        got, _ = arrays.positions(given)
        self.assertTrue(got.flags.c_contiguous)
        np.testing.assert_array_equal(got, given)
        swapped = np.arange(6, dtype=">f4").reshape(2, 3)
        got, _ = arrays.positions(swapped)
        self.assertEqual(got.tobytes(), swapped.astype("<f4").tobytes())

    def test_nothing_is_of_the_right_shape(self) -> None:
        self.assertEqual(arrays.positions([])[0].shape, (0, 3))

    def test_shapes(self) -> None:
        self.refused(np.zeros((3, 1000)), "got (3, 1000), did you mean .T?")
        self.refused(np.zeros((7, 2)), "(7, 2)", "np.column_stack")
        self.refused(np.zeros(3), "(3,)", "[p]")
        self.refused(np.zeros((5, 2, 3)), "(5, 2, 3)", ".reshape(-1, 3)")
        self.refused(np.zeros((5, 4)), "p[:, :3]")
        self.refused([[1, 2, 3], [1, 2]], "one length")
        self.refused([["a", "b", "c"]], "<U1")
        self.refused(np.zeros((2, 3), complex), "complex128")

    def test_the_first_that_is_not_finite_is_named(self) -> None:
        for bad in (np.nan, np.inf, -np.inf):
            given = np.zeros((100, 3), np.float32)
            given[17, 1] = bad
            given[50, 0] = np.nan
            self.refused(given, "points[17, 1]", str(bad), "2 that are not finite")
        self.refused([[1e300, 0, 0]], "points[0, 0] is inf")  # beyond float32

    def test_infinities_that_cancel_are_found(self) -> None:
        self.refused([[np.inf, -np.inf, 0]], "points[0, 0]")

    def test_large_numbers_whose_sum_overflows_are_fine(self) -> None:
        given = np.full((100, 3), 3e38, np.float32)
        self.assertTrue(np.shares_memory(arrays.positions(given)[0], given))

    def test_whole_numbers_have_a_limit(self) -> None:
        arrays.positions([[1 << 24, -(1 << 24), 0]])
        self.refused([[(1 << 24) + 1, 0, 0]], "16777217")
        self.refused(np.array([[1 << 40, 0, 0]]), "2**24")


class Indices(unittest.TestCase):
    def refused(self, values: Any, count: int, *words: str) -> None:
        with self.assertRaises(InvalidArray) as caught:
            arrays.indices(values, count)
        for word in words:
            self.assertIn(word, str(caught.exception))

    def test_32_bits_go_out_as_they_lie(self) -> None:
        for dtype in (np.uint32, np.int32):
            given = np.arange(6, dtype=dtype).reshape(2, 3)
            got = arrays.indices(given, 6)
            self.assertTrue(np.shares_memory(given, got))
            self.assertEqual(got.dtype, np.uint32)

    def test_ranges(self) -> None:
        self.refused([[0, 1, 3]], 3, "0 to 3", "3 vertices")
        self.refused([[-1, 1, 2]], 3, "-1 to 2")
        self.refused([[1, 2, 3]], 3, "count from 1?")

    def test_shapes_and_types(self) -> None:
        self.refused([[0, 1, 2, 3]], 4, "quads")
        self.refused([[0.0, 1.0, 2.0]], 3, "float64")
        self.refused([0, 1, 2], 3, "(3,)")


class Numbers(unittest.TestCase):
    def test_bounds(self) -> None:
        for value in (0, -1, float("nan"), float("inf"), "a", None):
            with self.assertRaises(InvalidArray) as caught:
                arrays.number(value, "radius", above=0)  # type: ignore[arg-type]
            self.assertIn("radius", str(caught.exception))


class Transforms(unittest.TestCase):
    def test_they_compose_the_right_one_first(self) -> None:
        matrix = transforms.translate(1, 2, 3) @ transforms.rotate("z", 90) @ transforms.scale(2)
        np.testing.assert_allclose(matrix @ [1, 0, 0, 1], [1, 4, 3, 1], atol=1e-12)
        np.testing.assert_array_equal(transforms.translate((1, 2, 3)), transforms.translate(1, 2, 3))
        np.testing.assert_array_equal(transforms.scale(np.array([1, 2, 3])), transforms.scale(1, 2, 3))
        for wrong in ((1,), (1, 2), ((1, 2),), ((1, 2, 3), 4)):
            with self.assertRaises(InvalidArray):
                transforms.translate(*wrong)
        self.assertEqual(list(transforms.to_wire(transforms.translate(1, 2, 3)).m), [1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3])

    def test_any_axis_turns_as_the_three_do(self) -> None:
        for name, axis in zip("xyz", np.eye(3)):
            np.testing.assert_allclose(transforms.rotate(name, 33), transforms.rotate(axis * 5, 33), atol=1e-15)
        turn = transforms.rotate((1, 1, 1), 120)[:3, :3]
        np.testing.assert_allclose(turn @ [1, 0, 0], [0, 1, 0], atol=1e-12)

    def test_what_is_wrong_says_so(self) -> None:
        for matrix, word in ((np.zeros((3, 3)), "translate()"), (np.eye(4) * 0, "last row"),
                             (transforms.translate(1, 2, 3).T, "did you mean .T?"),
                             (np.diag([1, 1, 0, 1]), "singular"), (np.diag([1, np.nan, 1, 1]), "transform[1, 1]")):
            with self.assertRaises(InvalidArray) as caught:
                transforms.as_matrix(matrix)
            self.assertIn(word, str(caught.exception))


if __name__ == "__main__":
    unittest.main()
