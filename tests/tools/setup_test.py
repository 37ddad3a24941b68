#!/usr/bin/env python3
"""Tests tools/setup, tools/jobs, tools/demo and .ci/run with fake commands: what they install, and their messages when something is missing.

Runs without root, network, packages or compiler: PATH is one folder of stubs and of links to the ordinary tools.

    python3 tests/tools/setup_test.py
"""
import json
import os
import pty
import re
import shutil
import stat
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
import progress  # noqa: E402

ORDINARY = ("awk basename bash cat chmod cp cut date dirname env find grep head id kill ln ls mkdir mktemp mv nproc paste printf rm sed seq sh sleep "
            "sort tail tar timeout touch tr uname wc").split()
MODULES = ["world-atlas", "three", "uplot", "esbuild"]  # of the default tier

# The plan that apt-get prints, as Debian 12's does.
PLAN = """The following NEW packages will be installed:
  a b c
0 upgraded, 201 newly installed, 0 to remove and 0 not upgraded.
Need to get 195 MB of archives.
After this operation, 933 MB of additional disk space will be used.
'http://mirror/a_1_amd64.deb' a_1_amd64.deb 150000000 MD5Sum:00
'http://mirror/b_1_amd64.deb' b_1_amd64.deb 45000000 MD5Sum:00
"""

VOXELD = """#!/usr/bin/env python3
import http.server, signal, sys
signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
port = int(sys.argv[sys.argv.index("--http") + 1].rsplit(":", 1)[1])
class Page(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response({page})
        self.end_headers()
    def log_message(self, *_): pass
http.server.HTTPServer(("127.0.0.1", port), Page).serve_forever()
"""

VOXELCTL = """#!/usr/bin/env python3
import json, signal, sys
words = sys.argv[1:]
globe = "{globe}"
if "--list" in words:
    print(json.dumps([{{"scene": "globe", "missing": globe}}, {{"scene": "house", "missing": ""}}, {{"scene": "galaxy", "missing": ""}}]))
elif "stats" in words:
    print(json.dumps({{"displays": [{{"lit_voxels": "{lit}", "volumes_presented": "30"}}]}}))
elif "snapshot" in words:
    print(json.dumps({{"file": words[words.index("snapshot") + 1], "volume": 1, "lit_pixels": "5"}}))
elif "demo" in words and "--once" in words:
    for scene in words[words.index("demo") + 1:words.index("--once")]: print(json.dumps({{"scene": scene, "frames": 9, "seconds": 4.0}}))
elif "demo" in words:
    print("plays " + " ".join(words[words.index("demo") + 1:words.index("--display")]), flush=True)
    signal.signal(signal.SIGINT, lambda *_: sys.exit(0))
    signal.pause()
"""


