"""Follows the guides of docs/guides as a reader does: runs every block in order, and checks that the output that a guide shows for a block
occurs in what it prints. Paths are in VOXELD, VOXELCTL, EMULATOR, BUILD and SOURCE; VOXELD_CMAKE is the cmake that built them.

How a guide is written:
  sh      is run by bash, in the folder in which the previous block ended; a block that only calls voxeld
          or voxeld-emulator has a terminal of its own: it keeps running, and the one
          before it is ended
  python, c, cpp, cmake, toml
          below a line that names a file in backticks and ends with a colon, is that file; other python is pasted, unchanged, at the prompt of
          one interpreter, and prints at most as much as a user would read
  text    is the output of the block before: each line is part of a line, in this order; a number matches any number, "…" matches anything
  console and other blocks are not run"""
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import unittest
from pathlib import Path
from typing import NamedTuple, Optional

from polling import LONG, until

GUIDES = Path(os.environ["SOURCE"], "docs", "guides")
COMPILING = 4 * LONG
READABLE = 1500  # characters that one block prints at a prompt


class Block(NamedTuple):
    line: int
    kind: str
    file: str  # empty: the block is run
    text: str


def blocks(guide: str) -> list[Block]:
    found: list[Block] = []
    above, kind, begin, inside = "", None, 0, list[str]()
    for number, line in enumerate(guide.splitlines(), 1):
        if kind is None and line.startswith("```"):
            kind, begin, inside = line[3:], number, []
        elif kind is not None and line == "```":
            named = re.findall(r"`([\w.-]+\.\w+)`", above) if above.endswith(":") else []
            file = named[-1] if named and kind in ("python", "c", "cpp", "cmake", "toml") else ""
            found.append(Block(begin, kind, file, "\n".join(inside) + "\n"))
            above, kind = "", None
        elif kind is not None:
            inside.append(line)
        elif line:
            above = line
    return found


def pattern(line: str) -> str:
    """Returns the pattern of a line of a text block."""
    parts = re.split(r"(…|\d+(?:\.\d+)?)", line.strip())
    exact = bool(re.search(r"(?:\b[0-9A-F]{2} ){4}", line))  # bytes must match exactly
    return "".join(".*" if part == "…" else r"[\d.,]+" if part[:1].isdigit() and not exact else re.escape(part) for part in parts)


def unsaid(text: str, output: str) -> Optional[str]:
    """Returns the first line of `text` that does not occur, in its order, in the output."""
    left = output.splitlines()
    for line in text.splitlines():
        while left and not re.search(pattern(line), left[0]):
            left.pop(0)
        if not left:
            return line
        left.pop(0)
    return None


