"""Where programs of a build have their libraries looked for: never in the working directory, which may be somebody else's."""
import os
import unittest
from pathlib import Path

from elf_defences import search_path

BUILD = Path(os.environ["BUILD"])


def is_elf(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(4) == b"\x7fELF"


class SearchPath(unittest.TestCase):
    def test_every_folder_is_absolute_or_beside_the_program(self) -> None:
        programs = [path for folder in ("bin", "bin/tests", "client/cpp") for path in sorted((BUILD / folder).iterdir())
                    if path.is_file() and (path.suffix == ".so" or os.access(path, os.X_OK)) and is_elf(path)]
        self.assertLessEqual({"voxeld", "voxelctl", "voxeld-engine", "libvoxeld_client.so"}, {path.name for path in programs})
        wrong = [(path.name, folder) for path in programs for folder in search_path(path)
                 if not folder.startswith(("/", "$ORIGIN/"))]
        self.assertEqual(wrong, [])
        self.assertEqual(search_path(BUILD / "bin/voxeld"), ["$ORIGIN/../lib", "$ORIGIN/../../lib"])


if __name__ == "__main__":
    unittest.main()