class Sandbox(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.clone = Path(folder.name) / "clone"
        self.path = Path(folder.name) / "path"
        self.called = Path(folder.name) / "called"  # one line for each call of a stub
        self.path.mkdir()
        (self.clone / "tools").mkdir(parents=True)
        for name in ("setup", "demo", "jobs", "progress.py"):
            shutil.copy(ROOT / "tools" / name, self.clone / "tools" / name)
        for name in ORDINARY:
            if found := shutil.which(name):
                (self.path / name).symlink_to(found)
        (self.path / "python3").symlink_to(sys.executable)
        self.environment = {"PATH": str(self.path), "HOME": folder.name, "LC_ALL": "C.UTF-8", "CUDA_PATH": folder.name, "CALLED": str(self.called),
                            "STUBS": folder.name}
        self.stub("id", "echo 0")
        self.installed("*")
        self.stub("apt-get", self.apt())
        self.stub("node", "exit 0")
        self.stub("npm", self.npm())

    def stub(self, name: str, script: str) -> None:
        file = self.path / name
        file.unlink(missing_ok=True)
        file.write_text(f'#!/bin/bash\necho "{name} $*" >>"$CALLED"\n{script}\n')
        file.chmod(0o755)

    def remove(self, name: str) -> None:
        (self.path / name).unlink(missing_ok=True)

    def installed(self, pattern: str) -> None:
        self.stub("dpkg-query", f'for name in "${{@:4}}"; do case "$name" in {pattern}) echo "installed $name" ;; esac; done')

    @staticmethod
    def apt(update: int = 0, install: int = 0) -> str:
        return (f'case " $* " in *" update "*) exit {update} ;; *" --print-uris "*) cat <<"END"\n{PLAN}END\n exit 0 ;; '
                f'*" install "*) [ {install} = 0 ] || echo "E: Unable to fetch some archives"; exit {install} ;; esac\nexit 1')

    @staticmethod
    def npm(status: int = 0) -> str:
        return f'exit {status}'

    def has_modules(self) -> None:
        table = (ROOT / "tools" / "setup").read_text(encoding="utf-8")
        for name, version in re.findall(r"(?m)^(?:run|test|dev) +(@?[\w/-]+)@([\d.]+) +\d+$", table):
            self.has_module(name, version)

    def has_module(self, name: str, version: str) -> None:
        file = self.clone / "build/data/node_modules" / name / "package.json"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps({"name": name, "version": version}), encoding="utf-8")

    def run_tool(self, name: str, *options: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run([str(self.clone / "tools" / name), *options], env=self.environment, capture_output=True, text=True, timeout=60, check=False,
                              stdin=subprocess.DEVNULL)

    def calls(self, program: str) -> "list[str]":
        if not self.called.exists():
            return []
        return [line for line in self.called.read_text(encoding="utf-8").splitlines() if line.split(" ", 1)[0] == program]


class Tiers(Sandbox):
    def listed(self, *tiers: str) -> "list[str]":
        done = self.run_tool("setup", *tiers, "--list")
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout.split()

    def test_default_tier_names_at_most_45_packages_and_no_importer_library(self) -> None:
        self.remove("node")
        default = self.listed()
        self.assertLessEqual(len(default), 45)
        self.assertEqual(len(default), len(set(default)))
        self.assertIn("nodejs", default)
        for heavy in ("npm", "libassimp-dev", "chromium", "clang-tidy-16", "ccache", "libgtest-dev", "libroscpp-dev", "tshark"):
            self.assertNotIn(heavy, default)

    def test_tiers_add_to_the_default_and_dev_has_all_but_qemu(self) -> None:
        default, dev = set(self.listed()), set(self.listed("--dev"))
        for tier in ("--import", "--ros", "--test", "--package"):
            packages = self.listed(tier)
            self.assertEqual(len(packages), len(set(packages)), tier)
            self.assertLess(default, set(packages), tier)
            self.assertLessEqual(set(packages), dev, tier)
        self.assertLessEqual(set(self.listed("--import")), set(self.listed("--test")))
        self.assertEqual(set(self.listed("--import", "--ros")), set(self.listed("--import")) | set(self.listed("--ros")))
        self.assertFalse(set(self.listed("--qemu")) <= dev)

    def test_node_from_elsewhere_is_used(self) -> None:
        self.assertNotIn("nodejs", self.listed())

    def test_unknown_option_is_refused(self) -> None:
        done = self.run_tool("setup", "--tests")
        self.assertEqual(done.returncode, 2)
        self.assertIn("unknown option '--tests'", done.stderr)

    def test_check_names_what_is_missing_in_that_tier_alone(self) -> None:
        self.has_modules()
        self.installed('libassimp-dev) ;; *')
        self.assertEqual(self.run_tool("setup", "--check").returncode, 0)
        done = self.run_tool("setup", "--import", "--check")
        self.assertEqual(done.returncode, 1)
        self.assertIn("missing packages: libassimp-dev", done.stderr)
        self.assertEqual(self.calls("apt-get"), [])


class Installing(Sandbox):
    def test_prints_the_plan_before_it_installs(self) -> None:
        self.has_modules()
        self.installed("none")
        done = self.run_tool("setup")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"setup: default tier: \d\d packages named, 201 to install with their dependencies, 195 MB to download, 933 MB on disk\n"
                                      r"setup: packages: g\+\+ clang-16 cmake ")
        words = [re.search(r" (update|--print-uris|install) ?", call)[1] for call in self.calls("apt-get")]
        self.assertEqual(words, ["update", "--print-uris", "install"])

    def test_does_nothing_the_second_time(self) -> None:
        self.has_modules()
        done = self.run_tool("setup")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("packages are installed", done.stdout)
        self.assertEqual(self.calls("apt-get") + self.calls("npm"), [])

    def test_without_root_and_sudo_it_says_what_to_run_as_root(self) -> None:
        self.stub("id", "echo 1000")
        self.installed("[a-l]*")
        done = self.run_tool("setup")
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, "needs root, and sudo is not installed; as root run: apt-get install --no-install-recommends .*ninja-build")
        self.assertEqual(self.calls("apt-get"), [])

    def test_without_root_sudo_runs_apt_get(self) -> None:
        self.has_modules()
        self.stub("id", "echo 1000")
        self.stub("sudo", 'exec "$@"')
        self.installed("none")
        self.assertEqual(self.run_tool("setup").returncode, 0)
        self.assertEqual(len(self.calls("sudo")), 2)

    def test_without_network_it_names_the_likely_cause(self) -> None:
        self.installed("none")
        self.stub("apt-get", self.apt(update=100, install=100))
        done = self.run_tool("setup")
        self.assertEqual(done.returncode, 1)
        self.assertIn("apt-get update failed (no network?)", done.stderr)
        self.assertIn("apt-get install failed; see", done.stderr)
        self.assertIn("E: Unable to fetch some archives", done.stderr)

    def test_without_package_lists_it_asks_for_a_network(self) -> None:
        self.installed("none")
        self.stub("apt-get", """case " $* " in *" update "*) echo "W: Failed to fetch http://mirror/ Temporary failure"; exit 0 ;; esac
echo "E: Unable to locate package cmake"; echo "E: Package 'g++' has no installation candidate"; exit 100""")
        done = self.run_tool("setup")
        self.assertEqual(done.returncode, 1)
        self.assertIn("apt-get update failed (no network?)", done.stderr)
        self.assertIn("no package lists for cmake g++; check the network connection and run tools/setup again", done.stderr)

    def test_a_package_that_debian_does_not_have_is_named(self) -> None:
        self.installed("none")
        self.stub("apt-get", 'case " $* " in *" update "*) exit 0 ;; esac\necho "E: Unable to locate package cmake"; exit 100')
        done = self.run_tool("setup")
        self.assertEqual(done.returncode, 1)
        self.assertIn("apt-get cannot install cmake; are Debian's main packages in /etc/apt/sources.list?", done.stderr)

    def test_without_apt_get_it_names_the_packages(self) -> None:
        self.installed("none")
        self.remove("apt-get")
        done = self.run_tool("setup")
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, r"apt-get not found; install the equivalents of these Debian packages with your package manager: g\+\+ ")


