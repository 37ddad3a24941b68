"""Tests the files that are shipped. PYTHONPATH begins with the wheel."""
import os
import subprocess
import sys
import unittest
import zipfile
from email.parser import Parser
from pathlib import Path

import voxeld

WHEEL = os.environ["PYTHONPATH"].split(":")[0]


class Wheel(unittest.TestCase):
    def test_it_is_what_is_imported(self) -> None:
        self.assertTrue(voxeld.__file__.startswith(WHEEL + "/"), voxeld.__file__)

    def test_the_source_folder_says_how_to_build_it(self) -> None:
        source = Path(__file__).resolve().parents[3] / "client/python"
        done = subprocess.run([sys.executable, "-B", "-c", "import voxeld"], env={**os.environ, "PYTHONPATH": str(source)}, capture_output=True, text=True,
                              check=False)
        self.assertEqual(done.returncode, 1)
        self.assertIn("ImportError: voxeld: the generated modules (voxeld.v1) are not here", done.stderr)
        self.assertIn("cmake --build --preset demo --target python_client", done.stderr)

    def test_it_has_types_stubs_and_nothing_else(self) -> None:
        with zipfile.ZipFile(WHEEL) as wheel:
            names = set(wheel.namelist())
            info = f"voxeld-{voxeld.__version__}.dist-info/"
            tags = Parser().parsestr(wheel.read(info + "WHEEL").decode())
            metadata = Parser().parsestr(wheel.read(info + "METADATA").decode())
        self.assertEqual((tags["Tag"], tags["Root-Is-Purelib"]), ("py3-none-any", "true"))
        self.assertEqual(metadata["Version"], voxeld.__version__)
        self.assertIn("voxeld/py.typed", names)
        for name in ("types", "primitives", "scene", "display", "local"):
            for kind in ("_pb2.py", "_pb2.pyi", "_pb2_grpc.py"):
                self.assertIn(f"voxeld/v1/{name}{kind}", names)
        self.assertEqual([name for name in names if not name.startswith(("voxeld/", info))], [])
        self.assertEqual([name for name in names if "pycache" in name or "test" in name], [])


if __name__ == "__main__":
    unittest.main()
