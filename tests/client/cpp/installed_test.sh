#!/usr/bin/env bash
# Tests the client's install rules: installs it into a folder, builds an example against only that, and runs it.
# installed_test.sh CMAKE BUILD SOURCE COMPILER
set -euo pipefail
cmake=$1 build=$2 source=$3 compiler=$4
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() {
  echo "installed_test: $*" >&2
  exit 1
}

"$cmake" --install "$build" --component client --prefix "$work/prefix" >"$work/log" || fail "$(cat "$work/log")"
(cd "$work/prefix" && find . -type f | LC_ALL=C sort | sed "s|-$(sed -n 's/^CMAKE_BUILD_TYPE:[^=]*=//p' "$build/CMakeCache.txt" | tr A-Z a-z)\.|-TYPE.|") >"$work/files"
cat >"$work/expected" <<'EOT'
./include/voxeld/address.h
./include/voxeld/assets.h
./include/voxeld/basics.h
./include/voxeld/channel.h
./include/voxeld/client.h
./include/voxeld/credentials.h
./include/voxeld/drawing.h
./include/voxeld/expression.h
./include/voxeld/receipt.h
./include/voxeld/shapes.h
./lib/cmake/voxeld_client/voxeld_client-config-version.cmake
./lib/cmake/voxeld_client/voxeld_client-config.cmake
./lib/cmake/voxeld_client/voxeld_client-targets-TYPE.cmake
./lib/cmake/voxeld_client/voxeld_client-targets.cmake
./lib/libvoxeld_client.so
./share/doc/libvoxeld-dev/copyright
./share/voxeld/proto/voxeld/v1/colormaps.txt
./share/voxeld/proto/voxeld/v1/display.proto
./share/voxeld/proto/voxeld/v1/local.proto
./share/voxeld/proto/voxeld/v1/primitives.proto
./share/voxeld/proto/voxeld/v1/scene.proto
./share/voxeld/proto/voxeld/v1/types.proto
EOT
diff "$work/expected" "$work/files" || fail "what is installed differs (>)"
if grep -rnE '#include.*(grpc|protobuf|\.pb\.h|client/cpp|daemon/|display/)' "$work/prefix/include"; then
  fail "a public header includes what is not installed"
fi

cp -r "$source/client/cpp/examples" "$work/examples"
"$cmake" -S "$work/examples" -B "$work/build" -G Ninja -DCMAKE_PREFIX_PATH="$work/prefix" -DCMAKE_CXX_COMPILER="$compiler" \
  >"$work/log" 2>&1 || fail "$(cat "$work/log")"
"$cmake" --build "$work/build" --target example_01_hello_line >"$work/log" 2>&1 || fail "$(cat "$work/log")"
if "$work/build/example_01_hello_line" nonsense >"$work/log" 2>&1; then fail "it took a wrong address"; fi
grep -q 'give HOST:PORT, tls:HOST:PORT or unix:PATH' "$work/log" || fail "it said: $(cat "$work/log")"
