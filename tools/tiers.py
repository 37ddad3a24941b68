#!/usr/bin/env python3
"""Prints each test of a configured build with its tier and labels.

usage: tiers.py BUILD [--json]
The tier follows from the labels: `deep` and `package` run in tools/test --deep, all others in tools/test.
"""

import argparse
import json
import subprocess
import sys


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    listed = subprocess.run(["ctest", "--test-dir", arguments.build, "--show-only=json-v1"], capture_output=True, text=True, check=False)
    if listed.returncode != 0:
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
