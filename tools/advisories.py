#!/usr/bin/env python3
"""Writes docs/security/advisories.md and docs/security/voxeld.openvex.json from docs/security/advisories.toml.

    tools/advisories.py            writes them
    tools/advisories.py --check    writes nothing

The source lists the known vulnerabilities of the libraries that voxeld links, and what they mean for voxeld; its own comments explain
the format. The page is for people; the other file is OpenVEX, for scanners. Every file and every test that the source or SECURITY.md
names must exist. Otherwise, or with --check if a file differs from what would be written, the exit status is 1 and a line is printed
for each fault.
"""
import argparse
import functools
import hashlib
import json
import pathlib
import re
import subprocess
import sys
import textwrap
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs/security"
SOURCE = FOLDER / "advisories.toml"
SECURITY = ROOT / "SECURITY.md"
# The justifications that OpenVEX defines.
JUSTIFICATIONS = {"component_not_present", "vulnerable_code_not_present", "vulnerable_code_not_in_execute_path",
                  "vulnerable_code_cannot_be_controlled_by_adversary", "inline_mitigations_already_exist"}
# The key that each status requires.
NEEDS = {"not_affected": "justification", "affected": "action", "fixed": None, "under_investigation": None}
WORDS = {"not_affected": "no", "affected": "**yes**", "fixed": "no: repaired by Debian", "under_investigation": "*not known*"}


@functools.cache
def tests():
    """Returns: the names of all tests: Suite.Case for C++, module.Class.test for Python, NAME for ctest."""
    found = set()
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", "--cached", "--others", "--exclude-standard", "tests"],
                            capture_output=True, text=True, check=True).stdout.split()
    for name in listed:
        path = ROOT / name
        if not path.exists():
            continue
        if path.suffix == ".cc":
            found.update(".".join(pair) for pair in re.findall(r"^TYPED_TEST(?:_P)?\((\w+),\s*(\w+)\)|^TEST(?:_F|_P)?\((\w+),\s*(\w+)\)",
                                                               path.read_text(), re.M) for pair in [[word for word in pair if word]])
        elif path.suffix == ".py":
            group = ""
            for kind, word in re.findall(r"^(class |    def )(\w+)", path.read_text(), re.M):
                if kind == "class ":
                    group = word
                else:
                    found.add(f"{path.stem}.{group}.{word}")
        elif path.name == "CMakeLists.txt":
            found.update(re.findall(r"add_test\(\s*NAME ([\w.]+)", path.read_text()))
    return found


def faults(source):
    """Returns: the faults of the source, line by line."""
    wrong = []
    libraries = {one["name"] for one in source["library"]}
    seen = set()
    for one in source["advisory"]:
        name = one["ids"][0]
        if one["library"] not in libraries:
            wrong.append(f"{name}: no library is called {one['library']!r}")
        for each in one["ids"]:
            if each in seen or not re.fullmatch(r"CVE-\d{4}-\d{4,}|GHSA(-\w{4}){3}", each):
                wrong.append(f"{each}: stands there twice, or is no advisory's name")
            seen.add(each)
        status = one["status"]
        if status not in NEEDS:
            wrong.append(f"{name}: its status is {status!r}; it must be one of {', '.join(NEEDS)}")
        elif NEEDS[status] and NEEDS[status] not in one:
            wrong.append(f"{name}: is {status}, and has no {NEEDS[status]}")
        if one.get("justification", "component_not_present") not in JUSTIFICATIONS:
            wrong.append(f"{name}: OpenVEX has no justification {one['justification']!r}")
        wrong += [f"{name}: there is no file {path}" for path in one.get("where", []) if not (ROOT / path).exists()]
        wrong += [f"{name}: there is no test {test}" for test in one.get("tests", []) if test not in tests()]
    for where, text in [(one["name"], one.get("text", "")) for one in source["library"]] + [("SECURITY.md", SECURITY.read_text())]:
        for word in re.findall(r"`([A-Za-z0-9_]+\.[A-Z]\w+(?:\.test_\w+)?|e2e\.\w+|hil\.[\w.]+)`", text):
            if word not in tests():
                wrong.append(f"{where}: there is no test {word}")
        for path in re.findall(r"`((?:common|daemon|display|gpu|tools|client|packaging|cmake|docs|tests)/[\w./@-]+)`", text):
            if not (ROOT / path).exists():
                wrong.append(f"{where}: there is no file {path}")
    return wrong


