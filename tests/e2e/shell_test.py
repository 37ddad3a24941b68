"""Tests how the programs appear in a shell and in manuals: completions, by bash itself, and manual pages."""
import os
import re
import select
import shutil
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

from quick_daemon import LONG, VOXELCTL, QuickDaemon

COMPLETE = """
source "$1"
COMP_LINE=$3 COMP_POINT=${#3}
_voxelctl "$2" '' ''
(( ${#COMPREPLY[@]} == 0 )) || printf '%s\\n' "${COMPREPLY[@]}"
"""


def written(*arguments: str) -> str:
    return subprocess.run([VOXELCTL, *arguments], capture_output=True, text=True, check=True, timeout=LONG).stdout


class Completions(unittest.TestCase):
    daemon: QuickDaemon

    @classmethod
    def setUpClass(cls) -> None:
        cls.daemon = QuickDaemon()
        cls.addClassCleanup(cls.daemon.close)
        cls.script = cls.daemon.folder / "voxelctl.bash"
        cls.script.write_text(written("completion", "bash"), encoding="utf-8")
        made = cls.daemon.voxelctl("draw", "sphere radius=0.5")
        assert made.returncode == 0, made.stderr

    def complete(self, line: str, program: str = VOXELCTL, **environment: str) -> list[str]:
        """Returns what bash would substitute for the last word, or for its part after a colon or an equals sign."""
        made = subprocess.run(["bash", "-c", COMPLETE, "bash", str(self.script), program, line], cwd=self.daemon.folder,
                              env={**self.daemon.environment, **environment}, capture_output=True, text=True, timeout=LONG)
        self.assertEqual((made.returncode, made.stderr), (0, ""))
        return made.stdout.splitlines()

    def test_commands_options_and_values(self) -> None:
        self.assertEqual(self.complete("voxelctl pl"), ["play", "playlist"])
        commands = self.complete("voxelctl ")
        for command in ("render", "export", "top", "completion"):
            self.assertIn(command, commands)
        self.assertFalse([command for command in commands if command.startswith("_")], "what is hidden is not offered")
        self.assertEqual(self.complete("voxelctl --serv"), ["--server"])
        self.assertEqual(self.complete("voxelctl play a.obj --sp"), ["--spin"])
        self.assertEqual(self.complete("voxelctl play --up "), ["auto", "x", "y", "z"])
        self.assertEqual(self.complete("voxelctl play --fill=s"), ["surface"], "readline has cut the word at =")
        self.assertEqual(self.complete("voxelctl --json set --blank o"), ["on", "off"])
        self.assertEqual(self.complete("voxelctl pattern po"), ["posts"])
        self.assertEqual(self.complete("voxelctl input e"), ["e131"])
        self.assertEqual(self.complete("voxelctl nonsense "), [])
        self.assertEqual(self.complete("voxelctl stats --interval "), [])

    def test_every_command_has_its_options(self) -> None:
        for command in self.complete("voxelctl "):
            offered = self.complete(f"voxelctl {command} --")
            for name in re.findall(r"(?m)^  (?:-h,)?(--[a-z-]+)", written(command, "--help")):
                self.assertIn(name, offered, command)

    def test_live_names(self) -> None:
        self.assertEqual(self.complete("voxelctl snapshot --display "), ["rotor", "stack"])
        self.assertEqual(self.complete("voxelctl snapshot a.png --display=st"), ["stack"])
        self.assertEqual(self.complete("voxelctl clear --layer v"), ["voxelctl"])
        self.assertEqual(self.complete("voxelctl why "), [r"draw\ 1"])
        self.assertEqual(self.complete(f"voxelctl --server {self.daemon.server} stats --disp", VOXELD_SERVER=""), [])
        self.assertEqual(self.complete(f"voxelctl --server {self.daemon.server} render --display r", VOXELD_SERVER="unix:/nobody"), ["rotor"])
        self.assertEqual(self.complete(f"voxelctl --server={self.daemon.server} render --display r", VOXELD_SERVER="unix:/nobody"), ["rotor"])

    def test_nobody_there_is_silence_and_soon(self) -> None:
        began = time.monotonic()
        self.assertEqual(self.complete("voxelctl snapshot --display ", VOXELD_SERVER=f"unix:{self.daemon.folder}/nobody"), [])
        self.assertLess(time.monotonic() - began, 5)
        made = subprocess.run([VOXELCTL, "--server", "unix:/nobody", "__complete", "displays"], capture_output=True, text=True, timeout=LONG)
        self.assertEqual((made.returncode, made.stdout, made.stderr), (0, "", ""))

    def test_files(self) -> None:
        for name in ("a.mcap", "b.txt"):
            (self.daemon.folder / name).touch()
        (self.daemon.folder / "dir").mkdir()
        self.assertEqual(sorted(self.complete("voxelctl replay ")), ["a.mcap", "dir"])
        self.assertIn("b.txt", self.complete("voxelctl play "))

    def test_names_of_others_run_nothing(self) -> None:
        fake = self.daemon.folder / "fake"
        fake.write_text("#!/bin/sh\necho 'a $(touch pwned); b'\n", encoding="utf-8")
        fake.chmod(0o755)
        self.assertEqual(self.complete("voxelctl snapshot --display ", str(fake)), [r"a\ \$\(touch\ pwned\)\;\ b"])
        self.assertFalse((self.daemon.folder / "pwned").exists())

    def test_the_other_shells_can_read_theirs(self) -> None:
        for shell in ("zsh", "fish"):
            with self.subTest(shell):
                if shutil.which(shell) is None:
                    self.fail(f"{shell} not found; run tools/setup --test")
                path = self.daemon.folder / f"script.{shell}"
                path.write_text(written("completion", shell), encoding="utf-8")
                made = subprocess.run([shell, "-n", str(path)], capture_output=True, text=True, timeout=LONG)
                self.assertEqual((made.returncode, made.stdout + made.stderr), (0, ""))
        path = self.daemon.folder / "script.fish"
        made = subprocess.run(["fish", "--no-config", "-c", f"source {path}; complete -C '{VOXELCTL} play --up '"],
                              env={**self.daemon.environment, "PATH": f"{Path(VOXELCTL).parent}:{os.environ['PATH']}"},
                              capture_output=True, text=True, timeout=LONG)
        self.assertIn("auto", made.stdout.split())

    def test_zsh_completes(self) -> None:
        if shutil.which("zsh") is None:
            self.fail("zsh not found; run tools/setup --test")
        master, slave = os.openpty()
        self.addCleanup(os.close, master)
        environment = {**self.daemon.environment, "TERM": "vt100", "PATH": f"{Path(VOXELCTL).parent}:{os.environ['PATH']}"}
        zsh = subprocess.Popen(["zsh", "-f", "-i"], stdin=slave, stdout=slave, stderr=slave, env=environment, start_new_session=True,
                               cwd=self.daemon.folder)
        os.close(slave)
        self.addCleanup(zsh.wait)
        self.addCleanup(zsh.kill)
        said = ""

        def until(words: str) -> None:
            nonlocal said
            end = time.monotonic() + LONG
            while words not in said:
                if select.select([master], [], [], 0.1)[0]:
                    said += re.sub(r"\x1b\[[0-9;?]*[A-Za-z]|\x1b[()=>]|\x0f", "", os.read(master, 1 << 16).decode("utf-8", "replace"))
                assert time.monotonic() < end, f"{words!r} is not in {said!r}"

        os.write(master, b"autoload -U compinit; compinit -u -D; source <(voxelctl completion zsh); echo rea''dy\n")
        until("ready")
        for typed, completed in (("snapshot --display r", "rotor"), ("snapshot a.png --display=st", "stack"), ("clear --layer vo", "--layer voxelctl"),
                                 ("play --fill su", "surface"), ("pattern pos", "posts")):
            said = ""
            os.write(master, f"voxelctl {typed}\t".encode())
            until(completed)
            os.write(master, b"\x15")

    def test_an_unknown_shell_is_told(self) -> None:
        made = subprocess.run([VOXELCTL, "completion", "bsh"], capture_output=True, text=True, timeout=LONG)
        self.assertEqual(made.returncode, 2)
        self.assertIn("did you mean bash?", made.stderr)


