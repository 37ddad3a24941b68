"""The programs that these tests run; the environment names them."""
import os
import sys
from pathlib import Path

LIBRARIES = {"FAIL_MALLOC": "tests/libvoxeld_fail_malloc.so"}

# Put before a program: the kernel kills it when the test that started it has ended, however that ended.
ENDS_WITH_US = ("setpriv", "--pdeathsig", "KILL")


def program(variable: str, what: str) -> str:
    """Returns the path in `variable`. If it is not a program that can be run (or a library that can be loaded), the process exits with 2
    and a message."""
    path = os.environ.get(variable, "")
    example = f"{variable}=build/test/bin/{LIBRARIES.get(variable, 'voxeld')}"
    wrong = ""
    if not path:
        wrong = f"{variable} is not set; it is to name {what}"
    elif not Path(path).is_file():
        wrong = f"{variable}: there is no file {path}; it is to name {what}"
    elif not path.endswith(".so") and not os.access(path, os.X_OK):
        wrong = f"{variable}: {path} cannot be run; it is to name {what}"
    if wrong:
        print(f"{Path(sys.argv[0]).name}: {wrong}, as in {example}", file=sys.stderr)
        sys.exit(2)
    return path
