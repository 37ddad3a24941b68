#!/usr/bin/env bash
# Installs the packages in a root without any other part of voxeld, starts the service as its unit does, and draws with the wheel; with the
# development files, builds and runs a C++ client as well. Then removes the packages. Whatever it writes is discarded.
# usage: installed_test.sh PACKAGES WHEEL SOURCE CACHE
#   PACKAGES  the folder of the .deb files; CACHE a folder that may be kept between calls
# VOXELD_DIST=FOLDER: the packages and the wheel are those of this folder, as tools/package wrote it, and its checksums are checked.
# The clean root is a Debian system made by debootstrap, plus the packages needed to build a client. It is kept in CACHE.
# VOXELD_CLEAN_ROOT=FOLDER uses another root. With VOXELD_CLEAN_ROOT=/, the test uses this system's /usr (without /usr/local), /etc and
# /var; it may then miss an undeclared dependency that happens to be installed. Requires root, debootstrap, a network for the first run, and
# a kernel with overlayfs. Exit status 77: the test was skipped because something required is missing.
set -euo pipefail
skip() { echo "installed_test: skipped: $*" >&2; exit 77; }
fail() { echo "installed_test: $*" >&2; exit 1; }
step() { echo "== $*"; }
[ $# = 4 ] || fail "usage: installed_test.sh PACKAGES WHEEL SOURCE CACHE"
packages=$(realpath "$1") wheel=$(realpath "$2") source=$(realpath "$3") cache=$4
if [ -n "${VOXELD_DIST:-}" ]; then
  packages=$(realpath "$VOXELD_DIST")
  for kind in 'voxeld_*.deb' 'libvoxeld-dev_*.deb' 'voxeld-*.whl' 'voxeld-*-linux-*.tar.xz' voxeld.spdx.json NOTICES; do
    [ "$(cd "$packages" && compgen -G "$kind" | wc -l)" = 1 ] || fail "tools/package wrote no $kind, or several, to $packages"
    grep -q "  $(cd "$packages" && compgen -G "$kind")\$" "$packages/SHA256SUMS" || fail "SHA256SUMS lacks $kind"
  done
  (cd "$packages" && sha256sum --quiet --strict --check SHA256SUMS) || fail "a checksum is wrong"
  wheel=$(echo "$packages"/voxeld-*.whl)
fi
ls "$packages"/voxeld_*.deb >/dev/null 2>&1 || fail "there is no package voxeld in $packages"
[ -f "$wheel" ] || fail "there is no wheel $wheel"
[ "$(id -u)" = 0 ] || skip "only root can change its root folder"

# All mounts and processes disappear with the namespaces.
if [ -z "${INSTALLED_WORK:-}" ]; then
  work=$(mktemp -d)
  trap 'rmdir "$work" 2>/dev/null || true' EXIT
  unshare --mount --pid --fork --propagation private true 2>/dev/null || skip "this system allows no namespaces"
  status=0
  INSTALLED_WORK=$work unshare --mount --pid --fork --kill-child --propagation private "$0" "$@" || status=$?
  exit "$status"
fi

in_root() { chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"; }
needed=(python3-grpcio python3-numpy python3-protobuf python3-venv g++ cmake ninja-build)

step "a clean root"
base=${VOXELD_CLEAN_ROOT:-}
if [ -z "$base" ]; then
  command -v debootstrap >/dev/null || skip "debootstrap is not installed (tools/setup --dev)"
  base=$cache/debian
  if [ ! -d "$base" ]; then
    rm -rf "$base.new" && mkdir -p "$base.new"
    if ! { debootstrap --variant=minbase bookworm "$base.new" && root=$base.new &&
           in_root apt-get install -q -y --no-install-recommends "${needed[@]}" && mv "$base.new" "$base"; } >"$cache/debian.log" 2>&1; then
      skip "debootstrap failed ($(tail -n 1 "$cache/debian.log")); to use this system's own files instead, set VOXELD_CLEAN_ROOT=/"
    fi
  fi
fi
[ "$base" != / ] || base=
mount -t tmpfs -o mode=755 tmpfs "$INSTALLED_WORK"
mkdir "$INSTALLED_WORK"/{upper,changes,root}
root=$INSTALLED_WORK/root
mount -t overlay overlay -o "lowerdir=${base:-/},upperdir=$INSTALLED_WORK/upper,workdir=$INSTALLED_WORK/changes" "$root" 2>/dev/null ||
  skip "this kernel has no overlayfs here"
if [ -z "$base" ]; then
  # Only the files of Debian's packages are left of this system.
  for folder in "$root"/*; do
    case "${folder##*/}" in
      bin | dev | etc | lib* | proc | run | sbin | sys | tmp | usr | var) ;;
      *) [ -L "$folder" ] || [ ! -d "$folder" ] || mount -t tmpfs tmpfs "$folder" ;;
    esac
  done
  mount -t tmpfs tmpfs "$root/usr/local"
  echo "   this system's packages: $(in_root sh -c '. /etc/os-release; echo "$PRETTY_NAME"')"