class Manual(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        environment = {**os.environ, "SOURCE_DATE_EPOCH": "86400"}
        subprocess.run([VOXELCTL, "__manual", str(self.folder)], env=environment, check=True, timeout=LONG)
        page = subprocess.run([os.environ["VOXELD"], "--help-man"], env=environment, capture_output=True, check=True, timeout=LONG).stdout
        (self.folder / "voxeld.8").write_bytes(page)

    def test_there_is_a_page_of_every_command(self) -> None:
        pages = {path.name for path in self.folder.iterdir()}
        for command in ("play", "render", "export", "top", "completion"):
            self.assertIn(f"voxelctl-{command}.1", pages)
        self.assertFalse([name for name in pages if "__" in name])
        first = (self.folder / "voxelctl.1").read_text(encoding="ascii")
        self.assertTrue(first.startswith('.TH "VOXELCTL" "1" "1970\\-01\\-02"') or first.startswith('.TH "VOXELCTL" "1" "1970-01-02"'), first[:60])
        self.assertIn(r"\fB\-\-listen\fR \fIADDR\fR", (self.folder / "voxeld.8").read_text(encoding="ascii"))

    def test_mandoc_finds_nothing(self) -> None:
        if shutil.which("mandoc") is None:
            self.fail("mandoc not found; run tools/setup --test")
        for path in sorted(self.folder.iterdir()):
            made = subprocess.run(["mandoc", "-T", "lint", str(path)], capture_output=True, text=True, timeout=LONG)
            self.assertEqual(made.stdout + made.stderr, "", path.name)

    def test_man_shows_them(self) -> None:
        if shutil.which("man") is None:
            self.fail("man not found; run tools/setup --test")
        for path in sorted(self.folder.iterdir()):
            made = subprocess.run(["man", "--warnings", "-l", str(path)], env={**os.environ, "MANWIDTH": "100", "LC_ALL": "C.UTF-8"},
                                  capture_output=True, text=True, timeout=LONG)
            self.assertEqual(made.returncode, 0, made.stderr)
            self.assertEqual(made.stderr, "", path.name)
            self.assertIn(path.stem, made.stdout)


class StandardOutput(unittest.TestCase):
    def test_output_that_cannot_be_written_is_an_error(self) -> None:
        for program in (VOXELCTL, os.environ["VOXELD"]):
            for arguments in (["--help"], ["--version"]):
                with self.subTest(f"{program} {arguments}"), open("/dev/full", "wb") as full:
                    made = subprocess.run([program, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, check=False, timeout=LONG)
                    self.assertEqual(made.returncode, 1)
                    self.assertIn("standard output could not be written", made.stderr)

    def test_a_reader_that_goes_away_is_no_error(self) -> None:
        reader, writer = os.pipe()
        os.close(reader)
        made = subprocess.run([VOXELCTL, "--help"], stdout=writer, stderr=subprocess.PIPE, text=True, check=False, timeout=LONG)
        os.close(writer)
        self.assertEqual((made.returncode, made.stderr), (0, ""))


if __name__ == "__main__":
    unittest.main()
