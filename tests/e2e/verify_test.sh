#!/usr/bin/env bash
# Tests the real voxelctl with the emulated device: its output is parsed by Python, and its exit codes are checked.
# usage: verify_test.sh VOXELCTL
set -euo pipefail
voxelctl=$1

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# code WANT COMMAND…: runs a command and compares its exit code.
code() {
  local want=$1 got=0
  shift
  "$@" >"$work/out" 2>"$work/err" || got=$?
  [ "$got" = "$want" ] || { echo "$* ended with $got, not $want: $(cat "$work/out" "$work/err")" >&2; exit 1; }
}

code 0 "$voxelctl" verify lab=simulated,size=16x12x10,serial='<A&1>' --json --seed 7 --junit "$work/all.xml"
mv "$work/out" "$work/all.json"
code 0 "$voxelctl" verify simulated,size=8x8x4 --list --json
mv "$work/out" "$work/list.json"
# A fault on the cable is found, and reported with what was expected.
code 1 "$voxelctl" verify simulated,size=8x8x4,faults=stall@t1 --filter 'volume.whole' --json --junit "$work/bad.xml"
mv "$work/out" "$work/bad.json"
grep -q '1 failed' "$work/err"

python3 - "$work" <<'EOT'
import json, sys
import xml.etree.ElementTree as ET
work = sys.argv[1]
doc = json.load(open(f"{work}/all.json"))
device = doc["devices"][0]
cases = {c["id"]: c for c in device["cases"]}
assert (doc["display"], doc["driver"], doc["seed"], doc["failed"]) == ("lab", "simulated", 7, 0), doc
assert device["serial"] == "<A&1>" and device["protocol"] == "voxlink 1.0", device
assert len(cases) == len(device["cases"]) == doc["passed"] + doc["not_applicable"] > 80
assert cases["watchdog.none"]["result"] == "not applicable" and cases["watchdog.none"]["reason"]
assert all(c["duration_ns"] >= 0 and c["section"] for c in cases.values())

root = ET.parse(f"{work}/all.xml").getroot()
suite = root.find("testsuite")
assert root.tag == "testsuites" and len(root) == 1
assert [t.get("name") for t in suite.iter("testcase")] == [c["id"] for c in device["cases"]]
for element in (root, suite):
    assert int(element.get("tests")) == len(cases) and element.get("failures") == "0"
    assert int(element.get("skipped")) == doc["not_applicable"] == len(list(suite.iter("skipped")))
    assert float(element.get("time")) > 0
assert {p.get("name"): p.get("value") for p in suite.iter("property")}["serial"] == "<A&1>"

listed = json.load(open(f"{work}/list.json"))
assert [c["id"] for c in listed["cases"]] == list(cases), "verify --list names other cases than are run"

bad = json.load(open(f"{work}/bad.json"))
(case,) = bad["devices"][0]["cases"]
assert bad["failed"] == 1 and case["result"] == "failed" and case["expected"] and "stall" in case["seen"], case
(failure,) = ET.parse(f"{work}/bad.xml").getroot().iter("failure")
assert case["seen"] in failure.get("message") and "docs/protocols/voxlink.md" in failure.text
EOT

code 0 "$voxelctl" verify simulated,size=8x8x4 --filter 'usb.*'
grep -q '^passed .*usb.interface .*§3.1' "$work/out"
grep -q '0 failed' "$work/out"
code 0 "$voxelctl" verify simulated --filter '!(usb.*)' --list
[ "$(grep -c '^usb' "$work/out")" = 0 ]
code 2 "$voxelctl" verify
code 2 "$voxelctl" verify nosuch
code 2 "$voxelctl" verify simulated,size=none
code 2 "$voxelctl" verify simulated --filter nosuch
code 2 "$voxelctl" verify simulated --seed -1
code 1 "$voxelctl" verify simulated --filter usb.bos --junit /nowhere/verify.xml
grep -q '/nowhere/verify.xml cannot be written' "$work/err"
code 3 "$voxelctl" verify voxlink,serial=nobody-has-this-one
grep -q 'nobody-has-this-one' "$work/err"

# When interrupted, it reports that, and exits soon.
"$voxelctl" verify simulated >"$work/out" 2>"$work/err" &
run=$!
until grep -q passed "$work/out"; do kill -0 "$run"; sleep 0.05; done
kill -INT "$run"
got=0
wait "$run" || got=$?
[ "$got" = 130 ] || { echo "interrupted, it ended with $got" >&2; exit 1; }
echo "verified, written, read back"
