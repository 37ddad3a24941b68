#!/usr/bin/env bash
# Runs what tools/fuzz --pack has put beside this script: every fuzz target for the same time, and hostile_exchanges beside them. It needs
# bash, tar, gzip and the coreutils.
set -uo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

usage() {
  cat <<'EOT2'
usage: run.sh SECONDS OUT [--cores N] [--exchange-cores N] [--only fuzz|exchanges] [--seed S] [TARGET …]
  SECONDS              of the whole run; the targets share them in rounds
  OUT                  a folder; what is there of an earlier run is begun with, and added to
  --cores N            of the machine (all); the targets have those that hostile_exchanges has not
  --exchange-cores N   of these (a half), half of them for each side
  --only WHAT          with all cores
  --seed S             of hostile_exchanges (the time of day)
In OUT: TARGET.tar.gz (new inputs), TARGET.csv (seconds, executions, edges, whenever an edge was new), TARGET.log (its end),
summary.csv, found/TARGET-… (inputs that broke it), exchanges-SIDE.json and .log. tools/fuzz --import OUT takes it home.
Ends with 1 if something broke.
EOT2
}

cores=$(nproc)
exchange_cores=
only=
seed=$(date +%s)
targets=()
words=()
while [ $# -gt 0 ]; do
  case "$1" in
    --cores | --exchange-cores | --only | --seed)
      [ $# -ge 2 ] || { usage >&2; exit 2; }
      case "$1" in
        --cores) cores=$2 ;;
        --exchange-cores) exchange_cores=$2 ;;
        --only) only=$2 ;;
        --seed) seed=$2 ;;
      esac
      shift ;;
    -h | --help) usage; exit 0 ;;
    *) words+=("$1") ;;
  esac
  shift
