#!/usr/bin/env bash
# Makes the Debian packages of the build (voxeld, libvoxeld-dev, and voxeld-cuda if the build has CUDA) and checks them as dpkg, udev and
# systemd would; runs their programs from an empty folder. Nothing is installed.
# usage: package_test.sh CPACK BUILD VERSION
set -euo pipefail
cpack=$1
build=$2
version=$3

work=$(mktemp -d)
daemon=
trap '[ -z "$daemon" ] || kill -KILL "$daemon" 2>/dev/null || true; rm -rf "$work"' EXIT
fail() {
  echo "package_test: $*" >&2
  exit 1
}

"$cpack" -G DEB -B "$work/made" --config "$build/CPackConfig.cmake" >"$work/said" || { cat "$work/said"; fail "no package"; }
architecture=$(dpkg --print-architecture)
packages=(voxeld libvoxeld-dev)
[ ! -x "$build/bin/voxeld-import" ] || packages+=(voxeld-import)
[ ! -x "$build/bin/voxeld-engine-cuda" ] || packages+=(voxeld-cuda)
diff <(printf "%s_${version}_$architecture.deb\n" "${packages[@]}" | LC_ALL=C sort) <(cd "$work/made" && ls *.deb | LC_ALL=C sort) ||
  fail "other packages were made (>)"
root=$work/root  # of voxeld, beside which the others are checked
for package in "${packages[@]}"; do
  mkdir -p "$work/$package"
  dpkg-deb -x "$work/made/${package}_${version}_$architecture.deb" "$work/$package"
  dpkg-deb -e "$work/made/${package}_${version}_$architecture.deb" "$work/$package.control"
done
cp -a "$work/voxeld" "$root"

# ---- control fields, contents
field() { dpkg-deb -f "$work/made/${1}_${version}_$architecture.deb" "$2"; }  # PACKAGE FIELD
declare -A section=([voxeld]=graphics [voxeld-cuda]=graphics [voxeld-import]=graphics [libvoxeld-dev]=libdevel)
for package in "${packages[@]}"; do
  [ "$(field "$package" Package) $(field "$package" Version)" = "$package $version" ] || fail "control of $package: $(field "$package" Version)"
  [ "$(field "$package" Section)" = "${section[$package]}" ] || fail "section of $package: $(field "$package" Section)"
  [ "$(field "$package" Architecture)" = "$architecture" ] || fail "architecture of $package: $(field "$package" Architecture)"
  [[ $(field "$package" Maintainer) =~ ^[^\<]+\ \<[^@]+@[^@]+\>$ ]] || fail "maintainer of $package: $(field "$package" Maintainer)"
  [ "$(field "$package" Description | wc -l)" -ge 2 ] || fail "description of $package: $(field "$package" Description)"
  grep -q 'Apache License' "$work/$package/usr/share/doc/$package/copyright" || fail "$package has no licence in copyright"
