"""Expressions built by computation produce the same operations as their text."""
import unittest

from voxeld import InvalidArray, InvalidValue, expressions, measured
from voxeld.expressions import Tree, parameter, x, y, z
from voxeld.v1 import primitives_pb2 as pb


def tree(expression: expressions.Expression) -> Tree:
    return expression.to_wire().tree


class ExpressionsTest(unittest.TestCase):
    def test_operations_come_in_postfix_order(self) -> None:
        got = tree(x**2 + 3 * y - z)
        self.assertEqual(list(got.ops), [Tree.X, Tree.SQUARE, Tree.CONSTANT, Tree.Y, Tree.MULTIPLY, Tree.ADD, Tree.Z,
                                         Tree.SUBTRACT])
        self.assertEqual(list(got.values), [3])

    def test_numbers_may_stand_on_either_side(self) -> None:
        for made, op in [(2 + x, Tree.ADD), (2 - x, Tree.SUBTRACT), (2 / x, Tree.DIVIDE), (2 % x, Tree.MODULO),
                         (2**x, Tree.POWER)]:
            self.assertEqual(list(tree(made).ops), [Tree.CONSTANT, Tree.X, op])
        for made, op in [(x + 2, Tree.ADD), (x / 2, Tree.DIVIDE), (x % 2, Tree.MODULO), (x**3, Tree.POWER)]:
            self.assertEqual(list(tree(made).ops), [Tree.X, Tree.CONSTANT, op])
        self.assertEqual(list(tree(abs(-x)).ops), [Tree.X, Tree.NEGATE, Tree.ABS])

    def test_every_function_has_its_operation(self) -> None:
        for name in ("sqrt", "cbrt", "sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "floor"):
            self.assertEqual(list(tree(getattr(expressions, name)(x)).ops), [Tree.X, Tree.Op.Value(name.upper())])
        for name in ("atan2", "min", "max", "difference"):
            self.assertEqual(list(tree(getattr(expressions, name)(x, 1)).ops),
                             [Tree.X, Tree.CONSTANT, Tree.Op.Value(name.upper())])
        for name in ("smooth_min", "smooth_max"):
            self.assertEqual(list(tree(getattr(expressions, name)(x, y, z)).ops),
                             [Tree.X, Tree.Y, Tree.Z, Tree.Op.Value(name.upper())])

    def test_conditions_are_numbers(self) -> None:
        self.assertEqual(tree(x <= 1), tree(x - 1))
        self.assertEqual(list(tree(x >= 1).ops), [Tree.CONSTANT, Tree.X, Tree.SUBTRACT])
        with self.assertRaisesRegex(InvalidValue, "neither true nor false"):
            bool(x <= 1)

    def test_parameters_are_named(self) -> None:
        self.assertEqual(tree(parameter("a") * parameter("b")).names, "a b")
        with self.assertRaises(InvalidValue):
            parameter("not a name")
        with self.assertRaises((InvalidArray, InvalidValue)):
            x + float("nan")

    def test_shapes_take_them(self) -> None:
        (packed,) = measured.implicit(x**2 + y**2 - z, bound=x**2 + y**2 <= 1)
        shape = pb.Primitive.FromString(packed.to_bytes()).implicit
        self.assertEqual(shape.surface.tree, tree(x**2 + y**2 - z))
        self.assertEqual(shape.bound.tree, tree(x**2 + y**2 - 1))


if __name__ == "__main__":
    unittest.main()
