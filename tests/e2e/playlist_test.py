"""Tests presets and playlists with the real daemon. Paths are in VOXELD and VOXELCTL."""
import datetime
import json
import os
import signal
import subprocess
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np
import voxeld as voxel

from operate_test import DISPLAY, LONG, Daemon, voxelctl


class Playlists(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.socket = f"unix:{self.folder}/voxeld.sock"
        self.config = f'[server]\nlisten = ["{self.socket}"]\nhttp = "off"\n{DISPLAY}'

    def daemon(self, *options: str) -> Daemon:
        daemon = Daemon(self.config, *options)
        self.addCleanup(daemon.__exit__, None, None, None)
        return daemon

    def presets(self) -> None:
        """Writes presets: a.mcap has a layer "ball", b.mcap a layer "cube", which by itself is half as bright."""
        with voxel.connect(self.socket, timeout=LONG, autocommit=False) as v:
            v.layer("ball").sphere("it", radius=0.7, color="red")
            v.commit().wait(LONG)
            self.preset("a.mcap")
        with voxel.connect(self.socket, timeout=LONG, autocommit=False) as v:
            v.layer("cube", opacity=0.5).box("it", size=0.9, color="blue")
            v.commit().wait(LONG)
            self.preset("b.mcap")

    def preset(self, name: str) -> None:
        done = voxelctl("--server", self.socket, "--json", "record", "--still", str(self.folder / name))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["change_sets"], 1)

    def write(self, text: str) -> str:
        path = self.folder / "list.toml"
        path.write_text(text, encoding="utf-8")
        return str(path)

    def test_one_fades_into_the_next_and_all_goes_at_the_end(self) -> None:
        self.daemon()
        self.presets()
        seen: list[dict[str, int]] = []
        with voxel.connect(self.socket, timeout=LONG) as v:
            def watch() -> None:
                now: dict[tuple[int, str], int] = {}
                for change in v.watch_scene(timeout=LONG):
                    for layer in change.layers:
                        now[layer.owner, layer.layer] = layer.opacity
                    for key in change.removed_layers:
                        now.pop((key.owner, key.layer), None)
                    seen.append({name.split(": ")[1]: opacity for (_, name), opacity in now.items() if ": " in name})
                    if len(seen) > 20 and not now:
                        return

            watcher = threading.Thread(target=watch)
            watcher.start()
            done = voxelctl("--server", self.socket, "--json", "playlist", self.write(
                'cross_fade = 1\nloop = false\n[[item]]\nfile = "a.mcap"\nseconds = 0.5\n[[item]]\nfile = "b.mcap"\nseconds = 0.5\n'))
            self.assertEqual(done.returncode, 0, done.stderr)
            watcher.join(LONG)
            self.assertFalse(watcher.is_alive(), seen[-3:])
            self.assertEqual([Path(json.loads(line)["file"]).name for line in done.stdout.splitlines()], ["a.mcap", "b.mcap"])
            self.assertEqual(v.entities(), [])
        balls = [state.get("ball", 0) for state in seen]
        cubes = [state.get("cube", 0) for state in seen]
        self.assertEqual(max(balls), 255)
        self.assertEqual(max(cubes), 128, "half as bright, as it was recorded")
        both = [(state["ball"], state["cube"]) for state in seen if {"ball", "cube"} <= state.keys()]
        self.assertGreater(len(both), 8, "a second, thirty times a second, if the machine is quick")
        self.assertEqual([ball for ball, _ in both], sorted((ball for ball, _ in both), reverse=True))
        self.assertEqual([cube for _, cube in both], sorted(cube for _, cube in both))
        self.assertTrue(any(60 < ball < 200 and 30 < cube < 100 for ball, cube in both), both)
        self.assertLess(min(ball for ball in balls if ball > 0), 60, "it came up from the dark")

    def test_a_preset_that_is_kept_is_there_when_the_daemon_starts(self) -> None:
        state = ("--state-dir", str(self.folder / "state"))
        first = self.daemon(*state)
        self.presets()
        done = voxelctl("--server", self.socket, "--json", "replay", "--keep", str(self.folder / "a.mcap"))
        self.assertEqual(done.returncode, 0, done.stderr)
        snapshot = json.loads(done.stdout.splitlines()[-1])["snapshot"]
        with voxel.connect(self.socket, timeout=LONG) as v:
            shown = v.capture(at_least_snapshot=snapshot, timeout=LONG).rgb.copy()
        self.assertGreater(int(shown.sum()), 0)
        self.assertEqual(first.stop(), 0)
        self.daemon(*state)
        with voxel.connect(self.socket, timeout=LONG) as v:
            np.testing.assert_array_equal(v.capture(timeout=LONG).rgb, shown)

    def test_what_cannot_be_played_is_passed_over_or_told(self) -> None:
        self.daemon()
        self.presets()
        some = voxelctl("--server", self.socket, "playlist", self.write(
            'cross_fade = 0\nloop = false\n[[item]]\nfile = "gone.mcap"\n[[item]]\nfile = "b.mcap"\nseconds = 0.2\n'))
        self.assertEqual(some.returncode, 0, some.stderr)
        self.assertIn("gone.mcap is passed over", some.stderr)
        none = voxelctl("--server", self.socket, "playlist", self.write('[[item]]\nfile = "b.mcap"\n'))
        self.assertEqual(none.returncode, 1)
        self.assertIn("give its item seconds", none.stderr)
        # Three files are missing, one of them scheduled for another time: none is waited for, and none is reported twice.
        tomorrow = "mon tue wed thu fri sat sun".split()[(datetime.date.today().weekday() + 2) % 7]
        gone = voxelctl("--server", self.socket, "playlist", self.write(
            '[[item]]\nfile = "gone.mcap"\nseconds = 1\n[[item]]\nfile = "lost.mcap"\n'
            f'[[item]]\nfile = "night.mcap"\ndays = ["{tomorrow}"]\nfrom = "10:00"\nto = "11:00"\n'))
        self.assertEqual(gone.returncode, 1, gone.stderr)
        self.assertEqual(gone.stderr.count("gone.mcap"), 2, gone.stderr)  # that it is skipped, and why
        self.assertRegex(gone.stderr, r"nothing of the playlist can be played:\nitem 2: .*lost\.mcap.*\nitem 3: .*night\.mcap")
        # A file that can be played at its scheduled time is waited for; meanwhile a missing one is reported once.
        waits = self.write(f'cross_fade = 0\n[[item]]\nfile = "gone.mcap"\nseconds = 1\n[[item]]\nfile = "b.mcap"\nseconds = 1\ndays = ["{tomorrow}"]\n')
        with subprocess.Popen([os.environ["VOXELCTL"], "--server", self.socket, "playlist", waits], stderr=subprocess.PIPE, text=True) as waiting:
            assert waiting.stderr is not None
            self.assertIn("gone.mcap is passed over", waiting.stderr.readline())
            waiting.send_signal(signal.SIGINT)
            self.assertEqual(waiting.wait(LONG), 0)
            self.assertNotIn("gone.mcap", waiting.stderr.read())
        checked = voxelctl("playlist", "--check", self.write(
            '[[item]]\nfile = "gone.mcap"\n[[item]]\nfile = "a.mcap"\n[[item]]\nfile = "b.mcap"\nseconds = 1\n'))
        self.assertEqual(checked.returncode, 1)
        self.assertRegex(checked.stdout, r"^3 items; now it begins with .*b\.mcap\n$")
        self.assertIn("list.toml: several items cannot be played and would be passed over:\nitem 1: ", checked.stderr)
        self.assertIn("gone.mcap", checked.stderr)
        self.assertRegex(checked.stderr, r"item 2: .*a\.mcap is one state of a scene; give its item seconds")
        checked = voxelctl("playlist", "--check", self.write('[[item]]\nfile = "gone.mcap"\n'))
        self.assertIn("1 item; now nothing is on", checked.stdout)
        wrong = voxelctl("playlist", "--check", self.write('[[item]]\nfile = "b.mcap"\nseconds = 0\nspeed = "x"\n'))
        self.assertEqual(wrong.returncode, 1)
        self.assertRegex(wrong.stderr, r"list.toml:3:11: seconds is 0")
        self.assertRegex(wrong.stderr, r"list.toml:4:9: speed is")

    def test_each_has_its_hours_and_an_interrupt_ends_it(self) -> None:
        self.daemon()
        self.presets()
        now = datetime.datetime.now()
        later = [(now + datetime.timedelta(hours=hours)).strftime("%H:%M") for hours in (2, 4)]
        path = self.write(f'[[item]]\nfile = "a.mcap"\nseconds = 5\nfrom = "{later[0]}"\nto = "{later[1]}"\n'
                          '[[item]]\nfile = "b.mcap"\nseconds = 5\n')
        check = voxelctl("--json", "playlist", "--check", path)
        self.assertEqual(Path(json.loads(check.stdout)["first_now"]).name, "b.mcap")
        playing = subprocess.Popen([os.environ["VOXELCTL"], "--server", self.socket, "--json", "playlist", path],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert playing.stdout is not None
        self.assertEqual(Path(json.loads(playing.stdout.readline())["file"]).name, "b.mcap")
        began = time.monotonic()
        playing.send_signal(signal.SIGINT)
        _, words = playing.communicate(timeout=LONG)
        self.assertIn(playing.returncode, (0, 130), words)
        self.assertLess(time.monotonic() - began, 4)
        with voxel.connect(self.socket, timeout=LONG) as v:
            self.assertEqual(v.entities(), [])


if __name__ == "__main__":
    unittest.main()
