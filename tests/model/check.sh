#!/bin/sh
# Checks the protocols between threads and processes exhaustively: as they are they must hold, each broken variant must be
# caught. bus.pml: the ring, by the release and acquire of C++. weak_*.pml: ring, cells and doorbell on a machine with store
# buffers and reordered loads, like AArch64.
# Prints one line per variant; exits 1 when a verdict is not the expected one. Needs spin and a C compiler; exits 77 without
# spin.
set -u
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT INT TERM
command -v spin >/dev/null || { echo "spin is not installed (apt-get install spin)"; exit 77; }
failures=0

# check NAME EXPECTED(holds|caught) FLAGS…, of the file $model
model=bus.pml
check() {
  name=$1 expected=$2
  shift 2
  cd "$work" && rm -f pan pan.* out
  if ! spin -a "$@" "$here/$model" >out 2>&1 || ! ${CC:-cc} -O1 -DSAFETY -DCOLLAPSE -DMEMLIM=1900 -o pan pan.c >>out 2>&1; then
    cat out
    echo "ERROR    $name: the model does not build"
    failures=$((failures + 1))
    return
  fi
  ./pan -m200000 >out 2>&1
  states=$(sed -n 's/^ *\([0-9.e+]*\) states, stored.*/\1/p' out)
  errors=$(sed -n 's/.*errors: \([0-9]*\).*/\1/p' out)
  if grep -q -e 'max search depth too small' -e 'out of memory' -e 'hash-table is full' out || [ -z "$errors" ]; then
    verdict=unfinished
  elif [ "$errors" -eq 0 ]; then
    verdict=holds
  else
    verdict=caught
  fi
  why=$(sed -n 's/^pan:[0-9]*: \(.*\) (at depth.*/\1/p' out | head -n 1)
  if [ "$verdict" = "$expected" ]; then mark=ok; else mark=WRONG; failures=$((failures + 1)); fi
  printf '%-6s %-10s %10s states  %s%s\n' "$mark" "$verdict" "${states:-?}" "$name" "${why:+  — $why}"
}

echo "The protocol as it is:"
check "ring of 2, read_latest" holds -DRING=2 -DSAMPLES=5 -DLATEST
check "ring of 3, read_latest" holds -DRING=3 -DSAMPLES=5 -DLATEST
check "ring of 2, read_next" holds -DRING=2 -DSAMPLES=5 -DNEXT
check "ring of 3, read_next" holds -DRING=3 -DSAMPLES=5 -DNEXT
check "ring of 2, both readers" holds -DRING=2 -DSAMPLES=3 -DCALLS=1 -DLATEST -DNEXT
check "ring of 3, both readers" holds -DRING=3 -DSAMPLES=4 -DCALLS=1 -DLATEST -DNEXT
check "progress of read_latest" holds -DSC -DRING=2 -DSAMPLES=4 -DLATEST
check "progress of read_next" holds -DSC -DRING=3 -DSAMPLES=4 -DNEXT
check "no first check: it only saves a copy" holds -DNO_FIRST_CHECK -DRING=2 -DLATEST

echo "False claims, to see that the model reaches what it should:"
check "no sample of a second writer is ever read" caught -DWITNESS_SUCCESSOR -DRING=2 -DLATEST
check "no read ever gives up" caught -DWITNESS_LAPPED -DRING=2 -DSAMPLES=5 -DLATEST

echo "Broken on purpose:"
check "no second check of the sequence word" caught -DNO_SECOND_CHECK -DRING=2 -DLATEST
check "no check at all" caught -DNO_FIRST_CHECK -DNO_SECOND_CHECK -DRING=2 -DLATEST
check "payload stored relaxed" caught -DRELAXED_STORES -DRING=2 -DLATEST
check "payload loaded relaxed" caught -DRELAXED_LOADS -DRING=2 -DLATEST
check "completion and newest stored relaxed" caught -DRELAXED_COMPLETION -DRING=2 -DLATEST
check "slot not marked while it is written" caught -DNO_MARK -DRING=2 -DLATEST
check "sequence word checked for parity only" caught -DPARITY_ONLY -DRING=2 -DNEXT
check "newest announced before the slot is complete" caught -DNEWEST_FIRST -DSC -DRING=2 -DLATEST
check "take-over writes the newest number again" caught -DTAKEOVER_REWRITES_NEWEST -DRING=2 -DLATEST
check "take-over leaves a gap in the numbers" caught -DTAKEOVER_LEAVES_GAP -DRING=3 -DNEXT
check "take-over without the order of the lock" caught -DTAKEOVER_WITHOUT_LOCK -DRING=2 -DLATEST

echo "On a machine with a weak memory order, the ring:"
model=weak_ring.pml
check "ring of 2, the newest" holds -DRING=2 -DSAMPLES=4 -DCALLS=3
check "ring of 3, the newest" holds -DRING=3 -DSAMPLES=4
check "ring of 2, in order" holds -DIN_ORDER -DRING=2 -DSAMPLES=4
check "ring of 3, in order" holds -DIN_ORDER -DRING=3 -DSAMPLES=4 -DCALLS=3
check "completion stored plain: newest releases too" holds -DCOMPLETION_STORED_PLAIN
check "newest and sequence loaded plain: the address depends on them" holds -DNEWEST_LOADED_PLAIN -DSEQUENCE_LOADED_PLAIN
check "claim: no sample is read" caught -DCLAIM_NOTHING_IS_READ
check "words stored plain" caught -DWORDS_STORED_PLAIN
check "newest stored plain" caught -DNEWEST_STORED_PLAIN
check "completion and newest stored plain" caught -DCOMPLETION_STORED_PLAIN -DNEWEST_STORED_PLAIN
check "words loaded plain" caught -DWORDS_LOADED_PLAIN
check "no second check of the sequence word" caught -DNO_SECOND_CHECK
check "take-over without the lock" caught -DTAKEOVER_WITHOUT_LOCK

echo "Likewise, the doorbell:"
model=weak_doorbell.pml
check "one sleeper" holds -DSAMPLES=3
check "two sleepers" holds -DSLEEPERS=2
check "the look only acquires: the ring before it releases" holds -DLOOK_ACQUIRES_ONLY
check "claim: nobody wakes" caught -DCLAIM_NOBODY_WAKES
check "nobody rings" caught -DNO_RING
check "ring relaxed" caught -DRING_RELAXED
check "the look only acquires, newest stored plain" caught -DLOOK_ACQUIRES_ONLY -DNEWEST_STORED_PLAIN
check "number of rings loaded plain" caught -DSEEN_LOADED_PLAIN

echo "Likewise, the cells that hand objects over:"
model=weak_cells.pml
for cell in SUBSCRIPTION PUBLICATION LATEST_CELL; do
  check "$cell" holds -D$cell
  check "$cell, claim: nothing arrives" caught -D$cell -DCLAIM_NOTHING_ARRIVES
  check "$cell, offered relaxed" caught -D$cell -DOFFER_RELAXED
  check "$cell, given back relaxed" caught -D$cell -DRETURN_RELAXED
  check "$cell, taken relaxed: the address depends on it" holds -D$cell -DTAKE_RELAXED
done

if [ "$failures" -ne 0 ]; then
  echo "$failures verdicts are wrong"
  exit 1
fi
echo "all verdicts as expected"