class Npm(Sandbox):
    def test_npm_that_fails_is_a_warning_by_default_and_an_error_for_tests(self) -> None:
        self.stub("npm", self.npm(status=1))
        done = self.run_tool("setup")
        self.assertEqual(done.returncode, 0)
        self.assertRegex(done.stderr, r"warning: npm could not download world-atlas@.* \(no network\?\)\. voxeld will be built without its web page, and the demo will have no globe")
        done = self.run_tool("setup", "--test")
        self.assertEqual(done.returncode, 1)
        self.assertIn("check the network connection and run tools/setup again", done.stderr)

    def test_without_npm_and_without_its_packages_the_default_tier_succeeds(self) -> None:
        self.remove("npm")
        self.stub("apt-cache", "exit 1")
        done = self.run_tool("setup")
        self.assertEqual(done.returncode, 0)
        self.assertIn("npm is not installed and could not be downloaded", done.stderr)
        self.assertIn("voxeld will be built without its web page", done.stderr)

    def test_default_tier_asks_for_four_modules_and_says_how_large(self) -> None:
        done = self.run_tool("setup")
        self.assertRegex(done.stdout, r"4 npm modules to install, 12 MB to download: world-atlas@")
        asked = [re.sub(r"@[^@]*$", "", word) for word in self.calls("npm")[0].split() if re.search(r".@\d", word)]
        self.assertEqual(asked, MODULES)

    def test_modules_that_are_there_are_asked_for_again_since_npm_would_remove_them(self) -> None:
        self.has_module("ws", "8.23.0")
        self.run_tool("setup")
        self.assertIn(" ws@8.23.0", self.calls("npm")[0])

    def test_debians_npm_is_unpacked_without_what_it_does_not_load(self) -> None:
        self.remove("npm")
        self.stub("apt-cache", """cat <<END
npm
  Depends: node-tar
  Depends: <node-cssesc>
    node-css-selector-tokenizer
  Depends: node-css-loader
  Depends: node-gyp
 |Depends: node-first
  Depends: node-second
  Depends: nodejs
node-tar
  Depends: node-yallist
node-css-loader
  Depends: webpack
  Depends: node-babel7
node-gyp
  Depends: node-build
END""")
        self.stub("apt-get", """for word in "$@"; do
  case "$word" in
    --print-uris) echo "'http://mirror/npm.deb' npm.deb 1500000 SHA256:0"; exit 0 ;;
    node-* | npm) touch "$word.deb" ;;
  esac
done""")
        self.stub("dpkg-deb", 'mkdir -p "$3/usr/share/nodejs/npm/bin" && touch "$3/usr/share/nodejs/npm/bin/npm-cli.js"')
        done = self.run_tool("setup")
        self.assertEqual(done.returncode, 0, done.stderr)
        names = "node-css-loader node-css-selector-tokenizer node-first node-gyp node-tar node-yallist npm"
        self.assertEqual(self.calls("apt-get"), [f"apt-get download --print-uris {names}", f"apt-get download -qq {names}"])
        self.assertIn("setup: npm is not installed; unpacking it into build/npm: 7 packages, 1.5 MB to download\n", done.stdout)
        self.assertRegex(self.calls("node")[0], r"^node build/npm/usr/share/nodejs/npm/bin/npm-cli.js install ")
        self.assertTrue((self.clone / "build/npm/usr/share/nodejs/node_modules/npm").is_dir())


