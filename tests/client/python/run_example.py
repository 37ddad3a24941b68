"""Runs a program against the real daemon with simulated displays on a Unix socket; fails when the program fails, and when the daemon
refused anything or
showed nothing. usage: run_example.py VOXELD PROGRAM [ARGUMENT]..."""
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import voxeld as voxel

# The operations that an example deliberately has refused, and the pictures that it leaves.
REFUSED = {"08_receipts_and_errors": 2}
PICTURES = {"04_point_cloud": ["tmp/galaxy.png"]}
# These follow the display in FIRST_DISPLAY, if that is set; examples capture the first display.
DISPLAYS = ["stack=simulated,geometry=planar,size=48x48x48", "rotor=simulated,geometry=rotor,size=48x48,slices=120"]


def main() -> int:
    daemon_path, program, *arguments = sys.argv[1:]
    program = str(Path(program).resolve())
    name = Path(program).stem
    displays = [one for one in [os.environ.get("FIRST_DISPLAY")] if one] + DISPLAYS
    with tempfile.TemporaryDirectory() as folder:
        server = f"unix:{folder}/voxeld.sock"
        with open(f"{folder}/daemon.log", "wb") as log:
            daemon = subprocess.Popen(
                [daemon_path, "--listen", server, "--http", "off", "--log-level", "warn",
                 *(word for display in displays for word in ("--display", display))], stdout=log, stderr=log)
        try:
            with voxel.connect(server, timeout=120, name="observer") as observer:
                work, temporary = Path(folder, "work"), Path(folder, "tmp")
                work.mkdir()
                temporary.mkdir()
                environment = {**os.environ, "VOXELD_SERVER": server, "TMPDIR": str(temporary)}
                done = subprocess.run([sys.executable, program, *arguments], cwd=work, env=environment, timeout=240)
                stats = observer.stats()
                faults: list[str] = []
                if left := sorted(work.iterdir()):
                    faults.append(f"it left {left} in the folder that it was started in")
                if done.returncode != 0:
                    faults.append(f"{name} ended with {done.returncode}")
                if stats.operations_refused != REFUSED.get(name, 0):
                    faults.append(f"{stats.operations_refused} operations were refused")
                if not all(display.volumes_presented for display in stats.displays):
                    faults.append("a display showed nothing")
                for picture in PICTURES.get(name, []):
                    if not Path(folder, picture).exists() or Path(folder, picture).read_bytes()[:8] != b"\x89PNG\r\n\x1a\n":
                        faults.append(f"{picture} is no PNG file")
                    elif "KEEP_PICTURES" in os.environ:
                        Path(os.environ["KEEP_PICTURES"], Path(picture).name).write_bytes(Path(folder, picture).read_bytes())
        finally:
            daemon.terminate()
            daemon.wait(60)
        if daemon.returncode != 0:
            faults.append(f"voxeld ended with {daemon.returncode}")
        if faults:
            print("; ".join(faults), file=sys.stderr)
            print(Path(folder, "daemon.log").read_text(errors="replace"), file=sys.stderr)
        return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
