"""Tests voxelctl top on a pseudo-terminal: what it shows, its keys, and that the terminal is restored however it ends."""
import fcntl
import json
import os
import re
import select
import signal
import struct
import subprocess
import termios
import time
import unittest
from typing import Callable

from quick_daemon import LONG, VOXELCTL, QuickDaemon


class Screen:
    """Renders what a VT100 would show of the bytes that curses sends."""

    def __init__(self, rows: int, columns: int) -> None:
        self.resize(rows, columns)
        self.colors: set[int] = set()
        self._rest = ""

    def resize(self, rows: int, columns: int) -> None:
        self.rows, self.columns = rows, columns
        self.cells = [[" "] * columns for _ in range(rows)]
        self.row = self.column = self.top = 0
        self.bottom = rows - 1

    def text(self) -> str:
        return "\n".join("".join(row).rstrip() for row in self.cells)

    def take(self, text: str) -> None:
        text = self._rest + text
        self._rest = ""
        at = 0
        while at < len(text):
            if text[at] == "\x1b":
                match = re.match(r"\x1b(\[[0-9;?]*[@-~]|[()][A-Za-z0-9]|[^\[()])", text[at:])
                if match is None:
                    self._rest = text[at:]
                    return
                self._escape(match.group(1))
                at += match.end()
                continue
            self._put(text[at])
            at += 1

    def _put(self, character: str) -> None:
        if character == "\r":
            self.column = 0
        elif character == "\n":
            if self.row == self.bottom:
                del self.cells[self.top]
                self.cells.insert(self.bottom, [" "] * self.columns)
            else:
                self.row = min(self.row + 1, self.rows - 1)
        elif character == "\b":
            self.column = max(self.column - 1, 0)
        elif character >= " " and self.row < self.rows and self.column < self.columns:
            self.cells[self.row][self.column] = character
            self.column += 1

    def _escape(self, code: str) -> None:
        if not code.startswith("["):
            if code == "M" and self.row == self.top:
                del self.cells[self.bottom]
                self.cells.insert(self.top, [" "] * self.columns)
            elif code == "M":
                self.row = max(self.row - 1, 0)
            return
        numbers = [int(number) if number.isdigit() else 0 for number in code[1:-1].lstrip("?").split(";")]
        count = max(numbers[0], 1)
        final = code[-1]
        if final == "H":
            self.row, self.column = max(numbers[0], 1) - 1, max(numbers[1] if len(numbers) > 1 else 1, 1) - 1
        elif final in "ABCD":
            self.row = min(max(self.row + {"A": -count, "B": count}.get(final, 0), 0), self.rows - 1)
            self.column = min(max(self.column + {"C": count, "D": -count}.get(final, 0), 0), self.columns - 1)
        elif final == "J":
            for row in range(self.row + 1 if numbers[0] == 0 else 0, self.rows):
                self.cells[row] = [" "] * self.columns
            if numbers[0] == 0:
                self.cells[self.row][self.column:] = [" "] * (self.columns - self.column)
        elif final == "K":
            begin, end = (self.column, self.columns) if numbers[0] == 0 else (0, self.column + 1)
            self.cells[self.row][begin:end] = [" "] * (end - begin)
        elif final == "r":
            self.top, self.bottom = count - 1, (numbers[1] if len(numbers) > 1 else self.rows) - 1
            self.row = self.column = 0
        elif final == "m":
            self.colors |= {number for number in numbers if 30 <= number <= 37}