class Cuda(Sandbox):
    def said(self) -> str:
        self.has_modules()
        return self.run_tool("setup").stdout

    def test_a_gpu_without_nvcc(self) -> None:
        self.stub("nvidia-smi", "exit 0")
        self.assertIn("found a GPU but no CUDA Toolkit (nvcc): voxeld will draw on the CPU", self.said())

    def test_nvcc_without_a_gpu(self) -> None:
        self.stub("nvcc", "exit 0")
        self.stub("nvidia-smi", "exit 9")
        self.assertIn("found the CUDA Toolkit but no GPU: voxeld will draw on the CPU", self.said())

    def test_neither_and_both_need_no_words(self) -> None:
        self.assertNotIn("GPU", self.said())
        self.stub("nvcc", "exit 0")
        self.stub("nvidia-smi", "exit 0")
        self.assertNotIn("GPU", self.said())


class Jobs(Sandbox):
    def jobs(self, cores: int, available_kb: int, limits: "dict[str, str]" = {}, own: str = "0::/\n") -> int:
        """`limits` maps each file below /sys/fs/cgroup to its contents. `own`: the contents of /proc/self/cgroup."""
        self.stub("nproc", f"echo {cores}")
        folder = Path(self.environment["STUBS"], "system")
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        (folder / "meminfo").write_text(f"MemTotal: 99999999 kB\nMemAvailable: {available_kb} kB\n", encoding="utf-8")
        (folder / "own").write_text(own, encoding="utf-8")
        for name, text in limits.items():
            (folder / "cgroup" / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / "cgroup" / name).write_text(text + "\n", encoding="utf-8")
        done = self.run_tool("jobs", str(folder / "meminfo"), str(folder / "own"), str(folder / "cgroup"))
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return int(done.stdout)

    def test_cores_and_memory_limit_the_jobs(self) -> None:
        self.assertEqual(self.jobs(2, 24_000_000), 2)
        self.assertEqual(self.jobs(16, 24_000_000), 16)
        self.assertEqual(self.jobs(16, 6_100_000), 4)
        self.assertEqual(self.jobs(4, 1_800_000), 1)
        self.assertEqual(self.jobs(4, 300_000), 1)

    def test_control_groups_limit_the_jobs(self) -> None:
        memory = 24_000_000
        self.assertEqual(self.jobs(8, memory, {"memory.max": "3200000000"}), 2, "a container's")
        self.assertEqual(self.jobs(8, memory, {"a/b/memory.max": "max", "a/memory.max": "3200000000"}, "0::/a/b\n"), 2, "one above")
        self.assertEqual(self.jobs(8, memory, {"a/memory.max": "1600000000", "memory.max": "9000000000"}, "0::/a\n"), 1, "the least")
        self.assertEqual(self.jobs(8, memory, {"memory/memory.limit_in_bytes": "3200000000"}, "4:memory:/docker/1\n0::/\n"), 2, "version 1")
        self.assertEqual(self.jobs(8, memory, {"memory/a/memory.limit_in_bytes": "1600000000"}, "9:cpu,memory:/a\n"), 1)
        self.assertEqual(self.jobs(8, memory, {"memory/memory.limit_in_bytes": "9223372036854771712"}, "4:memory:/\n"), 8, "no limit")
        self.assertEqual(self.jobs(8, memory, {"a/memory.max": "1600000000"}, "0::/b\n"), 8, "another's")


