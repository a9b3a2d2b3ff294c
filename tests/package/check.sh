#!/usr/bin/env bash
# check.sh BUILD SOURCE: installs the components into a clean folder, builds the examples against them, runs what was
# installed. About 40 s.
set -euo pipefail
build=$1 source=$2
work=$(mktemp -d)
children=()
clean_up() {
  local child
  for child in "${children[@]}"; do kill "$child" 2>/dev/null || true; done
  wait || true
  [[ ! -x $prefix/bin/rtbus ]] || "$prefix/bin/rtbus" clean --session ${session}_b >/dev/null || true
  rm -rf "$work"
}
trap clean_up EXIT
prefix=$work/usr
session=package_$$

fail() { echo "FAILED: $*" >&2; exit 1; }
expect() {  # expect TEXT COMMAND…: the output contains TEXT
  local text=$1 out
  shift
  out=$("$@" 2>&1) || fail "'$*' ended with $?: $out"
  grep -qF -- "$text" <<<"$out" || fail "'$*' does not say '$text' but: $out"
}

for component in runtime bridge clib python dev; do
  cmake --install "$build" --prefix "$prefix" --component $component --strip >"$work/install.log" || fail "installation"
done
! grep -rl "$source" "$prefix/lib/cmake" "$prefix/share" || fail "these files name the source tree"
for program in "$prefix"/lib/rtbus/bin/*; do
  ! readelf -d "$program" | grep -E 'RUNPATH|RPATH' || fail "$program looks for libraries in the folders above"
done

# The examples, copied away from the source tree.
cp -r "$prefix/share/doc/librtbus-dev/examples" "$source/tests/package" "$work"
# shellcheck disable=SC2016  # backquotes of Markdown
diff <(sed -n '/^```cpp$/,/^```$/{//!p}' "$work/examples/README.md") "$work/examples/subscriber.cpp" ||
  fail "README.md shows another subscriber.cpp"
configure=(cmake -G Ninja "-DCMAKE_PREFIX_PATH=$prefix" "-DRTBUS_HEADERS=$prefix/include/rtbus")
for folder in examples package; do
  "${configure[@]}" -S "$work/$folder" -B "$work/$folder/build" >"$work/log" 2>&1 || { cat "$work/log"; fail "cmake $folder"; }
  ninja -C "$work/$folder/build" >"$work/log" 2>&1 || { cat "$work/log"; fail "building $folder"; }
done

# From here on nothing may be written below the prefix.
mkdir "$work/here"
cd "$work/here"
touch "$work/installed"
rtbus=$prefix/bin/rtbus examples=$work/examples/build
expect 'run' "$rtbus" __complete ru
expect 'stack_125' "$rtbus" __complete run sta
if [[ -x $prefix/lib/rtbus/bin/rtbus_bridge ]]; then
  expect 'Publishes a session that runs until Ctrl-C' "$rtbus" bridge --help
  expect '--set' "$rtbus" __complete bridge wall --s
fi
expect 'work-precision' "$rtbus" __complete evaluate wo
expect 'there is no session file wal;' bash -c "! '$rtbus' run wal"
expect 'toy moved by 0.0' "$examples/toy_driver" "$work/examples/toy_driver/toy.yaml"
expect '[  PASSED  ]' "$rtbus" conformance "$examples/libtoy.so" "$work/examples/toy_driver/toy.yaml"
expect 'toy' env RTBUS_DRIVER_PATH="$examples" "$rtbus" run wall --duration 1 --set session=${session}_c \
  --set "haptic.0.device=$work/examples/toy_driver/toy.yaml" --no-bare-loop

# The libraries are not in a folder of the system's here.
libraries=$(dirname "$(find "$prefix/lib" -name librtbus.so.1)")
export RTBUS_LIBRARY_DIR=$libraries PYTHONPATH=$prefix/lib/python3/dist-packages PYTHONDONTWRITEBYTECODE=1
export RTBUS_PROGRAM=$rtbus
# Debian's interpreter, which has the packages.
if /usr/bin/python3 -c 'import numpy' 2>/dev/null; then
  cp "$prefix"/share/doc/python3-rtbus/examples/python_wall.* .
  PATH=/usr/bin:$PATH "$rtbus" run python_wall.yaml --duration 3 --set session=${session}_p --report wall.json --no-bare-loop >wall.txt 2>&1 ||
    { cat wall.txt; fail "python_wall"; }
  grep -q '"engine": "external"' wall.json || fail "python_wall: another engine"
fi
# `pip install .` in the source tree, a copy of it here, into an environment of its own.
if [[ -z $(/usr/bin/python3 -c 'import importlib.util as u; print(*(n for n in "numpy pip setuptools venv wheel".split() if not u.find_spec(n)))') ]]; then
  mkdir -p "$work"/tree/{rtbus,build/lib}
  cp "$source/CMakeLists.txt" "$work/tree"
  cp -r "$source/rtbus/python" "$work/tree/rtbus"
  cp -L "$build"/lib/librtbus{,_engine}.so.1 "$work/tree/build/lib"
  /usr/bin/python3 -m venv --system-site-packages --without-pip "$work/venv"
  (
    unset PYTHONPATH RTBUS_LIBRARY_DIR
    cd "$work/tree/rtbus/python"
    "$work/venv/bin/python3" -m pip install -q --no-index --no-build-isolation . >"$work/log" 2>&1 || { cat "$work/log"; fail "pip install"; }
    cd "$work/here"
    expect "$work/venv" "$work/venv/bin/python3" -c 'import rtbus; print(rtbus.__file__)'
    PATH=$work/venv/bin:$PATH "$rtbus" run python_wall.yaml --duration 3 --set session=${session}_v --report pip.json --no-bare-loop >pip.txt 2>&1 ||
      { cat pip.txt; fail "python_wall with the package of pip"; }
    grep -q '"engine": "external"' pip.json || fail "python_wall with the package of pip: another engine"
  ) || exit 1
else
  echo "python3-pip, python3-venv, python3-setuptools or python3-wheel is not installed: pip install is not tried"
fi
cp "$work/examples/own_engine.yaml" .
PATH=$examples:$PATH "$rtbus" run own_engine.yaml --duration 3 --set session=${session}_o --no-bare-loop >own.txt 2>&1 ||
  { cat own.txt; fail "own_engine"; }

"$rtbus" run wall --duration 3 --set session=$session --report report.json --no-bare-loop >run.txt 2>&1 &
children+=($!)
"$examples/publisher" "${session}_b" 20 &
children+=($!)
for _ in $(seq 50); do [[ -e /dev/shm/rtbus.$session.haptic0.device_state ]] && break; sleep 0.1; done
expect 'the haptic node has ended' "$examples/subscriber" $session
# The installed viewer serves its page, which is all in the program.
if [[ -x $prefix/lib/rtbus/bin/rtbus_view ]]; then
  "$rtbus" view --port 0 >view.txt 2>&1 &
  children+=($!)
  for _ in $(seq 50); do [[ -s view.txt ]] && break; sleep 0.1; done
  port=$(sed -n '1s|http://127.0.0.1:\([0-9]*\)/.*|\1|p' view.txt)
  for file in / /main.js /style.css; do
    exec 3<>"/dev/tcp/127.0.0.1/$port"
    printf 'GET %s HTTP/1.1\r\nHost: 127.0.0.1:%s\r\nConnection: close\r\n\r\n' "$file" "$port" >&3
    read -r status <&3
    [[ $status == *" 200 "* ]] || fail "the installed viewer answers '$status' to GET $file"
    exec 3>&-
  done
fi
wait "${children[0]}" || { cat run.txt; fail "rtbus run"; }
grep -q "^$session: $prefix/share/rtbus/config/wall.yaml" run.txt || { cat run.txt; fail "another session file was run"; }
[[ -s report.json ]] || fail "no report in the current folder"
expect 'force_n[1] = ' "$examples/printer" "${session}_b" sensor.force
# Whether this machine is fast is not the question here: the evaluation finds its session and writes into this folder.
"$rtbus" bench physics --session free_block --quick >bench.txt 2>&1 || true
grep -q free_block out/bench/physics/summary.json || { cat bench.txt; fail "rtbus bench"; }

written=$(find "$prefix" -newer "$work/installed")
[[ -z $written ]] || fail "written below the prefix: $written"
echo "installed, built against and run"
