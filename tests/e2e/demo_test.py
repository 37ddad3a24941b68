"""Tests `voxelctl demo` with the real daemon. Paths are in VOXELD and VOXELCTL; DATA is where tools/setup puts data."""
import json
import os
import shutil
import signal
import subprocess
import tempfile
import threading
import time
import unittest
from pathlib import Path

from polling import LONG, until

VOXELCTL = os.environ["VOXELCTL"]
DATA = os.environ["DATA"]
NAMES = ["globe", "earthquakes", "house", "engine", "brain", "molecule", "gyroid", "galaxy", "life", "clock"]
BY_CODE = ["gyroid", "galaxy", "life", "clock"]
DISPLAYS = {
    "lattice": "simulated,geometry=lattice,size=8x8x8,rate=30",
    "rotor": "simulated,geometry=rotor,size=32x16,slices=60,rate=30",
    "stack": "simulated,geometry=planar,size=32x32x16,rate=30",
}


class Daemon:
    """A voxeld with one display, selected by its name in DISPLAYS, or with all of them."""

    def __init__(self, test: unittest.TestCase, *displays: str) -> None:
        folder = tempfile.TemporaryDirectory()
        test.addCleanup(folder.cleanup)
        self.environment = {**os.environ, "VOXELD_SERVER": f"unix:{folder.name}/s", "HOME": folder.name}
        options = [word for name in displays for word in ("--display", f"{name}={DISPLAYS[name]}")]
        process = subprocess.Popen([os.environ["VOXELD"], "--listen", self.environment["VOXELD_SERVER"], "--http", "off", "--log-level", "warn", *options],
                                   env=self.environment, stdout=subprocess.DEVNULL)
        test.addCleanup(process.wait)
        test.addCleanup(process.terminate)
        until(lambda: self.run("displays").returncode == 0, "voxeld, listening")

    def run(self, *words: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run([VOXELCTL, *words], env=self.environment, capture_output=True, text=True, timeout=LONG, check=False)

    def json(self, *words: str) -> dict:
        done = self.run("--json", *words)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    def demo(self, *words: str, program: str = VOXELCTL) -> "subprocess.Popen[str]":
        return subprocess.Popen([program, "--json", "demo", *words], env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


class Demo(unittest.TestCase):
    def begins(self, playing: "subprocess.Popen[str]") -> dict:
        """Reads the next line that reports a scene; none may have been skipped."""
        assert playing.stdout is not None
        while True:
            line = playing.stdout.readline()
            self.assertTrue(line, "it ended")
            event = json.loads(line)
            self.assertNotIn("passed_over", event)
            if "seen" in event:
                return event

    def nothing_is_up(self, daemon: Daemon) -> None:
        self.assertEqual(daemon.json("entities").get("layers", []), [])

    def plays_all(self, *displays: str) -> None:
        daemon = Daemon(self, *displays)
        shown: dict[str, list[int]] = {}
        playing = daemon.demo("--once", "--seconds", "1.2", "--data", DATA)
        self.addCleanup(playing.wait)
        self.addCleanup(playing.kill)
        for name in NAMES:
            self.assertEqual(self.begins(playing)["scene"], name)
            time.sleep(0.4)  # it is captured while it moves
            shown[name] = [int(display["lit_voxels"]) for display in daemon.json("stats")["displays"]]
        words, errors = playing.communicate(timeout=LONG)
        self.assertEqual(playing.returncode, 0, errors)
        self.assertEqual(errors, "")
        for name, lit in shown.items():
            self.assertGreater(min(lit), 0, f"{name} is dark: {lit}")
        self.nothing_is_up(daemon)
        stats = daemon.json("stats")
        self.assertEqual([int(stats[key]) for key in ("commits_refused", "operations_refused")], [0, 0])

    def test_every_scene_is_seen_on_a_lattice(self) -> None:
        self.plays_all("lattice")

    def test_every_scene_is_seen_on_a_rotor_beside_a_stack(self) -> None:
        self.plays_all("rotor", "stack")

    def test_scenes_move(self) -> None:
        daemon = Daemon(self, "stack")
        done = daemon.run("--json", "demo", "--once", "--seconds", "2", "--data", DATA, "galaxy", "house")
        self.assertEqual(done.returncode, 0, done.stderr)
        ends = [event for event in map(json.loads, done.stdout.splitlines()) if "frames" in event]
        self.assertEqual([event["scene"] for event in ends], ["house", "galaxy"], "in the demo's order")
        for event in ends:
            self.assertGreater(event["frames"] / event["seconds"], 10, "twenty and more, but machines that test are busy")

    def test_a_named_one_stays_until_an_interrupt_and_goes_then(self) -> None:
        daemon = Daemon(self, "stack")
        playing = daemon.demo("life", "--seconds", "0.2")
        self.assertEqual(self.begins(playing)["scene"], "life")
        time.sleep(1)  # it stays: longer than its time in a sequence of scenes
        self.assertEqual(len(daemon.json("entities")["layers"]), 1)
        playing.send_signal(signal.SIGINT)
        words, errors = playing.communicate(timeout=LONG)
        self.assertEqual(playing.returncode, 0, errors)
        self.assertEqual([json.loads(line)["scene"] for line in words.splitlines()], ["life"], "it did not begin again")
        self.nothing_is_up(daemon)

    def test_they_go_round(self) -> None:
        daemon = Daemon(self, "lattice")
        playing = daemon.demo("clock", "gyroid", "--seconds", "0.3")
        self.assertEqual([self.begins(playing)["scene"] for _ in range(5)], ["gyroid", "clock", "gyroid", "clock", "gyroid"])
        playing.send_signal(signal.SIGTERM)
        playing.communicate(timeout=LONG)
        self.nothing_is_up(daemon)

    def test_what_voxelctl_put_up_before_goes_and_the_pattern_ends(self) -> None:
        daemon = Daemon(self, "stack")
        self.assertEqual(daemon.run("draw", "sphere radius=0.5").returncode, 0)
        self.assertEqual(daemon.run("pattern", "white").returncode, 0)
        done = daemon.run("demo", "galaxy", "--once", "--seconds", "0.5")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("galaxy: a spiral galaxy, turning (made up by code, no measured one)", done.stderr)
        self.nothing_is_up(daemon)

    def test_a_file_that_is_missing_or_wrong_is_told_and_the_others_play(self) -> None:
        daemon = Daemon(self, "lattice")
        with tempfile.TemporaryDirectory() as folder:
            # This copy has no build/data beside it.
            program = str(Path(folder) / "bin" / "x" / "voxelctl")
            Path(program).parent.mkdir(parents=True)
            shutil.copy(VOXELCTL, program)
            listed = {entry["scene"]: entry["missing"] for entry in json.loads(
                subprocess.run([program, "--json", "demo", "--list"], capture_output=True, text=True, check=True).stdout)}
            self.assertEqual(list(listed), NAMES)
            self.assertIn("tools/setup", listed["globe"])
            missing = [name for name in NAMES if listed[name]]
            playing = daemon.demo("--once", "--seconds", "0.2", program=program)
            words, errors = playing.communicate(timeout=LONG)
            self.assertEqual(playing.returncode, 0, errors)
            events = [json.loads(line) for line in words.splitlines()]
            told = {event["scene"]: event["passed_over"] for event in events if "passed_over" in event}
            self.assertEqual(list(told), missing)
            self.assertRegex(told["globe"], r"^tools/setup \(npm's world-atlas\) brings world-atlas/countries-50m.json or .*, which is in none of /.*$")
            self.assertEqual([event["scene"] for event in events if "seen" in event], [name for name in NAMES if name not in missing])

            told_in_words = subprocess.run([program, "demo", "--once", "--seconds", "0.2", "globe", "clock"], env=daemon.environment, capture_output=True,
                                           text=True, timeout=LONG, check=True)
            self.assertRegex(told_in_words.stderr, r"^globe: left out; tools/setup \(npm's world-atlas\) brings its data\nclock: ")

            alone = daemon.demo("globe", program=program)
            words, errors = alone.communicate(timeout=LONG)
            self.assertEqual(alone.returncode, 1)
            self.assertIn("none of these scenes can be played", errors)

            # It exists, but has other contents.
            (Path(folder) / "countries-50m.json").write_text("no map", encoding="utf-8")
            playing = daemon.demo("--once", "--seconds", "0.2", "--data", folder, "globe", "clock", program=program)
            words, errors = playing.communicate(timeout=LONG)
            self.assertEqual(playing.returncode, 0, errors)
            self.assertIn("countries-50m.json", json.loads(words.splitlines()[0])["passed_over"])
            self.assertIn('"clock"', words)

    def test_an_interrupt_at_any_time_leaves_nothing(self) -> None:
        daemon = Daemon(self, "stack")
        for wait in (0.0, 0.1, 0.3, 0.7):
            playing = daemon.demo("--seconds", "0.2", "--data", DATA)
            killer = threading.Timer(wait, playing.send_signal, (signal.SIGINT,))
            killer.start()
            _, errors = playing.communicate(timeout=LONG)
            killer.join()
            self.assertIn(playing.returncode, (0, 130, -signal.SIGINT), errors)
            self.nothing_is_up(daemon)


if __name__ == "__main__":
    unittest.main()
