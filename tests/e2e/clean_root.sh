#!/usr/bin/env bash
# Installs the package in a Debian that has nothing else, following docs/operations.md step by step, with Debian's Prometheus scraping. Run
# it manually, as root: it downloads a Debian. systemd does not run there, so the daemon is started like its unit does, but without the
# unit's confinement.
set -euo pipefail

[ $# = 2 ] || { echo "usage: $0 PACKAGE.deb ROOT   (ROOT: an empty or missing folder, left there)" >&2; exit 2; }
package=$(realpath "$1")
source=$(realpath "$(dirname "$0")/../..")
root=$2
fail() { echo "clean_root: $*" >&2; exit 1; }
step() { echo "== $*"; }
# Prints the n-th block of code under a heading of the manual.
block() {
  awk -v heading="## $1" -v wanted="$2" '
    /^## / { within = $0 == heading }
    within && /^```/ { if (open) { open = 0 } else { open = 1; ++count } next }
    within && open && count == wanted' "$source/docs/operations.md"
}

step "a Debian with nothing else"
mkdir -p "$root"
root=$(realpath "$root")
debootstrap --variant=minbase --include=ca-certificates bookworm "$root" >"$root.log" || fail "debootstrap: $(tail -5 "$root.log")"
# The process of a subshell becomes the one that is started: `in_root … &`.
start_in_root() { exec chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 "$@"; }
in_root() { chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"; }
daemons=()
finish() {
  for pid in "${daemons[@]}"; do kill "$pid" 2>/dev/null || true; done
  wait || true
  umount "$root/dev" "$root/proc" 2>/dev/null || true
}
trap finish EXIT
mount --bind /proc "$root/proc"
mount --bind /dev "$root/dev"

step "install"
cp "$package" "$root/tmp/voxeld.deb"
in_root apt-get -q -y --no-install-recommends install /tmp/voxeld.deb systemd openssl prometheus >>"$root.log" 2>&1 || fail "apt-get: $(tail -5 "$root.log")"
in_root dpkg -s voxeld | grep -E '^(Package|Status|Version|Depends)'
{
  echo 'sudo() { "$@"; }'
  echo 'systemctl() { case "$*" in "enable --now "*) shift 2; command systemctl enable "$@";; *) command systemctl "$@";; esac; }'
  block Install 1 | grep -vE '^(tools/package|sudo apt install)' | grep -v '^voxelctl doctor'
} >"$root/tmp/install.sh"
in_root bash -euxc '. /tmp/install.sh' 2>&1 | sed 's/^/   /'

step "access control, other machines"
mkdir "$root/root/work"
{
  echo 'sudo() { "$@"; }'
  block "Access control" 1
  block "Other machines" 1
} >"$root/tmp/access.sh"
in_root bash -euc 'cd /root/work; . /tmp/access.sh' >>"$root.log" 2>&1 || fail "access: $(tail -5 "$root.log")"
# The manual's lines are keys of one file; each table is written once.
{
  block "Other machines" 2
  sed -n '/^\[engine\]/,$p' "$root/usr/share/doc/voxeld/examples/voxeld.toml"
} | sed 's/^listen = .*/&\nhttp = "127.0.0.1:8088"/' >"$root/etc/voxeld/voxeld.toml"
in_root voxeld --check-config | grep -E '^(listen|grants|tls_certificate|http) ' | sed 's/^/   /'

step "the daemon, as its unit starts it"
install -d -o "$(in_root id -u voxeld)" -g "$(in_root id -g voxeld)" -m 0750 "$root/run/voxeld" "$root/var/lib/voxeld"
start_in_root setpriv --reuid voxeld --regid voxeld --init-groups --no-new-privs \
  voxeld --state-dir /var/lib/voxeld >"$root.voxeld.log" 2>&1 &
daemons+=($!)
for _ in $(seq 300); do grep -q ' ready ' "$root.voxeld.log" && break; sleep 0.1; done
grep ' ready ' "$root.voxeld.log" || fail "not ready: $(cat "$root.voxeld.log")"

step "a client over TLS, a token over it"
echo "127.0.0.1 display.example" >>"$root/etc/hosts"
{
  block "Other machines" 3
  echo 'export VOXELD_TOKEN_FILE=stage-left.token; voxelctl displays'
  echo 'voxelctl draw "sphere radius=0.7 color=orange"; voxelctl entities'
} >"$root/tmp/client.sh"
in_root bash -uc 'cd /root/work; . /tmp/client.sh' 2>&1 | sed 's/^/   /'

step "Prometheus"
block "Watching it" 1 >"$root/etc/prometheus/prometheus.yml"
sed -i '1i global:\n  scrape_interval: 1s' "$root/etc/prometheus/prometheus.yml"
in_root promtool check config /etc/prometheus/prometheus.yml | sed 's/^/   /'
curl -sf http://127.0.0.1:8088/metrics | in_root promtool check metrics && echo "   promtool check metrics: nothing to say"
start_in_root prometheus --config.file=/etc/prometheus/prometheus.yml --storage.tsdb.path=/tmp/prometheus \
  --web.listen-address=127.0.0.1:9099 >"$root.prometheus.log" 2>&1 &
daemons+=($!)
ask() { curl -sf --get http://127.0.0.1:9099/api/v1/query --data-urlencode "query=$1"; }
for _ in $(seq 300); do ask up | grep -q '"job":"voxeld"},"value":\[[0-9.]*,"1"' && break; sleep 0.1; done
ask 'up{job="voxeld"}' | grep '"1"' || fail "not scraped: $(ask up)"
for query in 'count({job="voxeld"})' 'voxeld_entities' 'voxeld_info'; do echo "   $query: $(ask "$query")"; done
ask voxeld_entities | grep -q '"1"\]' || fail "the sphere is not among the figures"
curl -sf http://127.0.0.1:8088/healthz | sed 's/^/   healthz: /'

step "the units"
in_root systemd-analyze verify voxeld.service voxeld.socket voxeld-playlist.service voxeld-engine.socket voxeld-engine@0.service
for unit in voxeld voxeld-playlist voxeld-engine@0; do
  in_root systemd-analyze security --offline=true "$unit.service" --no-pager | tail -n 1
done
echo "clean_root: passed"