class Top:
    """`voxelctl top` on a terminal of its own."""

    def __init__(self, test: unittest.TestCase, daemon: QuickDaemon, *options: str, terminal: str = "vt100", **environment: str) -> None:
        self._master, self.slave = os.openpty()
        self.screen = Screen(40, 110)
        self._size()
        self.before = termios.tcgetattr(self.slave)
        self.raw = b""
        self.process = subprocess.Popen(
            [VOXELCTL, "top", "--interval", "0.1", *options], stdin=self.slave, stdout=self.slave, stderr=self.slave, start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
            env={**daemon.environment, "TERM": terminal, "LC_ALL": "C.UTF-8", "NO_COLOR": "", **environment})
        test.addCleanup(os.close, self._master)
        test.addCleanup(os.close, self.slave)
        test.addCleanup(self.process.wait)
        test.addCleanup(self.process.kill)

    def _size(self) -> None:
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, struct.pack("HHHH", self.screen.rows, self.screen.columns, 0, 0))

    def resize(self, rows: int, columns: int) -> None:
        self.screen.resize(rows, columns)
        self._size()  # the kernel sends SIGWINCH

    def read(self, seconds: float = 0.05) -> None:
        while select.select([self._master], [], [], seconds)[0]:
            part = os.read(self._master, 1 << 16)
            self.raw += part
            self.screen.take(part.decode("utf-8", "replace"))

    def until(self, right: Callable[[str], object]) -> str:
        end = time.monotonic() + LONG
        while not right(self.screen.text()):
            assert time.monotonic() < end, f"it was never to be seen:\n{self.screen.text()}"
            assert self.process.poll() is None, f"it ended: {self.raw!r}"
            self.read()
        return self.screen.text()

    def press(self, keys: bytes) -> None:
        os.write(self._master, keys)

    def ended(self) -> int:
        end = time.monotonic() + LONG
        while self.process.poll() is None and time.monotonic() < end:
            self.read()
        self.read()
        return self.process.wait(LONG)