class Reader:
    """A reader who follows a guide, in a folder that looks like a built clone."""

    def __init__(self, case: unittest.TestCase) -> None:
        self._case = case
        folder = tempfile.TemporaryDirectory()
        case.addCleanup(folder.cleanup)
        self.folder = Path(folder.name, "clone")
        programs, home = Path(folder.name, "bin"), Path(folder.name, "home")
        for one in (programs, home, self.folder / "build"):
            one.mkdir(parents=True)
        for preset in ("demo", "release"):
            (self.folder / "build" / preset).symlink_to(os.environ["BUILD"])
        (self.folder / "display").symlink_to(Path(os.environ["SOURCE"], "display"))
        for name, path in (("voxelctl", os.environ["VOXELCTL"]), ("cmake", os.environ["VOXELD_CMAKE"]), ("python3", sys.executable)):
            (programs / name).symlink_to(path)
        self.environment = {**os.environ, "HOME": str(home), "VOXELD_SERVER": f"unix:{folder.name}/s",
                            "PATH": f"{programs}:{os.environ['PATH']}", "PIP_NO_INDEX": "1", "PIP_CONFIG_FILE": os.devnull}
        for name in ("PYTHONPATH", "XDG_CONFIG_HOME", "PYTHONDONTWRITEBYTECODE"):
            self.environment.pop(name, None)
        self._service: Optional["subprocess.Popen[str]"] = None
        self._interpreter: Optional["subprocess.Popen[str]"] = None
        self.ran = 0
        case.addCleanup(self._end_service)
        case.addCleanup(self._end_interpreter)

    def do(self, guide: str, text: str) -> None:
        output = ""
        for block in blocks(text):
            with self._case.subTest(f"{guide}:{block.line}"):
                if block.file:
                    (self.folder / block.file).write_text(block.text, encoding="utf-8")
                elif block.kind == "text":
                    missing = unsaid(block.text, output)
                    self._case.assertIsNone(missing, f"{guide}:{block.line}: not printed, or not in this order; what was printed:\n{output}")
                elif block.kind == "sh" and re.fullmatch(r"voxeld(-emulator)?\b[^\n]*\n", block.text):
                    output = self.serve(block.text)
                elif block.kind == "sh":
                    output = self.shell(block.text)
                elif block.kind == "python":
                    output = self._type(block.text)
                else:
                    self._case.assertIn(block.kind, ("console", "toml", "json", ""), f"{guide}:{block.line}: nobody knows what to do with it")
                    continue
                self.ran += 1

    def shell(self, text: str) -> str:
        # Processes that it leaves running end with it: they have a process group of their own.
        with tempfile.TemporaryFile("w+") as output, tempfile.NamedTemporaryFile("r") as where:
            shell = subprocess.Popen(["bash", "-euo", "pipefail", "-c", f"{text}pwd >{where.name}"], cwd=self.folder, env=self.environment, stdout=output,
                                     stderr=subprocess.STDOUT, start_new_session=True)
            try:
                status = shell.wait(COMPILING)
            except subprocess.TimeoutExpired:
                os.killpg(shell.pid, signal.SIGKILL)
                raise
            if text.endswith("&\n"):
                self._case.addCleanup(os.killpg, shell.pid, signal.SIGKILL)
            output.seek(0)
            said = output.read()
            ended = where.read().strip()
        self._case.assertEqual(status, 0, f"{text}\n{said}")
        self.folder = Path(ended)
        return said

    def serve(self, text: str) -> str:
        self._end_service()
        words = text.replace("voxeld-emulator", "$EMULATOR", 1) if text.startswith("voxeld-") else \
            text.replace("voxeld", '$VOXELD --listen "$VOXELD_SERVER" --http off --log-level warn', 1)
        self._service = subprocess.Popen(["bash", "-c", f"exec {words}"], cwd=self.folder, env=self.environment, text=True,
                                         stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        service, said = self._service, list[str]()
        assert service.stdout is not None
        threading.Thread(target=lambda: said.extend(service.stdout or ()), daemon=True).start()

        def ready() -> bool:
            self._case.assertIsNone(service.poll(), f"{text} has ended: {''.join(said)}")
            if "emulator" in words.lower():
                return "ready\n" in said
            asked = subprocess.run(["voxelctl", "--json", "displays"], env=self.environment, capture_output=True, text=True, timeout=LONG)
            return asked.returncode == 0 and "showing" in asked.stdout.lower()

        until(ready, text)
        return "".join(said)

    def _end_service(self) -> None:
        if self._service is not None:
            self._service.terminate()
            self._service.wait(LONG)
            if self._service.stdout is not None:
                self._service.stdout.close()
            self._service = None

    def _type(self, text: str) -> str:
        if self._interpreter is None:
            self._interpreter = subprocess.Popen([f"{self.environment['HOME']}/voxel/bin/python", "-i", "-q", "-u"], cwd=self.folder, text=True,
                                                 env=self.environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        assert self._interpreter.stdin is not None and self._interpreter.stdout is not None
        # If the block is incomplete, its next line is an error, and prints nothing.
        self._interpreter.stdin.write(f"{text}print('next')\n\nprint('\\0')\n")
        self._interpreter.stdin.flush()
        said = ""
        while (line := re.sub(r"^((>>>|\.\.\.) )+", "", self._interpreter.stdout.readline())) != "\0\n":
            self._case.assertTrue(line, f"the interpreter has ended: {said}")
            said += line
        self._case.assertTrue(said.endswith("next\n"), f"an empty line is missing at the end of\n{text}\n{said}")
        self._case.assertNotRegex(said, r"(?m)^(\w*Error|Traceback)\b", text)
        self._case.assertLess(len(said), READABLE, f"too much to read is printed by\n{text}\n{said}")
        return said

    def _end_interpreter(self) -> None:
        if self._interpreter is not None:
            assert self._interpreter.stdin is not None and self._interpreter.stdout is not None
            self._interpreter.stdin.close()
            self._interpreter.wait(LONG)
            self._interpreter.stdout.close()


class Guides(unittest.TestCase):
    def do(self, name: str, least: int) -> None:
        reader = Reader(self)
        reader.do(name, (GUIDES / name).read_text(encoding="utf-8"))
        self.assertGreaterEqual(reader.ran, least, "blocks carried out")

    def test_draw_from_python(self) -> None:
        self.do("draw-from-python.md", 18)

    def test_draw_from_cpp(self) -> None:
        self.do("draw-from-cpp.md", 6)

    def test_own_lattice(self) -> None:
        self.do("own-lattice.md", 15)

    def test_own_rotor(self) -> None:
        self.do("own-rotor.md", 8)

    def test_firmware(self) -> None:
        self.do("firmware.md", 10)

    def test_what_the_readme_says_of_use_is_pasted_at_once(self) -> None:
        reader = Reader(self)
        (reader.folder / "tests").symlink_to(Path(os.environ["SOURCE"], "tests"))
        readme = Path(os.environ["SOURCE"], "README.md").read_text(encoding="utf-8")
        use = readme[readme.index("## Use\n"):]
        pasted = next(one.text for one in blocks(use) if "voxelctl play" in one.text)
        reader.serve("voxeld\n")
        self.assertIn("export PATH=$PWD/build/demo/bin:$PATH", pasted)
        # Fewer pictures; the pictures of a gallery are tested elsewhere.
        short = re.sub(r"(?m)^voxelctl gallery .*\n", "", pasted).replace("turn.gif", "turn.gif --frames 4")
        said = reader.shell(short)
        recorded = "voxelctl record --still build/preset.mcap"
        self.assertIn(f"`{recorded}`", use)
        said += reader.shell(f'voxelctl draw "sphere radius=0.5"\n{recorded}\n')
        for made in ("picture.png", "turn.gif", "scene.npz", "preset.mcap"):
            self.assertTrue((reader.folder / "build" / made).is_file(), said)

    def test_each_guide_has_its_test_and_no_link_of_theirs_is_dead(self) -> None:
        names = {path.name for path in GUIDES.glob("*.md")}
        self.assertEqual({name for name in names if not hasattr(self, "test_" + name[:-3].replace("-", "_"))}, set())
        for path in GUIDES.glob("*.md"):
            prose = re.sub(r"(?ms)^```.*?^```$", "", path.read_text(encoding="utf-8"))
            for target in re.findall(r"\]\((?!https?:)([^)#]+)", prose):
                self.assertTrue((path.parent / target).exists(), f"{path.name}: {target}")


class WhatIsExpected(unittest.TestCase):
    def test_is_found_in_its_order_with_any_numbers(self) -> None:
        self.assertIsNone(unsaid("a 12\nb … d\n", "x\nsaid: a 13.5\nc\nb 7 d\n"))
        self.assertEqual(unsaid("b\na\n", "a\nb\n"), "a")
        self.assertEqual(unsaid("ten 10\n", "ten none\n"), "ten 10")
        self.assertEqual(unsaid("sent 00 01 02 03 04\n", "sent 00 01 02 03 05\n"), "sent 00 01 02 03 04")

    def test_blocks(self) -> None:
        read = blocks("Save as `a.py`:\n\n```python\nx = 1\n```\n```sh\nls `b.py`:\n```\ntext:\n```python\ny\n```\n")
        self.assertEqual([(one.kind, one.file, one.text) for one in read], [("python", "a.py", "x = 1\n"), ("sh", "", "ls `b.py`:\n"), ("python", "", "y\n")])


if __name__ == "__main__":
    unittest.main()
