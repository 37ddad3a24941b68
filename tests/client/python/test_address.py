import os
import socket
import tempfile
import unittest

from voxeld import InvalidValue, address


class Choose(unittest.TestCase):
    def test_what_is_given_comes_first_then_the_variable(self) -> None:
        self.assertEqual(address.choose("a:1", {"VOXELD_SERVER": "b:2"}), "a:1")
        self.assertEqual(address.choose(None, {"VOXELD_SERVER": "b:2"}), "b:2")

    def test_a_socket_in_the_runtime_directory_is_found_and_nothing_else_there_is(self) -> None:
        with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX) as server:
            path = f"{folder}/voxeld.sock"
            with open(path, "w"):
                self.assertNotEqual(address.choose(None, {"XDG_RUNTIME_DIR": folder}), f"unix:{path}")
            os.unlink(path)
            server.bind(path)
            self.assertEqual(address.choose(None, {"XDG_RUNTIME_DIR": folder}), f"unix:{path}")
            self.assertNotEqual(address.choose(None, {"XDG_RUNTIME_DIR": os.path.relpath(folder)}), f"unix:{path}")


class Target(unittest.TestCase):
    def test_what_is_right(self) -> None:
        for text, target in {"unix:/a/b": "unix:/a/b", "unix:///a/b": "unix:/a/b", "host:1": "dns:///host:1",
                             "[::1]:50551": "dns:///[::1]:50551"}.items():
            self.assertEqual(address.target(text), target)

    def test_what_is_wrong_says_so(self) -> None:
        for text, why in {"unix:a": "absolute", "host": "no port", ":1": "no host", "::1:5": "[::1]:50551",
                          "a:0": "1 to 65535", "a:65536": "1 to 65535", "a:b": "1 to 65535", "a:²": "1 to 65535"}.items():
            with self.assertRaises(InvalidValue) as caught:
                address.target(text)
            self.assertIn(why, str(caught.exception))
            self.assertIn(repr(text), str(caught.exception))


if __name__ == "__main__":
    unittest.main()
