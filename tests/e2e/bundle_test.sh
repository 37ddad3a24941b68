#!/usr/bin/env bash
# Runs the bundle with an empty library path: everything except glibc must come from it. Packs it from the build, or takes it from the
# folder VOXELD_DIST, where tools/package wrote it.
# usage: bundle_test.sh SOURCE BUILD
set -euo pipefail
source=$1
build=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if [ -n "${VOXELD_DIST:-}" ]; then
  archive=$(echo "$VOXELD_DIST"/voxeld-*-linux-*.tar.xz)
else
  "$source/tools/bundle" --no-build --build "$build" --out "$work/packed" >"$work/said"
  archive=$(tail -n 1 "$work/said")
fi
mkdir "$work/bundle"
tar -C "$work/bundle" -xJf "$archive"

outside=$(for program in "$work"/bundle/bin/voxel*; do
  env -i LD_LIBRARY_PATH= ldd "$program"
done | awk -v own="$work/bundle/" '$2 == "=>" && index($3, own) != 1 { print $1, $3 } /not found/ { print }' | sort -u)
echo "from outside the bundle:"
echo "$outside"
if echo "$outside" | grep -vE '^(libc|libm|libdl|librt|libpthread|libresolv|libutil|libanl)\.so\.[0-9]+ ' | grep -q .; then
  echo "bundle_test: more than glibc comes from outside" >&2
  exit 1
fi
for package in libgrpc29 libstdc++6 libfribidi0; do
  [ -s "$work/bundle/lib/copyright/$package" ] || { echo "bundle_test: nothing is said of $package, which is in it" >&2; exit 1; }
done
env -i LD_LIBRARY_PATH= "$work/bundle/bin/voxeld" --version
server=unix:$work/voxeld.sock
env -i LD_LIBRARY_PATH= "$work/bundle/bin/voxeld" --listen "$server" --http off --display cube=simulated,size=32x32x32 &
daemon=$!
trap 'kill -TERM "$daemon" 2>/dev/null || true; rm -rf "$work"' EXIT
for _ in $(seq 100); do
  if env -i LD_LIBRARY_PATH= "$work/bundle/bin/voxelctl" --server "$server" displays >/dev/null 2>&1; then break; fi
  kill -0 "$daemon" 2>/dev/null || { echo "bundle_test: the bundle's voxeld did not start" >&2; exit 1; }
  sleep 0.1
done
env -i LD_LIBRARY_PATH= "$work/bundle/bin/voxelctl" --server "$server" draw "sphere radius=0.5"
env -i LD_LIBRARY_PATH= "$work/bundle/bin/voxelctl" --server "$server" --json snapshot "$work/picture.png" |
  python3 -c 'import json, sys; sys.exit(0 if int(json.load(sys.stdin)["lit_pixels"]) else "bundle_test: nothing is lit")'
