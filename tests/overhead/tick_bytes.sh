#!/usr/bin/env bash
# Distinct cache lines and pages that a tick of the haptic loop touches, traced by valgrind's lackey: of data and of code.
# A figure for people, not a test: it takes about 10 minutes.
# usage: tools/build overhead_tick_bytes && tests/overhead/tick_bytes.sh BIN_DIR SOURCE_DIR [SCENE…]   status 77 (skipped) without valgrind
set -euo pipefail

bin=$1
source=$2
shift 2
scenes=("$@")
[[ ${#scenes[@]} -gt 0 ]] || scenes=(direct wall block mesh_10000 mesh_100000 soft)
command -v valgrind >/dev/null || { echo "valgrind is not there (tools/install_packages)"; exit 77; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
program=$bin/overhead_tick_bytes
cycle=$(valgrind -q --tool=none "$program" address)

# A hand that touches at 0.4 s and strokes; ticks count from 0.5 s on, at 1 kHz.
stroke() {
  echo "haptic.0.device={schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: push, start_m: $1, \
direction: $2, distance_m: 0.03, speed_m_s: 0.05, start_s: 0.3, impedance: firm}}"
}
mesh() {
  "$program" bumps "$folder/$1.obj" "$1"
  echo "scene={schema: scene/1, bodies: [{name: shape, type: static, shape: {mesh: {file: $folder/$1.obj, metres_per_unit: 1}}}]}"
}

# Session and settings of a scene.
settings() {
  local local_contact=(haptic.0.method=local_contact physics.throttle_hz=18 haptic.0.coupling.stiffness_n_per_m=400)
  case $1 in
    direct) set -- wall.yaml haptic.0.method=direct "$(stroke '[-0.02, -0.002, 0]' '[1, 0, 0]')" ;;
    wall) set -- wall.yaml "${local_contact[@]}" "$(stroke '[-0.02, -0.002, 0]' '[1, 0, 0]')" ;;
    block) set -- free_block.yaml "${local_contact[@]}" "$(stroke '[0, 0, 0.01]' '[0, 0, -1]')" ;;
    mesh_10000) set -- wall.yaml "${local_contact[@]}" physics.engine=bullet "$(mesh 71)" "$(stroke '[-0.02, 0.003, 0.002]' '[1, 0, 0]')" ;;
    mesh_100000) set -- wall.yaml "${local_contact[@]}" physics.engine=bullet "$(mesh 224)" "$(stroke '[-0.02, 0.003, 0.002]' '[1, 0, 0]')" ;;
    soft) set -- soft.yaml "${local_contact[@]}" haptic.0.coupling.stiffness_n_per_m=300 "$(stroke '[-0.01, 0.01, 0]' '[0, -1, 0]')" 'haptic.0.mapping={offset_m: [0, 0.048, 0]}' ;;
    *) echo "no scene '$1'" >&2; exit 2 ;;
  esac
  printf '%s\n' "$@"
}

printf '%-12s %6s %21s %14s %21s %14s\n' scene ticks 'data p50, p99 [B]' 'pages' 'code p50, p99 [B]' 'pages'
for scene in "${scenes[@]}"; do
  mapfile -t words < <(settings "$scene")
  valgrind -q --tool=lackey --trace-mem=yes --log-fd=9 "$program" run "$source/config/${words[0]}" 1.0 "${words[@]:1}" \
    9>&1 >/dev/null 2>"$folder/log" | "$program" count "$cycle" 500 >"$folder/out" || { cat "$folder/log" >&2; exit 1; }
  IFS=$'\t' read -r ticks data50 data99 data_pages50 data_pages99 code50 code99 code_pages50 code_pages99 <"$folder/out"
  printf '%-12s %6s %10s %10s %6s %7s %10s %10s %6s %7s   %s\n' "$scene" "$ticks" "$data50" "$data99" "$data_pages50" "$data_pages99" \
    "$code50" "$code99" "$code_pages50" "$code_pages99" "$(cat "$folder/log")"
done
