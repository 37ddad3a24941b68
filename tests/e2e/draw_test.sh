#!/usr/bin/env bash
# Tests the real programs end to end: shapes and expressions as typed by a user, checked in what the display shows.
# usage: draw_test.sh VOXELD VOXELCTL
set -euo pipefail
voxeld=$1
voxelctl=$2

work=$(mktemp -d)
daemon=
trap '[ -z "$daemon" ] || kill -KILL "$daemon" 2>/dev/null || true; rm -rf "$work"' EXIT
export VOXELD_SERVER=unix:$work/voxeld.sock

"$voxeld" --listen "$VOXELD_SERVER" --http off --log-level warn --engine cpu \
  --display stack=simulated,geometry=planar,size=64x64x64 &
daemon=$!
for _ in $(seq 600); do
  "$voxelctl" displays >/dev/null 2>&1 && break
  kill -0 "$daemon"
  sleep 0.1 # polled: the daemon does not signal when it listens
done

# field FILE EXPRESSION: prints the value of a Python expression on the JSON document `d`.
field() { python3 -c 'import json, sys; d = json.load(open(sys.argv[1])); print(eval(sys.argv[2]))' "$1" "$2"; }
fail() { echo "$1" >&2; exit 1; }

# Draws its arguments, and checks that the display then shows between LEAST and MOST lit pixels.
draws() {
  local least=$1 most=$2
  shift 2
  "$voxelctl" --json draw "$@" >"$work/draw.json"
  # Immediately: a picture includes everything that is in the scene when it is requested.
  "$voxelctl" --json snapshot "$work/picture.png" --size 300x250 >"$work/picture.json"
  lit=$(field "$work/picture.json" 'd["lit_pixels"]')
  [ "$lit" -ge "$least" ] && [ "$lit" -le "$most" ] || fail "$*: $lit lit pixels, not $least to $most"
}

# For a paraboloid over the unit disc, 5.33 units of area, 32² voxels each; where it is steep it takes fewer.
draws 3200 5400 "x^2+y^2-z = 0 where x^2+y^2 <= 1"
draws 16000 17500 "sphere radius=0.5 fill=solid"
draws 4096 4096 "points vertices=0,0,0 splat=cell scale=0.5"
# A shape that cannot be drawn exactly as requested is drawn, with a message.
draws 400 700 "mesh vertices='-0.5,-0.5,0 0.5,-0.5,0 0,0.5,0' fill=solid"
[ "$(field "$work/draw.json" '["its surface is drawn" in note for note in d["notes"]]')" = "[True]" ] || fail "$(cat "$work/draw.json")"
"$voxelctl" draw "mesh vertices='-0.5,-0.5,0 0.5,-0.5,0 0,0.5,0' fill=solid" 2>"$work/note"
grep -q "the mesh is open" "$work/note" || fail "the mesh' note is not told"
draws 17000 19000 "sphere radius=0.5 fill=solid" "torus radius=0.8 tube_radius=0.05 fill=solid"
"$voxelctl" --json entities >"$work/entities.json"
[ "$(field "$work/entities.json" '[e["kind"] for e in d["entities"]]')" = "['sphere', 'torus']" ] ||
  fail "not what was drawn last is up: $(cat "$work/entities.json")"
"$voxelctl" draw --add "points vertices=0,0,0.9"
"$voxelctl" --json entities >"$work/entities.json"
[ "$(field "$work/entities.json" 'len(d["entities"])')" = 3 ] || fail "--add took something away"

# If one argument is wrong, nothing is drawn or removed.
if "$voxelctl" draw "sphere radius=1" "x +" 2>"$work/error"; then fail "x + was drawn"; fi
grep -q "at character 4: found the end where a number, a name or ( would be right" "$work/error" || fail "$(cat "$work/error")"
if "$voxelctl" draw "spere radius=1" 2>"$work/error"; then fail "a spere was drawn"; fi
grep -q 'there is no shape spere; did you mean sphere?' "$work/error" || fail "$(cat "$work/error")"
# A refusal of the server is reported once, with the shape that it concerns.
if "$voxelctl" draw "sphere radius=1" "sphere radius=0" 2>"$work/error"; then fail "a sphere of no radius was drawn"; fi
grep -q '"sphere radius=0": radius is 0; give a number greater than 0' "$work/error" || fail "$(cat "$work/error")"
[ "$(grep -o "radius is 0" "$work/error" | wc -l)" = 1 ] || fail "said again: $(cat "$work/error")"
if "$voxelctl" draw "text text=HELLO" 2>"$work/error"; then fail "a text of no height was drawn"; fi
grep -q '"text text=HELLO": height=… is missing; give a number greater than 0' "$work/error" || fail "$(cat "$work/error")"
if "$voxelctl" draw "x^2+" 2>"$work/error"; then fail "x^2+ was drawn"; fi
grep -q '"x^2+": at character 5: found the end where a number' "$work/error" || fail "$(cat "$work/error")"
"$voxelctl" --json entities >"$work/entities.json"
[ "$(field "$work/entities.json" 'len(d["entities"])')" = 3 ] || fail "a refused shape took something away"

# A pattern does not hide what is drawn.
"$voxelctl" pattern corners
draws 16000 17500 "sphere radius=0.5 fill=solid"

"$voxelctl" --json gallery "$work/gallery.png" --each "$work/each/shape" >"$work/gallery.json"
[ "$(field "$work/gallery.json" 'd["shapes"] > 10 and d["width"] > 1000')" = True ] || fail "$(cat "$work/gallery.json")"
[ "$(head -c 8 "$work/gallery.png" | od -An -tx1 | tr -d ' \n')" = 89504e470d0a1a0a ]
# One file for each, all of them different pictures with a palette (colour type 3 at byte 25).
[ "$(find "$work/each/shape" -name '*.png' | wc -l)" = "$(field "$work/gallery.json" 'd["shapes"]')" ] || fail "$(ls "$work/each/shape")"
[ "$(cat "$work"/each/shape/*.png | wc -c)" -lt 500000 ] || fail "$(ls -l "$work/each/shape")"
[ "$(md5sum "$work"/each/shape/*.png | cut -d' ' -f1 | sort | uniq -d)" = "" ] || fail "two shapes look alike"
for name in torus points-soft mesh-a-colour-a-triangle; do
  [ "$(od -An -tu1 -j25 -N1 "$work/each/shape/$name.png" | tr -d ' ')" = 3 ] || fail "$name.png has no palette"
done
"$voxelctl" --json entities >"$work/entities.json"
[ "$(field "$work/entities.json" 'len(d.get("entities", []))')" = 0 ] || fail "the gallery left something up"
