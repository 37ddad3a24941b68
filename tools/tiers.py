#!/usr/bin/env python3
"""Prints each test of a configured build with its tier and labels.

usage: tiers.py BUILD [--json]
The tier follows from the labels: `deep` and `package` run in tools/test --deep, all others in tools/test.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    # Uses a folder of its own, because ctest empties the log of a build whose tests it lists, even while they run.
    with tempfile.TemporaryDirectory() as folder:
        with open(os.path.join(folder, "CTestTestfile.cmake"), "w", encoding="utf-8") as file:
            file.write(f'subdirs("{os.path.abspath(arguments.build)}")\n')
        listed = subprocess.run(["ctest", "--test-dir", folder, "--show-only=json-v1"], capture_output=True, text=True, check=False)
    if listed.returncode != 0 or not json.loads(listed.stdout)["tests"]:
        print(f"tools/test: {arguments.build} is not configured; run: tools/setup --test && cmake --preset test", file=sys.stderr)
        return 1
    rows = []
    for test in json.loads(listed.stdout)["tests"]:
        properties = {entry["name"]: entry["value"] for entry in test.get("properties", [])}
        labels = properties.get("LABELS", [])
        rows.append({"test": test["name"], "tier": "deep" if {"deep", "package"} & set(labels) else "default", "labels": labels})
    if arguments.json:
        json.dump(rows, sys.stdout, indent=1)
        print()
        return 0
    for row in sorted(rows, key=lambda row: (row["tier"], row["test"])):
        print(f"{row['tier']:8} {row['test']:48} {' '.join(row['labels'])}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