else
  cp /etc/resolv.conf "$root/etc/resolv.conf"
  # Downloads are kept, so that the next call needs no network.
  mkdir -p "$cache/archives" "$root/var/cache/apt/archives"
  mount --bind "$cache/archives" "$root/var/cache/apt/archives"
  echo "   $base: $(in_root dpkg-query -W -f '.\n' | wc -l) packages"
fi
for folder in run tmp; do mount -t tmpfs -o "mode=$([ $folder = tmp ] && echo 1777 || echo 755)" tmpfs "$root/$folder"; done
mount -t proc proc "$root/proc"
mount --rbind /dev "$root/dev"
for package in voxeld-cuda libvoxeld-dev voxeld; do
  [ -z "$(in_root dpkg-query -W -f '${db:Status-Status}' $package 2>/dev/null)" ] || in_root dpkg --purge $package >/dev/null 2>&1
done
if in_root sh -c 'command -v voxeld voxelctl' || [ -e "$root/usr/libexec/voxeld" ]; then fail "voxeld is there before it is installed"; fi

files() { (cd "$root" && find usr -path usr/local -prune -o -name '*voxel*' -print | LC_ALL=C sort); }
files >"$INSTALLED_WORK/before"

step "install"
mkdir "$root/tmp/packages"
cp "$packages"/*.deb "$wheel" "$root/tmp/packages/"
names=$(cd "$packages" && ls ./*.deb)
in_root apt-get install -q -y --no-install-recommends $(cd "$packages" && printf '/tmp/packages/%s ' *.deb) \
  $([ -z "$base" ] || echo "${needed[@]}") >"$INSTALLED_WORK/log" 2>&1 || fail "apt-get: $(tail -n 20 "$INSTALLED_WORK/log")"
for name in $names; do
  name=${name#./}
  [ "$(in_root dpkg-query -W -f '${db:Status-Status}' "${name%%_*}")" = installed ] || fail "${name%%_*} is not installed"
  echo "   $name"
done
[ "$(in_root id -un voxeld)" = voxeld ] && in_root id -Gn voxeld | grep -qw video || fail "no user voxeld in the group video"

step "the service, as its unit starts it"
in_root install -D -m 0644 /usr/share/doc/voxeld/examples/voxeld.toml /etc/voxeld/voxeld.toml
# Ports of this machine may be in use; the socket's path is inside the root.
in_root sed -i 's/^listen = .*/listen = ["unix:\/run\/voxeld\/voxeld.sock"]/; s/^http = .*/http = "off"/' /etc/voxeld/voxeld.toml
in_root voxeld --check-config >/dev/null || fail "the example of a configuration is refused"
in_root install -d -o voxeld -g voxeld -m 0750 /run/voxeld
in_root install -d -o voxeld -g voxeld -m 0700 /var/lib/voxeld
start() { exec chroot "$root" /usr/bin/env -i PATH=/usr/bin:/bin setpriv --reuid voxeld --regid voxeld --init-groups --no-new-privs voxeld --state-dir /var/lib/voxeld; }
start >"$INSTALLED_WORK/daemon.log" 2>&1 &
daemon=$!
for _ in $(seq 600); do
  ! grep -q ' ready\|"ready' "$INSTALLED_WORK/daemon.log" || break
  kill -0 "$daemon" 2>/dev/null || fail "voxeld ended: $(cat "$INSTALLED_WORK/daemon.log")"
  sleep 0.1 # polled: its log shows when it listens
