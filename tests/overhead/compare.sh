#!/usr/bin/env bash
# Instructions per step of our node over a bare Bullet program of the same scene, counted by callgrind.
# usage: compare.sh BIN_DIR [CUBES…]   status 1 when a ratio is above 1.05, 77 (skipped) without valgrind
set -euo pipefail

bin=$1
shift
sizes=("$@")
[[ ${#sizes[@]} -gt 0 ]] || sizes=(125 500)
steps=20
bar=1.05
command -v valgrind >/dev/null || { echo "valgrind is not there (tools/install_packages)"; exit 77; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# Instructions inside measured_steps(), over the number of steps.
count() {
  local program=$1 cubes=$2 out=$folder/$1.$2
  # What callgrind says is shown only when it fails.
  if ! valgrind --tool=callgrind --collect-atstart=no --toggle-collect='measured_steps*' \
    --callgrind-out-file="$out" "$bin/$program" "$cubes" "$steps" >"$out.log" 2>&1; then
    cat "$out.log" >&2
    return 1
  fi
  awk -v steps="$steps" '/^(totals|summary):/ { total = $2 } END { if (total == 0) exit 1; printf "%.0f\n", total / steps }' "$out"
}

status=0
printf '%6s %22s %22s %7s\n' cubes 'bare [instr./step]' 'ours [instr./step]' ratio
for cubes in "${sizes[@]}"; do
  bare=$(count overhead_bare "$cubes")
  ours=$(count overhead_ours "$cubes")
  ratio=$(awk -v o="$ours" -v b="$bare" 'BEGIN { printf "%.4f", o / b }')
  printf '%6s %22s %22s %7s\n' "$cubes" "$bare" "$ours" "$ratio"
  awk -v r="$ratio" -v bar="$bar" 'BEGIN { exit !(r > bar) }' && { echo "above $bar at $cubes cubes"; status=1; }
done
exit $status
