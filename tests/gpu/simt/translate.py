#!/usr/bin/env python3
"""Translates a CUDA source to the C++ that tests/gpu/simt/grid.h runs.

    translate.py SOURCE OUTPUT

It rewrites launches and dynamic shared memory, which macros cannot express; kernel.h defines everything else.
"""

import re
import sys

LAUNCH = re.compile(r"([\w:]+(?:<[^<>;]*>)?)\s*<<<(.*?)>>>\s*\(", re.DOTALL)
SHARED = re.compile(r"extern __shared__ (?:__align__\(\d+\) )?([\w ]+?) (\w+)\[\];")


def translate(text):
    text = LAUNCH.sub(r"::voxeld::simt::Launch(\1, \2)(", text)
    text = SHARED.sub(r"\1* const \2 = static_cast<\1*>(::voxeld::simt::DynamicShared());", text)
    text = text.replace("__noinline__ ", "")
    if "<<<" in text or "extern __shared__" in text:
        raise ValueError("a launch or shared memory that is written in a way not reckoned with")
    return text


def main(source, output):
    with open(source, encoding="utf-8") as file:
        text = file.read()
    with open(output, "w", encoding="utf-8") as file:
        file.write(f'#line 1 "{source}"\n{translate(text)}')


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
