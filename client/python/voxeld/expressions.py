"""Expressions built from Python operators in place of text: they become the wire's operations.

    from voxeld.expressions import x, y, z, sin, parameter
    v.implicit("wave", surface=z - parameter("k") * sin(x**2 + y**2), parameters={"k": 0.5})

A condition is a number that is ≤ 0 where it is true: `x**2 + y**2 <= 1` is `x**2 + y**2 - 1`, and `max` is "and".
"""

from __future__ import annotations

from typing import Union

from .arrays import number
from .errors import InvalidValue
from .v1 import primitives_pb2 as pb

Tree = pb.Expression.Tree


class Expression:
    """A number as a function of x, y and z. Immutable; combined by + − * / ** % abs() and this module's functions."""

    __slots__ = ("_names", "_ops", "_values")

    def __init__(self, ops: tuple[Tree.Op, ...], values: tuple[float, ...] = (), names: tuple[str, ...] = ()) -> None:
        self._ops, self._values, self._names = ops, values, names

    def to_wire(self) -> pb.Expression:
        return pb.Expression(tree=Tree(ops=self._ops, values=self._values, names=" ".join(self._names)))

    def __add__(self, other: Number) -> Expression:
        return _of(Tree.ADD, self, other)

    def __radd__(self, other: Number) -> Expression:
        return _of(Tree.ADD, other, self)

    def __sub__(self, other: Number) -> Expression:
        return _of(Tree.SUBTRACT, self, other)

    def __rsub__(self, other: Number) -> Expression:
        return _of(Tree.SUBTRACT, other, self)

    def __mul__(self, other: Number) -> Expression:
        return _of(Tree.MULTIPLY, self, other)

    def __rmul__(self, other: Number) -> Expression:
        return _of(Tree.MULTIPLY, other, self)

    def __truediv__(self, other: Number) -> Expression:
        return _of(Tree.DIVIDE, self, other)

    def __rtruediv__(self, other: Number) -> Expression:
        return _of(Tree.DIVIDE, other, self)

    def __mod__(self, other: Number) -> Expression:
        return _of(Tree.MODULO, self, other)

    def __rmod__(self, other: Number) -> Expression:
        return _of(Tree.MODULO, other, self)

    def __pow__(self, other: Number) -> Expression:
        if not isinstance(other, Expression) and other == 2:
            return _of(Tree.SQUARE, self)
        return _of(Tree.POWER, self, other)

    def __rpow__(self, other: Number) -> Expression:
        return _of(Tree.POWER, other, self)

    def __neg__(self) -> Expression:
        return _of(Tree.NEGATE, self)

    def __abs__(self) -> Expression:
        return _of(Tree.ABS, self)

    def __le__(self, other: Number) -> Expression:
        return self - other

    def __ge__(self, other: Number) -> Expression:
        return other - self

    def __bool__(self) -> bool:
        raise InvalidValue("an expression is neither true nor false; join conditions by max (and) and min (or)")


Number = Union[Expression, float, int]


def _as_expression(value: Number) -> Expression:
    if isinstance(value, Expression):
        return value
    return Expression((Tree.CONSTANT,), (number(value, "a number in an expression"),))


def _of(op: Tree.Op, *operands: Number) -> Expression:
    parts = [_as_expression(operand) for operand in operands]
    return Expression(sum((part._ops for part in parts), ()) + (op,), sum((part._values for part in parts), ()),
                      sum((part._names for part in parts), ()))


x, y, z = Expression((Tree.X,)), Expression((Tree.Y,)), Expression((Tree.Z,))
voxel = Expression((Tree.VOXEL,))  # the edge of a voxel in the shape's units


def parameter(name: str) -> Expression:
    if not name.isidentifier() or not name.isascii():
        raise InvalidValue(f"a parameter is called {name!r}; letters, digits and _ make a name, a digit not first")
    return Expression((Tree.PARAMETER,), names=(name,))


def sqrt(a: Number) -> Expression:
    return _of(Tree.SQRT, a)


def cbrt(a: Number) -> Expression:
    return _of(Tree.CBRT, a)


def sin(a: Number) -> Expression:
    return _of(Tree.SIN, a)


def cos(a: Number) -> Expression:
    return _of(Tree.COS, a)


def tan(a: Number) -> Expression:
    return _of(Tree.TAN, a)


def asin(a: Number) -> Expression:
    return _of(Tree.ASIN, a)


def acos(a: Number) -> Expression:
    return _of(Tree.ACOS, a)


def atan(a: Number) -> Expression:
    return _of(Tree.ATAN, a)


def atan2(a: Number, b: Number) -> Expression:
    return _of(Tree.ATAN2, a, b)


def exp(a: Number) -> Expression:
    return _of(Tree.EXP, a)


def log(a: Number) -> Expression:
    return _of(Tree.LOG, a)


def floor(a: Number) -> Expression:
    return _of(Tree.FLOOR, a)


def min(a: Number, b: Number) -> Expression:  # noqa: A001
    """Returns the lesser; on shapes, the union."""
    return _of(Tree.MIN, a, b)


def max(a: Number, b: Number) -> Expression:  # noqa: A001
    """Returns the greater; on shapes, the intersection."""
    return _of(Tree.MAX, a, b)


def difference(a: Number, b: Number) -> Expression:
    """On shapes: what is in a but not in b."""
    return _of(Tree.DIFFERENCE, a, b)


def smooth_min(a: Number, b: Number, within: Number) -> Expression:
    """Returns the lesser, rounded off where the two differ by less than `within`."""
    return _of(Tree.SMOOTH_MIN, a, b, within)


def smooth_max(a: Number, b: Number, within: Number) -> Expression:
    return _of(Tree.SMOOTH_MAX, a, b, within)