class TopTest(unittest.TestCase):
    def setUp(self) -> None:
        self.daemon = QuickDaemon()
        self.addCleanup(self.daemon.close)

    def draw(self) -> None:
        made = self.daemon.voxelctl("draw", "--add", "sphere radius=0.5")
        self.assertEqual(made.returncode, 0, made.stderr)

    def test_a_dashboard(self) -> None:
        self.draw()
        top = Top(self, self.daemon)
        text = top.until(lambda text: "CONNECTIONS" in text and "1 entity" in text)
        self.assertRegex(text, r"(?m)^voxeld \d+\.\d+\.\d+, up .*: 0 sessions, 1 layer, 1 entity")
        self.assertRegex(text, r"(?m)^ DISPLAY +STATE +ENGINE +VOLUMES/s +p50 +p99 +PRESENTED +SUPERSEDED +LOST$")
        self.assertRegex(text, r"(?m)^>stack +showing +cpu ")
        self.assertRegex(text, r"(?m)^ rotor +showing +cpu ")
        self.assertRegex(text, r"(?m)^LATENCY of stack +p50 +p99 +longest")
        self.assertRegex(text, r"(?m)^commit to presented +\d")
        self.assertRegex(text, r"(?m)^MEMORY \[#*\.+\] .* of 8\.59 GB: ")
        self.assertRegex(text, r"(?m)^OWNER +CLIENT +SESSIONS +LAYERS +ENTITIES +BYTES$")
        self.assertTrue(text.splitlines()[-1].startswith("q quit   p pause"))

        top.press(b"\t")
        text = top.until(lambda text: ">rotor" in text)
        self.assertIn("LATENCY of rotor", text)
        top.press(b"\x1bOA")  # up, as sent by a keypad in its mode
        top.until(lambda text: ">stack" in text)

        top.press(b"p")
        top.until(lambda text: "PAUSED" in text)
        self.draw()
        top.read(0.5)
        self.assertIn("1 entity", top.screen.text(), "nothing moves")
        top.press(b"p")
        top.until(lambda text: "2 entities" in text and "PAUSED" not in text)

        top.resize(12, 50)
        text = top.until(lambda text: text.splitlines()[-1].startswith("q quit") and ">stack" in text)
        self.assertLessEqual(max(len(line) for line in text.splitlines()), 50)
        self.assertNotIn("OWNER", text)
        top.press(b"q")
        self.assertEqual(top.ended(), 0)
        self.assertEqual(termios.tcgetattr(top.slave), top.before)

    def test_the_display_that_was_named_is_first(self) -> None:
        top = Top(self, self.daemon, "--display", "rotor")
        top.until(lambda text: ">rotor" in text)

    def test_the_terminal_is_as_it_was_whatever_ends_it(self) -> None:
        ends: list[tuple[str, Callable[[Top], object], int]] = [
            ("q", lambda top: top.press(b"q"), 0),
            ("Ctrl-C", lambda top: top.press(b"\x03"), 0),
            ("Ctrl-C in haste", lambda top: top.press(b"\x03\x03\x03"), 0),
            ("SIGINT", lambda top: top.process.send_signal(signal.SIGINT), 0),
            ("SIGTERM", lambda top: top.process.send_signal(signal.SIGTERM), 0),
            ("Ctrl-\\", lambda top: top.press(b"\x1c"), -signal.SIGQUIT),
            ("SIGHUP", lambda top: top.process.send_signal(signal.SIGHUP), -signal.SIGHUP),
            ("SIGSEGV", lambda top: top.process.send_signal(signal.SIGSEGV), -signal.SIGSEGV)]
        for name, end, code in ends:
            with self.subTest(name):
                top = Top(self, self.daemon, terminal="xterm-256color")
                while b"CONNECTIONS" not in top.raw:
                    top.read()
                self.assertNotEqual(termios.tcgetattr(top.slave), top.before)
                self.assertIn(b"\x1b[?1049h", top.raw)
                end(top)
                self.assertEqual(top.ended(), code)
                self.assertEqual(termios.tcgetattr(top.slave), top.before)
                last = top.raw.rindex(b"\x1b[?1049l")
                self.assertGreater(last, top.raw.rindex(b"\x1b[?1049h"), "the other screen is left")
                self.assertGreater(top.raw.rindex(b"\x1b[?25h"), top.raw.rindex(b"\x1b[?25l"), "the cursor is shown")

    def test_colours_are_for_who_wants_them(self) -> None:
        for no_color, expected in (("", True), ("1", False)):
            top = Top(self, self.daemon, terminal="xterm-color", NO_COLOR=no_color)
            top.until(lambda text: "CONNECTIONS" in text)
            top.press(b"q")
            self.assertEqual(top.ended(), 0)
            self.assertEqual(bool(top.screen.colors), expected, no_color)

    def test_the_server_may_go_and_come(self) -> None:
        top = Top(self, self.daemon)
        top.until(lambda text: "CONNECTIONS" in text)
        self.daemon.process.kill()
        self.daemon.process.wait(LONG)
        text = top.until(lambda text: "nothing comes: " in text)
        self.assertIn(">stack", text, "what there was stays to be seen")
        self.daemon.start()
        top.until(lambda text: "nothing comes: " not in text)
        top.press(b"q")
        self.assertEqual(top.ended(), 0)

    def test_a_terminal_without_a_cursor_has_tables(self) -> None:
        for terminal in ("dumb", "no-such-terminal"):
            top = Top(self, self.daemon, terminal=terminal)
            while top.raw.count(b" DISPLAY ") < 2:
                top.read()
            self.assertNotIn(b"PAUSED", top.raw)
            top.press(b"\x03")
            self.assertEqual(top.ended(), 0)
            self.assertEqual(termios.tcgetattr(top.slave), top.before)

    def test_without_a_terminal_there_are_tables(self) -> None:
        once = self.daemon.voxelctl("top", "--once")
        self.assertEqual((once.returncode, once.stderr), (0, ""))
        self.assertRegex(once.stdout, r"(?m)^ rotor +showing")
        self.assertNotIn("\x1b", once.stdout)
        document = json.loads(self.daemon.voxelctl("--json", "top", "--once").stdout)
        self.assertEqual([display["name"] for display in document["stats"]["displays"]], ["stack", "rotor"])
        self.assertEqual(document["owners"], [])
        for options, is_one in (([], lambda line: line.startswith(" DISPLAY")), (["--json"], lambda line: "stats" in json.loads(line))):
            process = subprocess.Popen([VOXELCTL, "top", "--interval", "0.1", *options], env=self.daemon.environment, stdin=subprocess.DEVNULL,
                                       stdout=subprocess.PIPE, text=True)
            self.addCleanup(process.wait)
            self.addCleanup(process.kill)
            assert process.stdout is not None
            self.addCleanup(process.stdout.close)
            seen = 0
            while seen < 3:
                line = process.stdout.readline()
                self.assertTrue(line)
                seen += bool(line.strip()) and bool(is_one(line))
            process.send_signal(signal.SIGINT)
            process.stdout.read()
            self.assertEqual(process.wait(LONG), 0)


if __name__ == "__main__":
    unittest.main()