def wrapped(line):
    """Returns: the line in parts of at most 140 characters."""
    return [line] if len(line) <= 140 else textwrap.wrap(line, 140, break_long_words=False, break_on_hyphens=False)


def page(source):
    out = ["# Known advisories", "",
           "Known advisories of the libraries that voxeld uses, and their effect on voxeld.",
           "Written by `tools/advisories.py` from [advisories.toml](advisories.toml), like [voxeld.openvex.json](voxeld.openvex.json) for scanners.",
           f"Last reviewed on {source['timestamp']:%Y-%m-%d}. Each build lists its components in `voxeld.spdx.json`.", "",
           "*Exploitable*: in voxeld, as it is packaged for Debian 12 with all its updates.", ""]
    for library in source["library"]:
        packages = ", ".join(f"`{name}`" for name in library["packages"])
        said = f"{packages + ' ' if packages else ''}{library['version']}. {library.get('text', '')}".strip()
        out += [f"## {library['name']}", "", *(part for line in said.split("\n") for part in wrapped(line)), ""]
        those = [one for one in source["advisory"] if one["library"] == library["name"]]
        if not those:
            continue
        out += ["| advisory | what it is | exploitable | what we do | where, and the test |", "|---|---|---|---|---|"]
        for one in those:
            does = " ".join(part for part in (one.get("does", ""), one.get("action", "")) if part)
            where = ", ".join(f"`{word}`" for word in one.get("where", []) + one.get("tests", [])) or "–"
            out.append(f"| {', '.join(one['ids'])} | {one['what']} | {WORDS[one['status']]} | {does} | {where} |")
        out.append("")
    return "\n".join(out).rstrip() + "\n"


def vex(source):
    packages = {one["name"]: one["packages"] for one in source["library"]}
    statements = []
    for one in source["advisory"]:
        for name in one["ids"]:
            statement = {
                "vulnerability": {"name": name},
                "products": [{"@id": "pkg:generic/voxeld",
                              "subcomponents": [{"@id": f"pkg:deb/debian/{package.replace('+', '%2B')}?distro=debian-12"}
                                                for package in packages[one["library"]]]}],
                "status": one["status"], "status_notes": " ".join((one["what"], one.get("does", ""))).strip(),
            }
            if "justification" in one:
                statement["justification"] = one["justification"]
            if "action" in one:
                statement["action_statement"] = one["action"]
            statements.append(statement)
    stamp = source["timestamp"].strftime("%Y-%m-%dT%H:%M:%SZ")
    digest = hashlib.sha256(json.dumps(statements, sort_keys=True).encode()).hexdigest()[:16]
    return json.dumps({"@context": "https://openvex.dev/ns/v0.2.0", "@id": f"https://voxeld.invalid/vex/{digest}", "author": "voxeld maintainers",
                       "timestamp": stamp, "version": source["version"], "statements": statements}, indent=1) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; exit status 1 if a file is not what would be written")
    args = parser.parse_args()
    with open(SOURCE, "rb") as file:
        source = tomllib.load(file)
    if wrong := faults(source):
        sys.exit("\n".join(f"advisories: {line}" for line in wrong))
    for name, text in (("advisories.md", page(source)), ("voxeld.openvex.json", vex(source))):
        path = FOLDER / name
        if args.check:
            if not path.exists() or path.read_text() != text:
                sys.exit(f"advisories: docs/security/{name} is not what tools/advisories.py writes; run it")
        else:
            path.write_text(text)


if __name__ == "__main__":
    main()