done
[ "$(for package in "${packages[@]}"; do field "$package" Description | head -n 1; done | sort -u | wc -l)" = ${#packages[@]} ] ||
  fail "two packages have one description"

# contents PACKAGE: compares its files, owners and permissions with the list on the standard input.
contents() {
  dpkg-deb -c "$work/made/${1}_${version}_$architecture.deb" | awk '$1 !~ /^d/ { print $1, $2, $6 }' >"$work/contents"
  diff <(sort -k3) <(sort -k3 "$work/contents") || fail "the contents of $1 differ (>)"
}
contents voxeld <<'EOT'
-rwxr-xr-x root/root ./usr/bin/voxelctl
-rwxr-xr-x root/root ./usr/bin/voxeld
-rw-r--r-- root/root ./usr/lib/systemd/system/voxeld-engine.socket
-rw-r--r-- root/root ./usr/lib/systemd/system/voxeld-engine@.service
-rw-r--r-- root/root ./usr/lib/systemd/system/voxeld-playlist.service
-rw-r--r-- root/root ./usr/lib/systemd/system/voxeld.service
-rw-r--r-- root/root ./usr/lib/systemd/system/voxeld.socket
-rw-r--r-- root/root ./usr/lib/systemd/user/voxeld.service
-rw-r--r-- root/root ./usr/lib/systemd/user/voxeld.socket
-rw-r--r-- root/root ./usr/lib/sysusers.d/voxeld.conf
-rw-r--r-- root/root ./usr/lib/udev/rules.d/70-voxeld.rules
-rwxr-xr-x root/root ./usr/libexec/voxeld/voxeld-engine
-rw-r--r-- root/root ./usr/share/bash-completion/completions/voxelctl
-rw-r--r-- root/root ./usr/share/doc/voxeld/CHANGELOG.md
-rw-r--r-- root/root ./usr/share/doc/voxeld/NOTICES
-rw-r--r-- root/root ./usr/share/doc/voxeld/README.md
-rw-r--r-- root/root ./usr/share/doc/voxeld/SECURITY.md
-rw-r--r-- root/root ./usr/share/doc/voxeld/configuration.md
-rw-r--r-- root/root ./usr/share/doc/voxeld/copyright
-rw-r--r-- root/root ./usr/share/doc/voxeld/examples/playlist.toml
-rw-r--r-- root/root ./usr/share/doc/voxeld/examples/voxeld.toml
-rw-r--r-- root/root ./usr/share/doc/voxeld/operations.md
-rw-r--r-- root/root ./usr/share/doc/voxeld/recordings.md
-rw-r--r-- root/root ./usr/share/doc/voxeld/voxeld.spdx.json
-rw-r--r-- root/root ./usr/share/fish/vendor_completions.d/voxelctl.fish
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-assets.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-calibrate.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-clear.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-completion.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-demo.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-displays.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-doctor.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-draw.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-entities.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-export.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-gallery.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-init.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-input.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-markers.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-pattern.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-pipe.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-play.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-playlist.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-profile.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-record.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-render.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-replay.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-set.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-snapshot.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-stats.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-token.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-top.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-verify.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-watch.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl-why.1.gz
-rw-r--r-- root/root ./usr/share/man/man1/voxelctl.1.gz
-rw-r--r-- root/root ./usr/share/man/man8/voxeld.8.gz
-rw-r--r-- root/root ./usr/share/voxeld/profiles/depthcube.toml
-rw-r--r-- root/root ./usr/share/voxeld/profiles/helix.toml
-rw-r--r-- root/root ./usr/share/voxeld/profiles/lattice-20.toml
-rw-r--r-- root/root ./usr/share/voxeld/profiles/lattice-8.toml
-rw-r--r-- root/root ./usr/share/voxeld/profiles/perspecta.toml
-rw-r--r-- root/root ./usr/share/voxeld/profiles/vortex.toml
-rw-r--r-- root/root ./usr/share/voxeld/profiles/vx1.toml
-rw-r--r-- root/root ./usr/share/voxeld/profiles/vx2-xl.toml
-rw-r--r-- root/root ./usr/share/zsh/vendor-completions/_voxelctl
EOT
contents libvoxeld-dev <<EOT
-rw-r--r-- root/root ./usr/include/voxeld/address.h
-rw-r--r-- root/root ./usr/include/voxeld/assets.h
-rw-r--r-- root/root ./usr/include/voxeld/basics.h
-rw-r--r-- root/root ./usr/include/voxeld/channel.h
-rw-r--r-- root/root ./usr/include/voxeld/client.h
-rw-r--r-- root/root ./usr/include/voxeld/credentials.h
-rw-r--r-- root/root ./usr/include/voxeld/drawing.h
-rw-r--r-- root/root ./usr/include/voxeld/expression.h
-rw-r--r-- root/root ./usr/include/voxeld/receipt.h
-rw-r--r-- root/root ./usr/include/voxeld/shapes.h
-rw-r--r-- root/root ./usr/lib/cmake/voxeld_client/voxeld_client-config-version.cmake
-rw-r--r-- root/root ./usr/lib/cmake/voxeld_client/voxeld_client-config.cmake
-rw-r--r-- root/root ./usr/lib/cmake/voxeld_client/voxeld_client-targets-release.cmake
-rw-r--r-- root/root ./usr/lib/cmake/voxeld_client/voxeld_client-targets.cmake
-rw-r--r-- root/root ./usr/lib/libvoxeld_client.so
-rw-r--r-- root/root ./usr/share/doc/libvoxeld-dev/copyright
-rw-r--r-- root/root ./usr/share/voxeld/proto/voxeld/v1/colormaps.txt
-rw-r--r-- root/root ./usr/share/voxeld/proto/voxeld/v1/display.proto
-rw-r--r-- root/root ./usr/share/voxeld/proto/voxeld/v1/local.proto
-rw-r--r-- root/root ./usr/share/voxeld/proto/voxeld/v1/primitives.proto
-rw-r--r-- root/root ./usr/share/voxeld/proto/voxeld/v1/scene.proto
-rw-r--r-- root/root ./usr/share/voxeld/proto/voxeld/v1/types.proto
EOT
if [ -d "$work/voxeld-cuda" ]; then
  contents voxeld-cuda <<'EOT'
-rw-r--r-- root/root ./usr/lib/systemd/system/voxeld-engine@.service.d/50-voxeld-cuda.conf
-rwxr-xr-x root/root ./usr/libexec/voxeld/voxeld-engine-cuda
-rw-r--r-- root/root ./usr/share/doc/voxeld-cuda/copyright
EOT
fi
if [ -d "$work/voxeld-import" ]; then
  contents voxeld-import <<'EOT'
-rwxr-xr-x root/root ./usr/libexec/voxeld/voxeld-import
-rw-r--r-- root/root ./usr/share/doc/voxeld-import/copyright
EOT
fi
both=$(for package in "${packages[@]}"; do (cd "$work/$package" && find . ! -type d); done | sort | uniq -d)
[ -z "$both" ] || fail "in two packages: $both"
for control in "$work"/*.control; do
  (cd "$control" && for script in postinst prerm postrm; do [ ! -e $script ] || { [ -x $script ] && sh -n $script; } || exit 1; done) ||
    fail "a maintainer script in $control cannot be run"
done

# ---- manual pages and completions are this version's
zcat "$root/usr/share/man/man8/voxeld.8.gz" | head -n 1 | grep -qF "\"voxeld $version\"" || fail "the manual page is another version's"
bash -n "$root/usr/share/bash-completion/completions/voxelctl" || fail "bash cannot read its completion"
for page in "$root"/usr/share/man/man?/*.gz; do
  zcat "$page" | grep -q '^\.SH NAME$' || fail "$page is no manual page"
done

# ---- programs: the system's libraries, each from a package that is depended on
programs=("$work"/voxeld/usr/{bin/voxeld,bin/voxelctl,libexec/voxeld/voxeld-engine} "$work/libvoxeld-dev/usr/lib/libvoxeld_client.so")
[ ! -d "$work/voxeld-import" ] || programs+=("$work/voxeld-import/usr/libexec/voxeld/voxeld-import")
[ ! -d "$work/voxeld-cuda" ] || programs+=("$work/voxeld-cuda/usr/libexec/voxeld/voxeld-engine-cuda")
for program in "${programs[@]}"; do
  package=${program#"$work"/}
  package=${package%%/*}
  depends=$(field "$package" Depends | tr ',' '\n' | awk '{ print $1 }')
  # e2e.hardening checks the programs as they are built; these defences must survive stripping.
  readelf -lW "$program" | grep -q GNU_RELRO && readelf -dW "$program" | grep -q BIND_NOW || fail "$program has lost RELRO or BIND_NOW"
  if readelf -lW "$program" | grep GNU_STACK | grep -q RWE; then fail "$program has an executable stack"; fi
  if readelf -d "$program" | grep -E 'RPATH|RUNPATH'; then fail "$program has a path of its own to libraries"; fi
  if readelf -S "$program" | grep -q '\.symtab'; then fail "$program is not stripped"; fi
  for name in $(readelf -d "$program" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p'); do
    path=$(ldd "$program" | awk -v name="$name" '$1 == name { print $3 } index($1, "/" name) { print $1 }' | head -n 1)
    [ -n "$path" ] || fail "$program: $name is not found"
    file=$(realpath "$path")
    owner=$(dpkg-query -S "$file" 2>/dev/null || dpkg-query -S "${file#/usr}") || fail "$file is of no package"
    owner=${owner%%:*}
    # A package may depend on a name that another one provides.
    names=$(dpkg-query -W -f '${Package}\n${Provides}\n' "$owner" | tr ',' '\n' | awk '{ print $1 }')
    grep -qxF "$names" <<<"$depends" || fail "$program needs $name of $owner, which is not among:" $depends
  done
done
for package in "${packages[@]}"; do
  depends=$(field "$package" Depends | tr ',' '\n' | awk '{ print $1 }')
  if [ "$package" != libvoxeld-dev ] && grep -e '-dev$' <<<"$depends"; then fail "$package depends on what only building needs"; fi
  # The GPU's driver has another source, and ROS is not part of any package.
  if grep -iE 'cuda|nvidia|nccl|^libros|^ros-' <<<"$depends"; then fail "$package depends on CUDA or ROS"; fi
done
grep -qx libabsl-dev <<<"$(field libvoxeld-dev Depends | tr ',' '\n' | awk '{ print $1 }')" || fail "libvoxeld-dev: $(field libvoxeld-dev Depends)"
for package in voxeld-cuda voxeld-import; do
  [ ! -d "$work/$package" ] || field $package Depends | tr ',' '\n' | sed 's/^ *//' | grep -qxF "voxeld (= $version)" ||
    fail "$package does not depend on this version of voxeld: $(field $package Depends)"
done
if readelf -d "$work/voxeld/usr/bin/voxelctl" | grep -E 'NEEDED.*(assimp|gdcm|gdal|ITK|rsvg)'; then fail "voxelctl is linked with a library that reads files"; fi

# ---- voxeld and its engine's program, run in place
unset LD_LIBRARY_PATH VOXELD_SERVER XDG_CONFIG_HOME
export HOME=$work
voxeld=$root/usr/bin/voxeld
voxelctl=$root/usr/bin/voxelctl
[ "$("$voxeld" --version)" = "voxeld $version" ] || fail "voxeld --version: $("$voxeld" --version)"
[ "$("$voxelctl" --version)" = "voxelctl $version" ] || fail "voxelctl --version: $("$voxelctl" --version)"

example=$root/usr/share/doc/voxeld/examples/voxeld.toml
export VOXELD_SERVER=unix:$work/s
"$voxeld" --config "$example" --listen "$VOXELD_SERVER" --http off --log-format text 2>"$work/log" >&2 &
daemon=$!
for _ in $(seq 600); do
  grep -q ' ready ' "$work/log" && break
  kill -0 "$daemon" 2>/dev/null || { cat "$work/log" >&2; fail "voxeld ended"; }
  sleep 0.1 # polled: its log shows when it listens
done
cat "$work/log"
"$voxelctl" --json pattern white >/dev/null
"$voxelctl" --json snapshot "$work/white.png" >"$work/picture.json"
python3 -c 'import json, sys; d = json.load(open(sys.argv[1])); assert d["display"] == "stack" and d["lit_pixels"] == 128**3, d' \
  "$work/picture.json"
kill -TERM "$daemon"
wait "$daemon" || fail "voxeld did not end in peace"
daemon=
# If the engine's program is found, it answers, if only that there is no GPU; if not, the message names it.
grep -q ' display name=stack ' "$work/log" || fail "no line of the display"
if grep 'cannot be started' "$work/log"; then fail "voxeld does not find its engine's program"; fi
mv "$root/usr/libexec/voxeld/voxeld-engine" "$work/engine"
if "$voxeld" --engine cuda --listen "$VOXELD_SERVER" --http off 2>"$work/log"; then fail "an engine without its program"; fi
grep -qF "$root/usr/libexec/voxeld/voxeld-engine cannot be started" "$work/log" || fail "looked elsewhere: $(cat "$work/log")"
mv "$work/engine" "$root/usr/libexec/voxeld/voxeld-engine"
# The CUDA engine is preferred once its package is installed: the daemon starts with it where there is a GPU, and elsewhere reports what is
# missing.
if [ -d "$work/voxeld-cuda" ]; then
  cp -a "$work/voxeld-cuda/." "$root/"
  mv "$root/usr/libexec/voxeld/voxeld-engine-cuda" "$work/engine"
  printf '#!/bin/sh\ntouch "%s"\n' "$work/preferred" >"$root/usr/libexec/voxeld/voxeld-engine-cuda"
  chmod +x "$root/usr/libexec/voxeld/voxeld-engine-cuda"
  if "$voxeld" --engine cuda --listen "$VOXELD_SERVER" --http off 2>"$work/log"; then fail "an engine that is none"; fi
  [ -e "$work/preferred" ] || fail "voxeld does not start the CUDA engine: $(cat "$work/log")"
  mv "$work/engine" "$root/usr/libexec/voxeld/voxeld-engine-cuda"
fi

# ---- udev
rules=$root/usr/lib/udev/rules.d/70-voxeld.rules
first=$(printf '%s\n' "$(basename "$rules")" 73-seat-late.rules | LC_ALL=C sort | head -n 1)
[ "$first" = 70-voxeld.rules ] || fail "uaccess is handed out before these rules are read"
python3 - "$rules" <<'EOT'
import fnmatch, re, sys

TOKEN = re.compile(r'\s*([A-Z_]+)(?:\{([^}]+)\})?\s*(==|!=|\+=|=)\s*"([^"]*)"\s*(?:,|$)')
rules = []
for line in open(sys.argv[1]):
    line = line.strip()
    if not line or line.startswith("#"):
        continue
    tokens, at = [], 0
    while at < len(line):
        token = TOKEN.match(line, at)
        assert token, f"no rule: {line[at:]!r} in {line!r}"
        tokens.append(token.groups())
        at = token.end()
    rules.append(tokens)


def node(device):
    """What these rules make of a device's node."""
    given, label = {}, None
    for tokens in rules:
        if label is not None:
            if ("LABEL", None, "=", label) in tokens:
                label = None
            continue
        matches = True
        for key, name, operator, value in tokens:
            if operator in ("==", "!="):
                have = device.get(f"{key}{{{name}}}" if name else key, "")
                matches &= fnmatch.fnmatchcase(have, value) == (operator == "==")
        if not matches:
            continue
        for key, _, operator, value in tokens:
            if key == "GOTO":
                label = value
            elif operator in ("=", "+=") and key != "LABEL":
                given[key] = value
    assert label is None, f"GOTO {label}: no such label"
    return given


def usb(vendor, product, interfaces, **more):
    return {"ACTION": "add", "SUBSYSTEM": "usb", "ENV{DEVTYPE}": "usb_device", "ATTR{idVendor}": vendor,
            "ATTR{idProduct}": product, "ENV{ID_USB_INTERFACES}": interfaces, **more}


ours = {"GROUP": "voxeld", "MODE": "0660", "TAG": "uaccess"}
assert node(usb("1d50", "607a", ":ff0000:fe0101:")) == ours, "Fadecandy"
assert node(usb("1209", "0001", ":ff5601:")) == ours, "voxlink"
assert node(usb("abcd", "1234", ":030101:ff5601:")) == ours, "voxlink beside another interface"
assert node(usb("1d50", "607b", ":ff0000:")) == {}, "another product"
assert node(usb("abcd", "607a", ":ff0000:")) == {}, "another vendor"
assert node(usb("1209", "0001", ":ff5602:")) == {}, "another protocol"
assert node({**usb("1d50", "607a", ":ff5601:"), "ACTION": "remove"}) == {}
assert node({**usb("1d50", "607a", ":ff5601:"), "ENV{DEVTYPE}": "usb_interface"}) == {}
assert node({**usb("1d50", "607a", ":ff5601:"), "SUBSYSTEM": "tty"}) == {}
EOT
if udevadm verify --help >/dev/null 2>&1; then
  udevadm verify --resolve-names=never "$rules" || fail "udevadm refuses the rules"
else
  echo "left out: udevadm verify (comes with systemd 254)"
fi

# ---- systemd: no complaints about the unit, and a user in the GPU's group
mkdir "$root/etc"
systemd-sysusers --root="$root" voxeld.conf 2>/dev/null
grep -q '^voxeld:.*:/usr/sbin/nologin$' "$root/etc/passwd" || fail "no user voxeld: $(cat "$root/etc/passwd")"
grep -q '^video:.*:voxeld$' "$root/etc/group" || fail "not in video: $(cat "$root/etc/group")"
cp -an /usr/lib/systemd/system/. "$root/usr/lib/systemd/system/" # the standard targets around every unit
mkdir -p "$root/bin"
cp /bin/kill "$root/bin/" # from a package on which it depends
said=$(systemd-analyze verify --root="$root" voxeld.service voxeld.socket voxeld-playlist.service voxeld-engine.socket \
        voxeld-engine@0.service 2>&1) || fail "systemd-analyze verify: $said"
[ -z "$said" ] || fail "systemd-analyze verify: $said"
systemd-analyze security --offline=true --root="$root" --threshold=19 voxeld.service >"$work/security" ||
  fail "exposed: $(cat "$work/security")"
tail -n 1 "$work/security"
systemd-analyze security --offline=true --root="$root" --threshold=10 voxeld-playlist.service >"$work/security" ||
  fail "exposed: $(cat "$work/security")"
tail -n 1 "$work/security"
systemd-analyze security --offline=true --root="$root" --threshold=6 voxeld-engine@0.service >"$work/security" ||
  fail "exposed: $(cat "$work/security")"
tail -n 1 "$work/security"

# ---- maintainer scripts: on a machine with everything, with failing commands, and with nothing
commands=$work/commands
control=$work/voxeld.control
run() { env -i PATH="$commands" CALLS="$work/calls" /bin/sh -e "$control/$1" "${@:2}" >"$work/said" 2>&1; }
calls() {
  rm -rf "$commands" "$work/calls"
  mkdir "$commands"
  : >"$work/calls"
  local result=$1 name
  shift
  for name in "$@"; do
    printf '#!/bin/sh\necho "%s $*" >>"$CALLS"\nexit %s\n' "$name" "$result" >"$commands/$name"
    chmod +x "$commands/$name"
  done
}
called() { diff - "$work/calls" || fail "called (>) instead of expected (<)"; }

calls 0 systemd-sysusers udevadm systemctl
run postinst configure || fail "postinst: $(cat "$work/said")"
called <<'EOT'
systemd-sysusers voxeld.conf
udevadm control --reload
udevadm trigger --action=change --subsystem-match=usb
systemctl daemon-reload
systemctl try-restart voxeld.service
EOT
calls 0 udevadm systemctl
run prerm upgrade 9 && run postrm upgrade 9 && run postinst abort-upgrade 9 || fail "an upgrade: $(cat "$work/said")"
called </dev/null
run prerm remove && run postrm remove || fail "a removal: $(cat "$work/said")"
called <<'EOT'
systemctl disable --now voxeld-playlist.service voxeld.service
udevadm control --reload
systemctl daemon-reload
EOT
calls 1 udevadm systemctl
printf '#!/bin/sh\n' >"$commands/systemd-sysusers"
chmod +x "$commands/systemd-sysusers"
run postinst configure && run prerm remove && run postrm remove || fail "where nothing runs: $(cat "$work/said")"
calls 0 groupadd useradd
printf '#!/bin/sh\nexit 2\n' >"$commands/getent"
chmod +x "$commands/getent"
run postinst configure && run prerm remove && run postrm remove || fail "where nothing is: $(cat "$work/said")"
called <<'EOT'
groupadd --system voxeld
useradd --system --gid voxeld --groups video --no-create-home --home-dir / --shell /usr/sbin/nologin voxeld
EOT
calls 1 systemd-sysusers
if run postinst configure; then fail "no user, and not a word"; fi

# ---- maintainer scripts of voxeld-cuda, from the tree: they are the same in every build
control=$(dirname "$0")/../../packaging/cuda
calls 0 systemctl
run postinst configure && run postinst abort-upgrade 9 && run postrm upgrade 9 && run postrm remove || fail "voxeld-cuda: $(cat "$work/said")"
called <<'EOT'
systemctl daemon-reload
systemctl try-restart voxeld.service
systemctl daemon-reload
systemctl try-restart voxeld.service
EOT
calls 1 systemctl
run postinst configure && run postrm remove || fail "voxeld-cuda where nothing runs: $(cat "$work/said")"
calls 0
run postinst configure && run postrm remove || fail "voxeld-cuda where nothing is: $(cat "$work/said")"
echo "packed, looked at, run: $(cd "$work/made" && stat -c '%n, %s bytes;' *.deb | tr '\n' ' ')"