done
[ ${#words[@]} -ge 2 ] && [[ ${words[0]} =~ ^[1-9][0-9]*$ ]] && [[ $cores =~ ^[1-9][0-9]*$ ]] || { usage >&2; exit 2; }
seconds=${words[0]}
out=${words[1]}
targets=("${words[@]:2}")
if [ ${#targets[@]} -eq 0 ]; then
  for name in "$here"/options/*; do
    targets+=("$(basename "$name")")
  done
fi
for target in "${targets[@]}"; do
  [ -x "$here/bin/${target}_fuzz" ] || { echo "run.sh: there is no target $target" >&2; exit 2; }
done
case "$only" in
  fuzz) exchange_cores=0 ;;
  exchanges) exchange_cores=$cores ;;
  '') [ -n "$exchange_cores" ] || exchange_cores=$((cores / 2)) ;;
  *) usage >&2; exit 2 ;;
esac
fuzz_cores=$((cores - exchange_cores))
[ "$fuzz_cores" -gt 0 ] || targets=()

mkdir -p "$out/found" "$out/grown" || exit 2
out=$(cd "$out" && pwd)
cp "$here/COMMIT" "$out/COMMIT"
asan=allocator_may_return_null=1:handle_abort=1
# Where a process may not trace another, leaks cannot be detected.
leaks=1
if ! ASAN_OPTIONS=detect_leaks=1 LLVM_PROFILE_FILE=/dev/null "$here/bin/greeting_fuzz" -runs=1 >/dev/null 2>&1; then
  leaks=0
  echo "run.sh: without a look for leaks, which this machine refuses" >&2
fi
export ASAN_OPTIONS=$asan:detect_leaks=$leaks UBSAN_OPTIONS=print_stacktrace=1 LLVM_PROFILE_FILE=/dev/null
broken=0

# Notes when new edges were found, and the end of the log. Reads libFuzzer's messages line by line.
follow() {  # TARGET BEGIN
  local line edges=0 begin=$2 now
  while IFS= read -r line; do
    printf '%s\n' "$line" >>"$out/grown/$1.log"
    [[ $line =~ ^#([0-9]+).*[[:space:]]cov:\ ([0-9]+) ]] || continue
    [ "${BASH_REMATCH[2]}" -gt "$edges" ] || continue
    edges=${BASH_REMATCH[2]}
    now=${EPOCHREALTIME/[.,]/}
    printf '%d.%03d,%s,%s\n' $(((now - begin) / 1000000)) $(((now - begin) / 1000 % 1000)) "${BASH_REMATCH[1]}" "$edges" >>"$out/$1.csv"
  done
}

fuzz() {  # TARGET SECONDS
  local target=$1 length=$2 begin=${EPOCHREALTIME/[.,]/} end executions=0 status=0 left more
  local inputs=$out/grown/$target
  mkdir -p "$inputs"
  [ ! -f "$out/$target.tar.gz" ] || tar -C "$inputs" -xzf "$out/$target.tar.gz"
  printf 'seconds,executions,edges\n' >"$out/$target.csv"
  : >"$out/grown/$target.log"
  local options=()
  mapfile -t options <"$here/options/$target"
  end=$((begin + length * 1000000))
  # An input that breaks the target ends it; it is then started again, up to that often.
  for ((tries = 0; tries < 4; ++tries)); do
    left=$(((end - ${EPOCHREALTIME/[.,]/} + 500000) / 1000000))
    [ "$left" -gt 0 ] || break
    (cd "$here" && exec "bin/${target}_fuzz" "${options[@]}" -timeout=20 -rss_limit_mb=2048 "-artifact_prefix=$out/found/$target-" \
      "-max_total_time=$left" -print_final_stats=1 "$inputs" "corpus/$target" 2>&1 >/dev/null) | follow "$target" "$begin"
    status=${PIPESTATUS[0]}
    [ "$status" -ne 0 ] || break
  done
  while read -r more; do executions=$((executions + more)); done < <(sed -n 's/^stat::number_of_executed_units: *//p' "$out/grown/$target.log")
  tail -n 200 "$out/grown/$target.log" >"$out/$target.log"
  local now=${EPOCHREALTIME/[.,]/}
  tar -C "$inputs" -czf "$out/$target.tar.gz" . && rm -rf "$inputs" "$out/grown/$target.log"
  printf '%s,%s,%d.%01d,%s\n' "$target" "$executions" $(((now - begin) / 1000000)) $(((now - begin) / 100000 % 10)) "$status" >>"$out/summary.csv"
}

exchange() {  # SIDE JOBS SECONDS
  (cd "$here" && exec bin/hostile_exchanges --side "$1" --jobs "$2" --seconds "$3" --seed "$seed" --corpus corpus --json) \
    >"$out/exchanges-$1.json" 2>"$out/exchanges-$1.log"
  printf '%s\n' $? >"$out/grown/exchanges-$1.status"
}

printf 'target,executions,seconds,status\n' >"$out/summary.csv"
rm -f "$out"/grown/*.status
running=()
if [ "$exchange_cores" -gt 0 ]; then
  device=$(((exchange_cores + 1) / 2))
  exchange device "$device" "$seconds" &
  running+=($!)
  if [ $((exchange_cores - device)) -gt 0 ]; then
    exchange peer $((exchange_cores - device)) "$seconds" &
    running+=($!)
  fi
fi
if [ ${#targets[@]} -gt 0 ]; then
  rounds=$(((${#targets[@]} + fuzz_cores - 1) / fuzz_cores))
  each=$((seconds / rounds))
  [ "$each" -gt 0 ] || each=1
  for ((i = 0; i < ${#targets[@]}; i += fuzz_cores)); do
    echo "run.sh: ${targets[*]:i:fuzz_cores}: $each s each" >&2
    round=()
    for target in "${targets[@]:i:fuzz_cores}"; do
      fuzz "$target" "$each" &
      round+=($!)
    done
    wait "${round[@]}"
  done
fi
[ ${#running[@]} -eq 0 ] || wait "${running[@]}"
for status in "$out"/grown/*.status; do
  [ ! -f "$status" ] || [ "$(cat "$status")" = 0 ] || { echo "run.sh: $(basename "$status" .status) broke" >&2; broken=1; }
done
rm -rf "$out/grown"
if grep -qvE '^target|,0$' "$out/summary.csv" || [ -n "$(ls -A "$out/found")" ]; then
  echo "run.sh: something broke; see $out/found and the logs" >&2
  broken=1
fi
cat "$out/summary.csv"
cat "$out"/exchanges-*.json 2>/dev/null
exit "$broken"
