# SPDX-License-Identifier: Apache-2.0
# Installs the project into the environment; `wasd` reads this where there is none that will do.

LOG=install.log
NEEDED=needed.txt  # what pip is asked for where it chooses versions itself
# Of Python 3, the oldest minor version that pyproject.toml asks for.
OLDEST=$(sed -n 's/^requires-python = ">=3\.\([0-9]*\)"$/\1/p' "$here/pyproject.toml")
CANDIDATES="python3 /usr/bin/python3 python3.14 python3.13 python3.12 python3.$OLDEST"

check_machine() {
  [ "$home" = jazzy ] || [ "$machine" = 'Linux x86_64' ] ||
    fail "rclpy comes as wheels for Linux x86_64 only, and this is $machine:" \
      'install ROS 2 Jazzy, source it and start this again'
  [ "${venv#*:}" = "$venv" ] ||
    fail "'$venv' contains ':', which separates paths in PATH and its like:" \
      'name another folder with WASD_VENV=DIR'
}

# Prints why the Python "$1" will not do, or nothing.
fault() {
  "$1" -I -c "
import sys
if sys.version_info < (3, $OLDEST):
    print('is', '.'.join(map(str, sys.version_info[:2])))
else:
    try:
        import ensurepip, venv
    except ImportError:
        print('has no venv')
" 2>/dev/null || echo 'does not start'
}

# Sets `python`. Where ROS is sourced it has to be the one that ROS was built for.
find_python() {
  found=
  for python in ${WASD_PYTHON:+"$WASD_PYTHON"} $CANDIDATES; do
    if ! command -v "$python" >/dev/null; then
      why='is not there'
      [ "$python" = "${WASD_PYTHON-}" ] || [ "$python" = python3 ] || continue
    else
      why=$(fault "$python")
      if [ -z "$why" ] && [ "$home" = jazzy ] && ! "$python" -P -c 'import rclpy' 2>/dev/null; then
        why='cannot import rclpy'
      fi
    fi
    [ -n "$why" ] || return 0
    found="$found, $python $why"
    [ "$python" != "${WASD_PYTHON-}" ] || break  # asked for by name: no other will do
  done
  if [ "$home" = jazzy ]; then
    fail "ROS 2 Jazzy is sourced, but no Python >= 3.$OLDEST with venv can import its rclpy" \
      "(${found#, }): sudo apt install ros-jazzy-rclpy python3-venv"
  fi
  fail "needs Python >= 3.$OLDEST with venv, and found none (${found#, })." \
    'On Debian or Ubuntu: sudo apt install python3 python3-venv. Or name one: WASD_PYTHON=PATH'
}

# Takes the folder as ours, alone: a second start waits until the first is through or dead.
claim_folder() {
  mkdir -p "$venv" 2>/dev/null && [ -w "$venv" ] ||
    fail "cannot write to '$venv': name a folder that can be written, WASD_VENV=DIR $0"
  venv=$(CDPATH='' cd -P -- "$venv" && pwd -P)
  [ -z "$(ls -A "$venv")" ] || [ -e "$venv/$MARKER" ] ||
    fail "'$venv' was not made by this script: remove it, or name another with WASD_VENV=DIR"
  exec 9>>"$venv/$MARKER"
  # The lock belongs to the open file, so it ends with its holders, however they end.
  command -v flock >/dev/null || return 0
  flock -n 9 || { say "another start is installing into '$venv'; waiting for it" && flock 9; }
}

# Keeps what an earlier install made only if that was completed, here, with the same Python.
make_environment() {
  if [ -f "$venv/$STAMP" ] && [ "$(identity)" = "$(sed -n 1p "$venv/$STAMP")" ]; then
    say 'the project has changed; installing what is new'
    rm "$venv/$STAMP"
    return
  fi
  find "$venv" -mindepth 1 -maxdepth 1 ! -name "$MARKER" -exec rm -rf {} +
  size='1.5 GB'
  case $without in *pin*) size='0.9 GB' ;; esac  # a sourced ROS has what is large
  say "making '$venv' with $("$python" -I --version), once: one to three minutes, $size"
  inherit=
  # ROS' own Python packages (and those of Debian that they use) stay visible.
  [ "$home" = wheels ] || inherit=--system-site-packages
  "$python" -I -m venv $inherit "$venv" >&2 || fail "could not make '$venv' with $python"
  : >"$venv/COLCON_IGNORE"
}

# With "$1" `test` also what the tests need, which pip looks for at once.
install_project() {
  say "installing the project and what it needs; what pip does is in '$venv/$LOG'"
  rm -f "$venv/$LOG"
  install_needed "$1"
  # What its wheel would bring on top, interfaces that are built, is built here.
  run_pip --no-deps --no-build-isolation -e "$here"
  : >"$venv/$UNCOMPILED"
  { identity && contents; } >"$venv/$STAMP.new"
  mv "$venv/$STAMP.new" "$venv/$STAMP"
  [ "$1" != test ] || cat "$venv/$STAMP" >"$venv/$TESTS"
}

