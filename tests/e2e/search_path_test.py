"""Checks that built programs never search for shared libraries in the working directory, which an attacker may control."""
import os
import unittest

from elf_defences import search_path

PROGRAMS = os.environ["PROGRAMS"].split(":")


class SearchPath(unittest.TestCase):
    def test_every_folder_is_absolute_or_beside_the_program(self) -> None:
        self.assertGreater(len(PROGRAMS), 3)
        wrong = [(program, folder) for program in PROGRAMS for folder in search_path(program) if not folder.startswith(("/", "$ORIGIN/"))]
        self.assertEqual(wrong, [])

    def test_programs_find_the_libraries_of_a_bundle(self) -> None:
        self.assertEqual(search_path(PROGRAMS[0]), ["$ORIGIN/../lib", "$ORIGIN/../../lib"])


if __name__ == "__main__":
    unittest.main()
