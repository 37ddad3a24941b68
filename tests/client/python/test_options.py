"""Tests the errors for arguments that a drawing call does not have."""
import inspect
import pydoc
import unittest
from typing import Any

import voxeld as voxel
from voxeld import InvalidOption, draw, shapes
from voxeld.draw import Draw
from voxeld.look import Look

CALLS = sorted(name for name, method in inspect.getmembers(Draw, inspect.isfunction) if not name.startswith("_"))


class Paper(Draw[dict[str, Any]]):
    """Draws nothing, and returns the arguments that it received."""

    def _draw(self, name: str, make: draw.Make, args: tuple[Any, ...], options: dict[str, Any], look: Look) -> dict[str, Any]:
        return {"name": name, "args": args, **options, "look": look}


# A call, a word that docs/primitives.md or another library uses for the argument, and the option that was meant.
MEANT = [("text", "alignment", "align"), ("lines", "topology", "mode"), ("lines", "thickness", "width"), ("points", "thickness", "width"),
         ("sphere", "thickness", "shell"), ("mesh", "thickness", "shell"), ("instance", "object", "of"), ("implicit", "colormap", "cmap"),
         ("implicit", "parameter_names", "parameters"), ("patch", "edge_a", "edges"), ("mesh", "indices", "faces"),
         ("points", "vertices", "positions"), ("curve", "vertices", "points"), ("bezier_surface", "vertices", "patches"),
         ("polygon", "points", "curves"), ("height_map", "picture", "texture"), ("grid", "transfer", "values"), ("isosurface", "grid", "array"),
         ("sphere", "at", "transform"), ("box", "turn", "transform"), ("text", "colour", "color"), ("points", "color", "colors"),
         ("torus", "tube_radus", "tube_radius"), ("arrow", "lable", "label")]


class Options(unittest.TestCase):
    def test_every_call_says_its_own_name_and_nothing_of_the_inside(self) -> None:
        self.assertGreater(len(CALLS), 20)
        for call in CALLS:
            with self.subTest(call), self.assertRaises(InvalidOption) as raised:
                getattr(Paper(), call)("x", no_such_thing=1)
            self.assertRegex(str(raised.exception), rf"^{call}\(\) has no option 'no_such_thing'; it takes name, .*transform.*label$")

    def test_what_was_meant(self) -> None:
        for call, word, meant in MEANT:
            with self.subTest(call, word=word), self.assertRaises(InvalidOption) as raised:
                getattr(Paper(), call)("x", **{word: 1})
            self.assertEqual(str(raised.exception), f"{call}() has no option {word!r}; did you mean {meant!r}?")

    def test_it_is_of_the_kinds_that_python_and_this_package_have_for_it(self) -> None:
        self.assertTrue(issubclass(InvalidOption, TypeError))
        self.assertTrue(issubclass(InvalidOption, voxel.InvalidValue))

    def test_what_is_right_arrives(self) -> None:
        drawn = Paper().text("word", "hi", (1, 2, 3), align="center", lifetime=2.0)
        self.assertEqual((drawn["args"], drawn["align"], drawn["look"].lifetime), (("hi", (1, 2, 3), 0.2), "center", 2.0))

    def test_help_has_the_options(self) -> None:
        told = pydoc.plain(pydoc.render_doc(Paper().text))
        for word in ("align", "facing", "wrap", "letters"):
            self.assertIn(word, told)

    def test_a_call_that_there_is_not(self) -> None:
        for word, meant in (("segments", "lines"), ("heightmap", "height_map"), ("spere", "sphere")):
            with self.assertRaises(AttributeError) as raised:
                getattr(Paper(), word)
            self.assertEqual(str(raised.exception), f"'Paper' has no {word!r}; did you mean {meant!r}?")
        self.assertFalse(hasattr(Paper(), "__array__"), "no library takes it for something else")


class Updates(unittest.TestCase):
    def setUp(self) -> None:
        self.connection = voxel.Connection("unix:/nobody/listens", voxel.base.settings(None, "reliable", 1, "clear", False, True, 1 << 20, b"", b""),
                                           True, "raise", None, None)
        self.addCleanup(self.connection.close, 0)

    def test_takes_what_was_named_when_it_was_made(self) -> None:
        ball = self.connection.sphere("ball", radius=0.3, color="red")
        ball.update(radius=0.5)
        self.assertEqual(ball._make(*ball._args, **ball._options)[0].to_bytes(),
                         shapes.sphere((0, 0, 0), 0.5, color="red")[0].to_bytes())

    def test_says_what_it_does_not_take(self) -> None:
        ball = self.connection.sphere("ball", radius=0.3)
        for changes, message in (({"colour": 1}, "sphere() has no option 'colour'; did you mean 'color'?"),
                                 ({"thickness": 1}, "sphere() has no option 'thickness'; did you mean 'shell'?")):
            with self.assertRaises(InvalidOption) as raised:
                ball.update(**changes)
            self.assertEqual(str(raised.exception), message)
        with self.assertRaisesRegex(InvalidOption, "'center' twice"):
            ball.update((0, 0, 0), center=(1, 1, 1))

    def test_a_layers_order_is_a_whole_number(self) -> None:
        for wrong in ("first", 1.5, True, 2**31):
            with self.assertRaisesRegex(voxel.InvalidValue, "order is .*; give a whole number"):
                self.connection.layer("x", order=wrong)  # type: ignore[arg-type]


if __name__ == "__main__":
    unittest.main()
