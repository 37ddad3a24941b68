"""Tests which layers the commands of voxelctl remove, and whose: with a token that may draw, and with the layers that replay and pipe leave."""
import json
import os
import subprocess
import tempfile
import unittest
from pathlib import Path

from polling import LONG, until

VOXELCTL = os.environ["VOXELCTL"]


class Layers(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.server = f"unix:{self.folder}/s"
        grants, config = self.folder / "grants.toml", self.folder / "voxeld.toml"
        self.tokens = {}
        for name, scopes in (("painter", "view,draw"), ("other", "view,draw"), ("boss", "all")):
            made = subprocess.run([VOXELCTL, "token", name, "--scopes", scopes, "--grants", str(grants)], capture_output=True,
                                  text=True, timeout=LONG)
            self.assertEqual(made.returncode, 0, made.stderr)
            self.tokens[name] = made.stdout.strip()
        config.write_text(f'[server]\nlisten = ["{self.server}"]\nhttp = "off"\n[security]\ngrants = "{grants}"\n'
                          '[[display]]\nname = "sim"\ndriver = "simulated"\nsize = "24x24x16"\nrate = 100\n')
        self.daemon = subprocess.Popen([os.environ["VOXELD"], "--config", str(config), "--log-level", "warn"])
        self.addCleanup(self.end)
        until(lambda: self.run_as("boss", "displays").returncode == 0, "voxeld, listening")

    def end(self) -> None:
        self.daemon.kill()
        self.daemon.wait(LONG)

    def run_as(self, who: str, *arguments: str, input: bytes = b"") -> "subprocess.CompletedProcess[str]":
        done = subprocess.run([VOXELCTL, "--server", self.server, *arguments], input=input, capture_output=True, timeout=LONG,
                              env={**os.environ, "VOXELD_TOKEN": self.tokens[who]})
        return subprocess.CompletedProcess(done.args, done.returncode, done.stdout.decode(), done.stderr.decode())

    def does(self, who: str, *arguments: str, input: bytes = b"") -> str:
        done = self.run_as(who, *arguments, input=input)
        self.assertEqual(done.returncode, 0, (arguments, done.stderr))
        return done.stderr

    def scene(self) -> "tuple[list[tuple[int, str]], int]":
        told = json.loads(self.run_as("boss", "--json", "entities").stdout)
        return sorted((layer["owner"], layer["layer"]) for layer in told.get("layers", [])), len(told.get("entities", []))

    def test_a_painter_clears_its_own_and_is_told_what_stays(self) -> None:
        self.assertIn("cleared 0 entities in 0 layers\n", self.does("painter", "clear"))
        self.does("painter", "draw", "sphere radius=0.5", "mask: box size=1")
        said = self.does("painter", "clear")
        self.assertIn("cleared 2 entities in 2 layers\n", said)
        self.assertNotIn("stay", said)
        self.does("other", "draw", "box size=0.5")
        self.does("painter", "draw", "sphere radius=0.5")
        for options in ((), ("--all",), ("--layer", "voxelctl")):
            said = self.does("painter", "clear", *options)
            self.assertIn("another client's layer stays up: \"voxelctl\" of owner ", said)
            self.assertIn("; taking it down takes the scope control", said)
        self.assertEqual(self.scene()[1], 1)
        self.assertNotIn("stay", self.does("boss", "clear"))
        self.assertEqual(self.scene(), ([], 0))

    def test_what_a_painter_puts_up_replaces_its_own_beside_others(self) -> None:
        self.does("other", "draw", "box size=0.5")
        obj = self.folder / "flat.obj"
        obj.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        for command in (("draw", "sphere radius=0.5", "box size=0.2", "mask: box size=1", "clip_box size=1,1,1"),
                        ("draw", "torus radius=0.6 tube_radius=0.2"), ("play", str(obj)), ("draw", "sphere radius=0.5")):
            self.assertIn("another client's layer stays up: \"voxelctl\" of owner ", self.does("painter", *command))
            entities = 4 if "mask: box size=1" in command else 2
            self.assertEqual(self.scene()[1], entities, command)
            layers = json.loads(self.run_as("painter", "--json", "entities").stdout)["layers"]
            if entities == 2:
                self.assertFalse(any(layer.get("mask_layer") or layer.get("clip", {}).get("boxes") for layer in layers), command)
        said = self.does("painter", "gallery", str(self.folder / "gallery.png"))
        self.assertRegex(said, r'the pictures show what others have up too: "voxelctl" of owner \d+; without it')
        self.assertEqual(self.scene()[1], 1, "the painter's are gone")

    def test_gallery_takes_away_a_mask_too(self) -> None:
        self.does("boss", "draw", "sphere radius=0.5", "mask: box size=1")
        self.assertNotIn("others", self.does("boss", "gallery", str(self.folder / "gallery.png")))
        self.assertEqual(self.scene(), ([], 0))

    def test_draw_names_what_cannot_be_seen_and_why(self) -> None:
        said = self.does("painter", "draw", "sphere radius=0.3", "sphere radius=0.1 at=9,9,9", "box size=0.4 color=black")
        self.assertNotIn('nothing of "draw 1"', said)
        self.assertRegex(said, r'nothing of "draw 2" can be seen on display sim: .*outside')
        self.assertRegex(said, r'nothing of "draw 3" can be seen on display sim: .*black')
        # Details are requested for all of them, however many there are.
        many = [f"sphere radius=0.04 at={i / 10 - 0.95},0,0" for i in range(20)] + ["sphere radius=0.1 at=9,9,9"]
        told = json.loads(self.run_as("painter", "--json", "draw", *many).stdout)
        self.assertEqual(len(told["unseen"]), 1)

    def test_a_recording_of_an_empty_scene_is_warned_of(self) -> None:
        preset = str(self.folder / "empty.mcap")
        self.assertIn("warning: the scene was empty", self.does("boss", "record", "--still", preset))
        self.does("painter", "draw", "sphere radius=0.5")
        self.assertNotIn("warning", self.does("boss", "record", "--still", str(self.folder / "full.mcap")))
        playlist = self.folder / "list.toml"
        playlist.write_text(f'[[item]]\nfile = "{preset}"\nseconds = 0.2\n', encoding="utf-8")
        shown = subprocess.Popen([VOXELCTL, "--server", self.server, "playlist", str(playlist)], stderr=subprocess.PIPE, text=True,
                                 env={**os.environ, "VOXELD_TOKEN": self.tokens["boss"]})
        assert shown.stderr
        for line in shown.stderr:
            if "shows nothing: its scene is empty" in line:
                break
        else:
            self.fail("it ended without a warning")
        shown.terminate()
        shown.stderr.close()
        shown.wait(LONG)

    def test_what_replay_and_pipe_leave_is_cleared_and_a_second_replay_replaces(self) -> None:
        preset = str(self.folder / "logo.mcap")
        self.does("other", "draw", "sphere radius=0.5")
        self.assertRegex(self.does("boss", "record", "--still", preset), r"logo.mcap: 1 change, \d+ B|logo.mcap: 1 change, [0-9.]+ kB")
        self.does("boss", "clear")
        for who in ("painter", "painter", "boss"):  # with a token the owner is the same, without one it differs
            said = self.does(who, "replay", "--keep", preset)
            self.assertIn("replays", said)
            self.assertIn("one state of a scene", said)
            self.assertIn("logo.mcap: 1 change; what is up", said)
            self.assertIn("stays until `voxelctl clear`", said)
            layers, entities = self.scene()
            self.assertEqual(([name for _, name in layers], entities), (["logo: voxelctl"], 1))
        self.assertIn("another client's layer stays up: \"logo: voxelctl\"", self.does("other", "replay", "--keep", preset))
        self.assertEqual(self.scene()[1], 2)
        said = self.does("painter", "pipe", "--size", "2x2x2", "--keep", input=b"\xff" * 24)
        self.assertIn("1 picture of ", said)
        self.assertIn("the last stays up until `voxelctl clear`", said)
        self.assertEqual(self.scene()[1], 3)
        self.does("painter", "clear")
        self.assertEqual(self.scene()[1], 2)
        self.does("boss", "clear")
        self.assertEqual(self.scene(), ([], 0))
        self.assertIn("it is down again, --keep would leave it up", self.does("painter", "replay", preset))

    def test_what_runs_is_not_cleared(self) -> None:
        preset = str(self.folder / "logo.mcap")
        self.does("boss", "draw", "sphere radius=0.5")
        self.does("boss", "record", "--still", preset)
        self.does("boss", "clear")
        running = subprocess.Popen([VOXELCTL, "--server", self.server, "replay", "--step", preset], stdin=subprocess.PIPE,
                                   stderr=subprocess.DEVNULL, env={**os.environ, "VOXELD_TOKEN": self.tokens["boss"]})
        assert running.stdin is not None
        running.stdin.write(b"\n")
        running.stdin.flush()
        until(lambda: self.scene()[1] != 0, "the lights")
        self.does("boss", "clear")
        self.assertEqual(self.scene()[1], 1)
        running.communicate(b"\n", timeout=LONG)
        self.assertEqual((running.returncode, self.scene()[1]), (0, 0))

    def test_a_pattern_that_a_painter_may_not_end_is_told(self) -> None:
        self.does("boss", "pattern", "axes")
        said = self.does("painter", "draw", "sphere radius=0.5")
        self.assertIn("a test pattern hides the scene on sim; ending it takes the scope control", said)
        self.assertIn("a test pattern hides the scene", self.does("painter", "clear"))

    def test_who_may_only_look_is_refused(self) -> None:
        grants = self.folder / "grants.toml"
        grants.write_text(grants.read_text().replace('["view", "draw"]', '["view"]'))
        until(lambda: self.run_as("painter", "draw", "sphere radius=0.5").returncode != 0, "the file, which is looked at every second")
        self.does("boss", "draw", "sphere radius=0.5")
        refused = self.run_as("painter", "clear")
        self.assertEqual(refused.returncode, 1)
        self.assertIn("this takes the scope draw, and token painter has view", refused.stderr)


if __name__ == "__main__":
    unittest.main()
