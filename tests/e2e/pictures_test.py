"""Tests voxelctl's pictures of real displays: turntables, and files for other programs. Paths are in VOXELD and VOXELCTL."""
import json
import signal
import subprocess
import unittest
from typing import Any

import numpy as np

from polling import until
from quick_daemon import LONG, VOXELCTL, QuickDaemon


class Pictures(unittest.TestCase):
    def setUp(self) -> None:
        self.daemon = QuickDaemon()
        self.addCleanup(self.daemon.close)
        made = self.daemon.voxelctl("draw", "box size=0.8 at=0.4,0.4,0.4 fill=solid color=red", "sphere radius=0.3 at=-0.5,-0.5,-0.5 color=#0000ff")
        self.assertEqual(made.returncode, 0, made.stderr)

    def told(self, *arguments: str) -> Any:
        made = self.daemon.voxelctl("--json", *arguments)
        self.assertEqual(made.returncode, 0, made.stderr)
        return json.loads(made.stdout)

    def path(self, name: str) -> str:
        return str(self.daemon.folder / name)

    def test_exports_are_what_a_snapshot_is_of(self) -> None:
        for display in ("stack", "rotor"):
            with self.subTest(display):
                lit = self.told("snapshot", self.path("a.png"), "--display", display)["lit_pixels"]
                self.assertGreater(lit, 50)
                npz = self.told("export", self.path("a.npz"), "--display", display)
                self.assertEqual((npz["display"], npz["items"], npz["lit_pixels"]), (display, lit, lit))
                with np.load(self.path("a.npz")) as data:
                    rgb, at, about = data["rgb"], data["positions_mm"], json.loads(data["metadata"].item())
                self.assertEqual(rgb.shape, (about["slices"], about["height"], about["width"], 3))
                lit_rgb = rgb[rgb.any(axis=3)]
                self.assertEqual((len(at), at.dtype, about["display"]), (lit, np.float32, display))
                # Red is where x, y and z are above the middle, blue where they are below.
                middle = np.array(about["grid"]["origin_mm"]) + np.array(about["grid"]["voxels"]) * np.array(about["grid"]["pitch_mm"]) / 2
                pitch = max(about["grid"]["pitch_mm"])
                red, blue = lit_rgb[:, 0] > 0, lit_rgb[:, 2] > 0
                self.assertTrue(red.any() and blue.any() and not (red & blue).any())
                self.assertTrue((at[red] > middle - 1.5 * pitch).all())
                self.assertTrue((at[blue] < middle + 1.5 * pitch).all())
                ply = self.told("export", self.path("a.ply"), "--display", display)
                self.assertEqual(ply["items"] + ply["left_out"], lit)
                header, points = (self.daemon.folder / "a.ply").read_bytes().split(b"end_header\n", 1)
                table = np.frombuffer(points, dtype=[("at", "<f4", 3), ("rgb", "u1", 3)])
                self.assertIn(b"element vertex %d\n" % lit, header)
                self.assertTrue(np.array_equal(table["at"], at) and np.array_equal(table["rgb"], lit_rgb))
                vox = self.told("export", self.path("a.vox"), "--display", display)
                self.assertEqual((vox["models"], vox["left_out"]), (1, 0))
                self.assertLessEqual(vox["items"], lit)
                self.assertGreater(vox["items"], 20)

    def test_a_vox_is_played_again(self) -> None:
        self.told("export", self.path("a.vox"))
        self.told("play", self.path("a.vox"))
        self.assertGreater(self.told("snapshot", self.path("a.png"))["lit_pixels"], 50)

    def test_turntables(self) -> None:
        gif = self.told("render", self.path("a.gif"), "--frames", "6", "--size", "96x80")
        self.assertEqual(gif["frames"], 6)
        self.assertEqual((self.daemon.folder / "a.gif").read_bytes()[:10], b"GIF89a" + (96).to_bytes(2, "little") + (80).to_bytes(2, "little"))
        self.told("render", self.path("#.png"), "--frames", "3", "--size", "64x64", "--live", "--display", "rotor")
        self.assertEqual([path.name for path in sorted(self.daemon.folder.glob("*.png"))], ["1.png", "2.png", "3.png"])

    def test_an_interrupt_leaves_no_file(self) -> None:
        process = subprocess.Popen([VOXELCTL, "render", self.path("a.gif"), "--frames", "10000", "--size", "512x512"],
                                   env=self.daemon.environment, stderr=subprocess.PIPE, text=True)
        assert process.stderr is not None
        self.addCleanup(process.stderr.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        until(lambda: list(self.daemon.folder.glob("a.gif.*.tmp")), "the picture's beginning")
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(LONG), 130)
        # reported as soon as it begins
        self.assertRegex(process.stderr.read(), r"\A(drawing 10000 pictures …\n)?voxelctl: interrupted\n\Z")
        self.assertEqual(list(self.daemon.folder.glob("a.gif*")), [])


if __name__ == "__main__":
    unittest.main()