done
grep ' ready\|"ready' "$INSTALLED_WORK/daemon.log" | sed 's/^/   /' || fail "voxeld is not ready: $(cat "$INSTALLED_WORK/daemon.log")"
if grep 'cannot be started' "$INSTALLED_WORK/daemon.log"; then fail "voxeld does not find its engine's program"; fi

step "draw from the wheel"
cat >"$root/tmp/draw.py" <<'EOT'
import sys

import numpy as np
import voxeld

place = voxeld.__file__
assert place.startswith(sys.argv[1]), f"the module is from {place}, not from the wheel"
with voxeld.connect("unix:/run/voxeld/voxeld.sock", timeout=60, name="installed") as v:
    ball = v.sphere("ball", radius=0.5, color="orange", fill="solid")
    outcomes = ball.frame.wait_shown(timeout=60)
    assert list(outcomes) == ["stack"] and outcomes["stack"].kind == "presented", outcomes
    volume = v.capture("stack", timeout=60)
    assert np.count_nonzero(volume.rgb.any(axis=-1)) > 10_000, volume
print(f"{volume}, presented; drawn by {place}")
EOT
if in_root python3 -c 'import ensurepip' 2>/dev/null; then
  in_root python3 -m venv --system-site-packages /tmp/venv
  in_root sh -c '/tmp/venv/bin/pip install -q --disable-pip-version-check --no-index /tmp/packages/*.whl' || fail "pip does not install the wheel"
  in_root /tmp/venv/bin/python -W ignore::ResourceWarning /tmp/draw.py /tmp/venv/ | sed 's/^/   /'
else
  echo "   without python3-venv, so the wheel is on PYTHONPATH"
  in_root env PYTHONPATH="/tmp/packages/$(basename "$wheel")" python3 /tmp/draw.py /tmp/packages/ | sed 's/^/   /'
fi

step "voxelctl"
in_root env VOXELD_SERVER=unix:/run/voxeld/voxeld.sock voxelctl displays | sed 's/^/   /'
if [ -n "$(ls "$packages"/voxeld-import_*.deb 2>/dev/null)" ]; then
  printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n' >"$root/tmp/triangle.obj"
  in_root env VOXELD_SERVER=unix:/run/voxeld/voxeld.sock voxelctl play /tmp/triangle.obj 2>&1 | sed 's/^/   /' || fail "voxelctl does not play a file that voxeld-import reads"
fi

step "a C++ client against the development files"
if [ -n "$(ls "$packages"/libvoxeld-dev_*.deb 2>/dev/null)" ]; then
  cp -r "$source/client/cpp/examples" "$root/tmp/examples"
  in_root sh -c 'cmake -S /tmp/examples -B /tmp/built -G Ninja && cmake --build /tmp/built -j 1 --target example_01_hello_line' >"$INSTALLED_WORK/log" 2>&1 ||
    fail "it is not built: $(tail -n 20 "$INSTALLED_WORK/log")"
  in_root timeout 60 /tmp/built/example_01_hello_line unix:/run/voxeld/voxeld.sock | sed 's/^/   /'
else
  echo "   skipped: no package libvoxeld-dev in $packages"
fi

step "stop, remove"
kill -TERM "$daemon"
wait "$daemon" || fail "voxeld ended with $?: $(tail "$INSTALLED_WORK/daemon.log")"
in_root apt-get purge -q -y $(for name in $names; do name=${name#./}; echo "${name%%_*}"; done) >"$INSTALLED_WORK/log" 2>&1 ||
  fail "apt-get purge: $(tail -n 20 "$INSTALLED_WORK/log")"
left=$(comm -13 "$INSTALLED_WORK/before" <(files))
[ -z "$left" ] || fail "left behind: $left"
echo "installed_test: passed"