class Progress(unittest.TestCase):
    def test_estimates_the_time_left_from_the_steps_that_are_done(self) -> None:
        self.assertEqual(progress.left(100, 50, 150), "about 3 min left")
        self.assertEqual(progress.left(100, 100, 150), "about 50 s left")
        self.assertEqual(progress.left(100, 149, 150), "about 5 s left")

    def test_does_not_estimate_from_the_first_steps_alone(self) -> None:
        for elapsed_s, done, total in ((100, 1, 20), (100, 3, 150), (4, 75, 150)):
            self.assertEqual(progress.left(elapsed_s, done, total), "estimating the time left")


class ContinuousIntegration(Sandbox):
    """Runs .ci/run with a fake tools/test that fails for the stages in `failing` and otherwise runs `then`. `seconds`: the run time so far."""

    def ci(self, failing: str = "", seconds: int = 0, then: str = "") -> "tuple[int, dict[str, str]]":
        (self.clone / ".ci").mkdir(exist_ok=True)
        shutil.copy(ROOT / ".ci/run", self.clone / ".ci/run")
        test = self.clone / "tools/test"
        test.write_text('#!/bin/bash\nstage=test\n[ "${1:-}" != --stage ] || stage=$2\ncase " $FAILING " in *" $stage "*) exit 1 ;; esac\n' + then)
        test.chmod(0o755)
        (self.clone / "build/test-logs").mkdir(parents=True, exist_ok=True)
        done = subprocess.run([str(self.clone / ".ci/run")], env={**self.environment, "FAILING": failing, "SECONDS": str(seconds)},
                              capture_output=True, text=True, timeout=60, check=False)
        table = done.stdout.split("stage         build    tests  result\n")[1].splitlines()
        return done.returncode, {line[:10].strip(): line[30:] for line in table}

    def test_runs_all_stages(self) -> None:
        self.assertEqual(self.ci(), (0, dict.fromkeys(("test", "check", "tsan", "asan", "demo", "long", "hil"), "passed")))

    def test_table_shows_skipped_tests(self) -> None:
        skipping = 'mkdir -p build/test-logs; printf "%-10s %8s %8s  %s\\n" $stage 1.5 0.0 "1 skipped" >build/test-logs/$stage.row'
        self.assertEqual(self.ci(then=skipping)[1]["check"], "1 skipped")

    def test_goes_on_after_a_failure(self) -> None:
        status, table = self.ci("test asan")
        self.assertEqual(status, 1)
        self.assertEqual((table["test"], table["check"], table["asan"], table["hil"]), ("FAILED", "passed", "FAILED", "passed"))

    def test_long_tests_that_do_not_fit_are_left_out(self) -> None:
        # The default tests took 50 minutes, so demo is expected to take 20 minutes, and long and hil 30 and 27, but only 25 are left.
        status, table = self.ci(seconds=50 * 60)
        self.assertEqual((status, table["asan"], table["demo"]), (0, "passed", "passed"))
        for stage in ("long", "hil"):
            self.assertEqual(table[stage], "NOT RUN: not enough time left")

    def test_the_long_stages_take_turns(self) -> None:
        git = shutil.which("git")
        assert git is not None
        (self.path / "git").symlink_to(git)
        order = []
        for _ in range(40):  # The chance that all of these hashes have one parity is less than 10^-11.
            for words in (("init", "-q"), ("-c", "user.name=a", "-c", "user.email=a@b", "commit", "-q", "--allow-empty", "-m", str(len(order)))):
                subprocess.run([git, "-C", str(self.clone), *words], check=True)
            order.append(list(self.ci()[1])[-2:])
            if len(set(map(tuple, order))) == 2:
                break
        self.assertEqual({tuple(each) for each in order}, {("hil", "long"), ("long", "hil")})

    def test_required_stages_may_use_88_minutes(self) -> None:
        self.assertEqual(self.ci(seconds=80 * 60)[0], 0)

    def test_a_timeout_fails_the_run_only_in_a_required_stage(self) -> None:
        # A timeout of an optional stage is only reported; that of a required stage is a failure.
        timing_out = 'case " $TIMING_OUT " in *" $stage "*) exit 124 ;; esac\n'
        self.environment["TIMING_OUT"] = "demo hil"
        status, table = self.ci(then=timing_out)
        self.assertEqual((status, table["demo"], table["hil"], table["tsan"]), (0, "TIMED OUT", "TIMED OUT", "passed"))
        self.environment["TIMING_OUT"] = "tsan"
        status, table = self.ci(then=timing_out)
        self.assertEqual((status, table["tsan"], table["asan"]), (1, "TIMED OUT", "passed"))

    def test_a_sanitizer_that_was_not_run_is_a_failure(self) -> None:
        status, table = self.ci(seconds=88 * 60)
        self.assertEqual((status, table["test"], table["asan"]), (1, "passed", "NOT RUN: not enough time left"))