# Side by side, for each of them keeps one processor busy. Stopped in its midst it is done again by
# the next start, and what pip did stays.
compile_all() {
  say 'compiling the messages that the wheels lack, legs and navigator, once'
  "$venv/bin/python" -P -m quadruped_sim >&2 &
  legs=$! others=$!
  "$venv/bin/python" -P -m compileall -q -x '/tests?/' "$venv"/lib/python3* >>"$venv/$LOG" 2>&1 &
  libraries=$! others="$others $!"
  "$venv/bin/python" -P -m robot_description.build_interfaces >&2 || :  # it has said what is missing
  "$venv/bin/python" -P -m wasd_navigation >&2 || say 'not compiled; the first map starts later'
  wait "$legs" || say 'not compiled; the first walk starts later'
  wait "$libraries" || say "libraries not compiled, '$venv/$LOG' says why; each start takes longer"
  others=
  rm "$venv/$UNCOMPILED"
  say 'installed'
}

install_tests() {
  say 'installing what the tests need, once'
  rm -f "$venv/$LOG"
  install_needed test
  { identity && contents; } >"$venv/$TESTS"
}

# Installs what runs, and with "$1" `test` what the tests need, too: versions that were tried, each
# file by its hash. Beside a sourced ROS, and for a newer Python, pip chooses within the project's
# ranges.
install_needed() {
  if is_locked; then
    [ "$1" = test ] && set -- -r "$here/requirements/test.txt" || set --
    run_pip --require-hashes -r "$here/requirements/run.txt" "$@"
    return
  fi
  case $without in *pin*) numpy='import numpy; print("numpy==" + numpy.__version__)' ;; *) numpy= ;; esac
  [ "$1" = test ] || set --
  {
    "$venv/bin/python" -I "$here/requirements/lock.py" --ranges "$@" --without $without
    [ -z "$numpy" ] || "$venv/bin/python" -P -c "$numpy"
  } >"$venv/$NEEDED"
  run_pip -r "$venv/$NEEDED"
}

# Whether there are versions that were tried, for the Python of the environment.
is_locked() {
  [ "$home" = wheels ] || return 1
  version=$("$venv/bin/python" -I -c 'import sys; print("%d.%d" % sys.version_info[:2])')
  case $(sed -n 1p "$here/requirements/run.txt") in
    *" $version, "* | *" $version on "*) ;;
    *) return 1 ;;
  esac
}

# Has pip install. It says what goes wrong on standard error; what it turns on the other, with a
# log to write, is not meant for readers. Bytecode it would make by one processor, of tests, too.
run_pip() {
  show_progress 9>&- &
  progress=$!
  # A pip set up to install elsewhere (PIP_USER) would refuse an environment.
  PIP_USER=0 "$venv/bin/python" -P -m pip install --quiet --progress-bar off --disable-pip-version-check --no-input \
    --no-compile --log "$venv/$LOG" "$@" >/dev/null || explain_failure
  end_progress
}

# On a terminal: one line that says at which package pip is, until it is ended or we are.
show_progress() {
  [ -t 2 ] || return 0
  seconds=0
  while sleep 1 && kill -0 $$ 2>/dev/null; do
    seconds=$((seconds + 1))
    package=$(sed -n -e 's/.*Collecting \([A-Za-z0-9_.-]*\).*/\1/p' \
      -e 's/.*Installing collected packages.*/putting all in place/p' "$venv/$LOG" 2>/dev/null | tail -n 1)
    printf '\r\033[Kwasd: %d s, %s' "$seconds" "${package:-looking what is needed}" >&2
  done
}

end_progress() {
  [ -n "$progress" ] || return 0
  kill "$progress" 2>/dev/null || :
  wait "$progress" 2>/dev/null || :
  progress=
  [ ! -t 2 ] || printf '\r\033[K' >&2
}

# Names the package at which pip gave up; pip's own lines name it only in passing.
explain_failure() {
  end_progress
  package=$(sed -n 's/.*No matching distribution found for \([^ ]*\).*/\1/p' "$venv/$LOG" | tail -n 1)
  [ -n "$package" ] ||
    package=$(sed -n 's/.*Collecting \([^ ]*\).*/\1/p' "$venv/$LOG" | tail -n 1)
  fail "could not install ${package:-the project}: pip says why above (it needs a network this" \
    "once) and in '$venv/$LOG'; the next start tries again"
}

stop_installing() {
  end_progress
  kill $others 2>/dev/null || :  # in the background, where Ctrl-C is not heard
  wait
  [ -f "$venv/$STAMP" ] && how='goes on' || how='begins anew'
  say "interrupted; the next start $how"
  exit 130
}

install() {
  check_machine
  find_python
  progress='' others=''
  trap stop_installing INT
  claim_folder
  if ! is_installed; then
    make_environment
    install_project "$1"
  fi
  [ ! -e "$venv/$UNCOMPILED" ] || compile_all
  [ "$1" != test ] || can_test || install_tests
  trap - INT
  exec 9>&-
}
