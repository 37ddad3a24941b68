"""Checks that the installed programs have the defences listed in docs/security/hardening.md, and that their sources were compiled with its flags."""
import json
import os
import re
import subprocess
import tempfile
import unittest
from pathlib import Path

from elf_defences import ALL, defences, search_path

BUILD = os.environ["BUILD"]
# By folder: the sources compiled without a flag; docs/security/hardening.md gives the reasons.
LEFT_OUT = json.loads(os.environ["HARDENING_LEFT_OUT"])
FLAGS = ["-fstack-protector-strong", "-fstack-clash-protection", "-fcf-protection=full", "-ftrivial-auto-var-init=zero",
         "-D_FORTIFY_SOURCE=3", "-D_GLIBCXX_ASSERTIONS", "-Werror=format-security"]

# Has something for each flag to protect: an array on the stack, a large frame, a copy whose size the compiler does not know, a vector's
# element.
VICTIM = r"""
#include <cstdio>
#include <cstring>
#include <vector>
#ifdef BARE
asm(".section .both,\"awx\"\n .byte 0\n .previous");
#endif
__attribute__((noinline)) int Sum(const char* text, size_t size) {
  char copied[20000];
  memcpy(copied, text, size);
  int sum = 0;
  for (char c : copied) sum += c;
  return sum;
}
int main(int argc, char** argv) {
  std::vector<int> numbers(argc);
  return numbers[argc + 1] + Sum(argv[0], strlen(argv[0]));
}
"""


def compiled(folder, *flags):
    source, program = Path(folder, "victim.cc"), Path(folder, "victim")
    source.write_text(VICTIM)
    subprocess.run([os.environ["CXX"], "-std=c++20", "-w", source, "-o", program, *flags], check=True)
    return program


class Looking(unittest.TestCase):
    """Checks that a defence is found where it exists, and not found where it does not."""

    def test_a_program_without_any_has_none(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            bare = compiled(folder, "-O1", "-fno-pie", "-no-pie", "-fno-stack-protector", "-fcf-protection=none", "-U_FORTIFY_SOURCE",
                            "-fno-stack-clash-protection", "-fuse-ld=bfd", "-Wl,-z,norelro,-z,lazy,-z,execstack,-rpath,/tmp", "-DBARE")
            # It has no text relocations, since nothing on this machine would load it with them; crt1.o begins with endbr64 on some.
            self.assertLessEqual(defences(bare), {"no_text_relocations", "branch_targets"})

    def test_a_program_with_all_has_all(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            self.assertEqual(defences(compiled(folder, "-O2", "-fPIE", "-pie", *FLAGS, "-Wl,-z,relro,-z,now,-z,noexecstack,-z,shstk",
                                               "-fuse-ld=mold")), set(ALL))


class Installed(unittest.TestCase):
    def test_programs_have_every_defence(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([os.environ["CMAKE"], "--install", BUILD, "--prefix", folder], check=True, stdout=subprocess.DEVNULL)
            engines = sorted(Path(folder, "libexec/voxeld").iterdir())
            self.assertIn("voxeld-engine", [engine.name for engine in engines])
            self.check([Path(folder, "bin/voxeld"), Path(folder, "bin/voxelctl"), *engines])

    def check(self, programs: "list[Path]", without: "set[str]" = set()) -> None:
        for program in programs:
            with self.subTest(str(program)):
                lacking = set(ALL) - without - defences(program)
                self.assertEqual(lacking, set(), "; ".join(f"{one}: expected that the program {ALL[one]}" for one in sorted(lacking)))

    @unittest.skipUnless("VOXELD_DIST" in os.environ, "VOXELD_DIST is not set: tools/test --stage package sets it to the output folder of tools/package")
    def test_programs_of_the_packages_and_of_the_bundle_have_every_defence(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            for package in Path(os.environ["VOXELD_DIST"]).glob("*.deb"):
                subprocess.run(["dpkg-deb", "-x", package, folder], check=True)
            [archive] = Path(os.environ["VOXELD_DIST"]).glob("voxeld-*-linux-*.tar.xz")
            bundle = Path(folder, "bundle")
            bundle.mkdir()
            subprocess.run(["tar", "-C", bundle, "-xJf", archive], check=True)
            packed = [Path(folder, "usr/bin/voxeld"), Path(folder, "usr/bin/voxelctl"), *Path(folder, "usr/libexec/voxeld").iterdir()]
            bundled = [program for program in Path(bundle, "bin").iterdir() if program.is_file()]
            self.assertLessEqual({"voxeld", "voxelctl", "voxeld-engine", "voxeld-import"}, {program.name for program in packed})
            self.assertLessEqual({"voxeld", "voxelctl", "voxeld-engine", "voxeld-import"}, {program.name for program in bundled})
            self.check(packed)
            # Bundled programs find the libraries beside them.
            self.check(bundled, without={"no_rpath"})
            for program in bundled:
                self.assertEqual(search_path(program), ["$ORIGIN/../lib", "$ORIGIN/../../lib"], program.name)


class Compiled(unittest.TestCase):
    def test_every_source_has_every_flag_but_where_it_is_said(self) -> None:
        commands = json.loads(Path(BUILD, "compile_commands.json").read_text())
        seen: set[str] = set()
        for one in commands:
            output = one.get("output") or re.search(r" -o (\S+)", one["command"])[1]  # type: ignore[index]
            path = os.path.relpath(os.path.join(one["directory"], output), BUILD)
            if not path.startswith(("common/", "daemon/", "display/", "gpu/", "tools/", "client/", "proto/")) or ".cu." in path:
                continue
            words = one["command"].split()
            of_cpp = {"-D_GLIBCXX_ASSERTIONS"} if path.endswith(".c.o") else set()
            without = {flag for flag in FLAGS if flag not in words} - of_cpp
            target = re.search(r"CMakeFiles/(\w[\w-]*)\.dir", path)[1]  # type: ignore[index]
            seen.add(target)
            with self.subTest(path):
                self.assertEqual(without, set(LEFT_OUT.get(target, [])))
                self.assertEqual([word for word in words if re.fullmatch(r"-O\w*", word)][-1], "-O3")
        self.assertLessEqual({"voxeld", "voxelctl", "voxeld-engine", "voxeld_gpu", "voxeld_wire", "voxeld_proto"} | set(LEFT_OUT), seen)


if __name__ == "__main__":
    unittest.main()