class Demo(Sandbox):
    def setUp(self) -> None:
        super().setUp()
        self.has_modules()
        self.programs()

    def programs(self, page: int = 200, globe: str = "", lit: int = 9, build: str = "") -> None:
        folder = Path(self.environment["STUBS"])
        for name, text in (("voxeld", VOXELD.format(page=page)), ("voxelctl", VOXELCTL.format(globe=globe, lit=lit))):
            (folder / name).write_text(text, encoding="utf-8")
            (folder / name).chmod(stat.S_IRWXU)
        build = build or """for step in 1 2 3; do echo "@ $step 3 Building CXX object x/$step.cc.o"; done
mkdir -p build/demo/bin; cp "$STUBS/voxeld" "$STUBS/voxelctl" build/demo/bin"""
        self.stub("cmake", f'if [ "$1" = --preset ]; then echo "-- CUDA engine: no nvcc found"; exit 0; fi\n{build}')

    def times(self) -> dict:
        return json.loads((self.clone / "build/demo.json").read_text(encoding="utf-8"))

    def test_once_plays_what_is_there_and_ends_with_the_time_to_first_light(self) -> None:
        done = self.run_tool("demo", "--once", "--jobs", "3")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertRegex(done.stdout.splitlines()[-1], r"^demo: first light after \d+ s \(packages \d+ s, build \d+ s\)$")
        times = self.times()
        self.assertRegex(done.stdout, re.escape(f"demo: the page is at {times['page']}\n"))
        self.assertEqual((times["compilations"], times["jobs"], times["scenes"]), (3, 3, ["globe", "galaxy"]))
        self.assertLessEqual(times["first_light_s"], times["total_s"])
        self.assertIn("-j 3", self.calls("cmake")[1])
        self.assertIn("build: 3 of 3 steps", done.stdout)
        self.assertNotIn("chromium", done.stdout + done.stderr)

    def test_without_the_page_and_the_globe_it_works_and_says_so(self) -> None:
        self.programs(page=404, globe="tools/setup brings it")
        done = self.run_tool("demo", "--once")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("this build has no page", done.stdout)
        self.assertIn("without the globe: tools/setup brings it", done.stderr)
        self.assertIsNone(self.times()["page"])
        self.assertEqual(self.times()["scenes"], ["galaxy"])

    def test_in_a_terminal_it_stays_up_until_ctrl_c(self) -> None:
        child, terminal = pty.fork()
        if child == 0:
            os.execve(str(self.clone / "tools/demo"), ["demo"], self.environment)
        said = b""
        sent = False
        while True:
            try:
                chunk = os.read(terminal, 65536)
            except OSError:  # The child has closed its end.
                break
            if not chunk:
                break
            said += chunk
            if not sent and b"demo: first light after" in said:
                os.write(terminal, b"\x03")
                sent = True
        os.close(terminal)
        _, status = os.waitpid(child, 0)
        words = said.decode()
        self.assertEqual(os.waitstatus_to_exitcode(status), 0, words)
        page = re.search(r"demo: the page is at (http://127\.0\.0\.1:\d+/)", words)
        self.assertIsNotNone(page, words)
        self.assertLess(page.start(), words.index("== playing globe galaxy"))
        self.assertIn("plays globe galaxy", words)
        self.assertIn("Ctrl-C stops it", words)
        self.assertEqual(self.times()["page"], page[1])

    def test_a_compiler_that_runs_out_of_memory_is_named(self) -> None:
        self.programs(build='echo "@ 1 3 Building CXX object x/1.cc.o"; echo "FAILED: x/2.cc.o"; '
                            'echo "c++: fatal error: Killed signal terminated program cc1plus"; exit 1')
        done = self.run_tool("demo", "--once")
        self.assertEqual(done.returncode, 1)
        self.assertIn("a compiler ran out of memory; close other programs or run: tools/demo --jobs 1", done.stderr)
        self.assertIn("FAILED: x/2.cc.o", done.stdout)

    def test_a_command_that_fails_without_an_error_was_out_of_memory_too(self) -> None:
        # Clang compiles in its own process, so no other process reports that it was killed.
        self.programs(build='echo "@ 1 3 Building CXX object x/1.cc.o"; echo "FAILED: x/2.cc.o"; echo "clang++-16 -c x/2.cc -o x/2.cc.o"; exit 1')
        done = self.run_tool("demo", "--once")
        self.assertEqual(done.returncode, 1)
        self.assertIn("a compiler ran out of memory; close other programs or run: tools/demo --jobs 1", done.stderr)

    def test_an_error_of_the_compiler_is_shown(self) -> None:
        self.programs(build='echo "FAILED: x/2.cc.o"; echo "x/2.cc:1: error: expected ;"; exit 1')
        done = self.run_tool("demo", "--once")
        self.assertEqual(done.returncode, 1)
        self.assertIn("error: expected ;", done.stdout)
        self.assertNotIn("out of memory", done.stderr)


if __name__ == "__main__":
    unittest.main()
