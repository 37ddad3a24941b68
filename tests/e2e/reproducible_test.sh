#!/usr/bin/env bash
# Builds the wheel, the page and a library of the working tree twice, in different folders, and checks that the bytes are the same.
# tools/reproduce does that for everything that is installed, which takes as long as two builds.
# usage: reproducible_test.sh SOURCE
set -euo pipefail
source=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() {
  echo "reproducible_test: $*" >&2
  exit 1
}

# A clone whose newest commit is the working tree, committed or not.
git clone -q --no-local --no-tags --depth 1 "file://$source" "$work/clone"
(cd "$source" && git ls-files -z --cached --others --exclude-standard | while IFS= read -r -d '' file; do [ ! -f "$file" ] || printf '%s\0' "$file"; done |
  tar -cf - --null -T -) | tar -C "$work/clone" -xf -
cd "$work/clone"
git add -A
git -c user.name=test -c user.email=test@voxeld.invalid commit -q --allow-empty -m "as it is"
if [ -d "$source/build/data" ]; then mkdir -p build && ln -s "$(realpath "$source/build/data")" build/data; fi

tools/reproduce --preset test --jobs 1 --work "$work/built" python_client voxeld_usage $([ ! -d build/data ] || echo voxeld_page) | tee "$work/said"
for file in python/voxeld-*.whl daemon/usage/libvoxeld_usage.a; do
  ls "$work"/built/a/out/$file >/dev/null || fail "nothing like $file was compared"
done

# Checks that a difference is found: a module that contains the folder's name.
echo 'file(WRITE ${stage}/voxeld/where.py "WHERE = \"${CMAKE_BINARY_DIR}\"\n")' >>client/python/CMakeLists.txt
git -c user.name=test -c user.email=test@voxeld.invalid commit -q -a -m "a name"
if tools/reproduce --preset test --jobs 1 --work "$work/built" python_client >"$work/said"; then fail "a name in the wheel was not seen: $(cat "$work/said")"; fi
grep -q '^differs: ./python/voxeld-.*\.whl$' "$work/said" || fail "it says: $(cat "$work/said")"
echo "and a difference is found"
