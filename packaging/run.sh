#!/usr/bin/env bash
# Sets freepath up from this folder, without a package index, and tries it on the OpenCL driver that
# is there. README.md, beside this file, says how; nothing is left but a folder of results.
set -u
export LC_ALL=C

kit=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
device=${1:-${FREEPATH_DEVICE:-}}
total=${FREEPATH_KIT_SECONDS:-345}
steps=${FREEPATH_KIT_STEPS:-}
results=$PWD/results-$(hostname)-$(date +%Y%m%d-%H%M%S)
work=$(mktemp -d "${TMPDIR:-/tmp}/freepath-kit-XXXXXX") || exit 2
trap 'rm -rf "$work"' EXIT
mkdir -p "$results" || exit 2
summary=$results/summary.txt
failed=0

say() { echo "$*" | tee -a "$summary"; }

# step NAME SECONDS COMMAND...: with its own log and limit; seconds are of 345, however many there are
step() {
  local name=$1 limit=$(($2 * total / 345)) left=$((total - SECONDS)) started=$SECONDS code
  shift 2
  case " ${steps:-$name} " in *" $name "*) ;; *) return 0 ;; esac
  if [ "$left" -lt 3 ]; then
    failed=1
    say "not run  $name: no time is left of $total s"
    return 1
  fi
  [ "$limit" -le "$left" ] || limit=$left
  timeout --kill-after=5 "$limit" "$@" >"$results/$name.log" 2>&1
  code=$?
  case $code in
    0) say "passed   $name ($((SECONDS - started)) s)" ;;
    124 | 137) say "TIMEOUT  $name: stopped after $limit s; its log: $name.log" ;;
    *) say "FAILED   $name: exit code $code; its log: $name.log: $(tail -n 1 "$results/$name.log")" ;;
  esac
  [ "$code" -eq 0 ] || failed=1
  return "$code"
}

# The first Python of the kit's version, else any that is new enough and may have the packages.
find_python() {
  local wanted name found=""
  wanted=$(cat "$kit/python-version")
  for name in ${FREEPATH_PYTHON:-"python$wanted" python3 python}; do
    "$name" -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null || continue
    found=${found:-$name}
    if [ "$("$name" -c 'import sys; print("%d.%d" % sys.version_info[:2])')" = "$wanted" ]; then
      found=$name
      break
    fi
  done
  [ -n "$found" ] || say "FAILED   python: none of version 3.10 or later; FREEPATH_PYTHON names one"
  python=$found
  [ -n "$found" ]
}

set_up() {
  local pip
  "$python" -m venv --without-pip --system-site-packages "$work/env" || return
  # of a virtual environment that is active, venv sees the Python alone
  "$python" -c 'import sys; print(*[p for p in sys.path if p.endswith("-packages")], sep="\n")' \
    >"$("$work/env/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/kit.pth"
  pip=("$work/env/bin/python" -m pip)
  [ -e "$(echo "$kit"/wheels/pip-*.whl)" ] &&
    pip=("$work/env/bin/python" "$(echo "$kit"/wheels/pip-*.whl)/pip")
  pip+=(--disable-pip-version-check --no-cache-dir install --no-index --find-links "$kit/wheels")
  "${pip[@]}" -r "$kit/requirements.txt" &&
    "${pip[@]}" --no-deps --ignore-installed "$kit"/wheels/freepath-*.whl &&
    "$work/env/bin/freepath" --version
}

# add_driver PART PATTERN FOLDER...: an .icd file for a library that none of them names yet
add_driver() {
  local part=$1 pattern=$2 folder library
  shift 2
  for library in $({ ldconfig -p || /sbin/ldconfig -p; } 2>/dev/null | sed -n "s/.*=> \(.*$part\.so.*\)/\1/p"); do
    grep -qs "$part" "$vendors"/*.icd || echo "$library" >"$vendors/$part.icd"
    return
  done
  for folder in "$@"; do
    for library in "$folder"/$pattern; do
      [ -e "$library" ] || continue
      grep -qs "$part" "$vendors"/*.icd || echo "$library" >"$vendors/$part.icd"
      # what it needs lies beside it
      export LD_LIBRARY_PATH=$folder${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
      return
    done
  done
}

find_drivers() {
  local system=${OCL_ICD_VENDORS:-/etc/OpenCL/vendors} own
  vendors=$work/vendors
  mkdir "$vendors"
  if [ -d "$system" ]; then cp "$system"/*.icd "$vendors" 2>/dev/null; fi
  if [ -f "$system" ]; then cp "$system" "$vendors"; fi
  IFS=: read -r -a own <<<"${LD_LIBRARY_PATH:-}"
  add_driver libnvidia-opencl 'libnvidia-opencl.so*' ${own[@]+"${own[@]}"} /usr/local/nvidia/lib64 \
    /usr/local/nvidia/lib /usr/lib/x86_64-linux-gnu /usr/lib64 /usr/lib/nvidia* /usr/lib64/nvidia \
    /usr/lib/wsl/lib /run/opengl-driver/lib /run/nvidia/driver/usr/lib* /.singularity.d/libs
  add_driver libamdocl64 'libamdocl64.so*' /opt/rocm*/lib /opt/rocm*/opencl/lib
  export OCL_ICD_VENDORS=$vendors
}

describe() {
  uname -a
  lscpu 2>/dev/null | grep -E 'Model name|^CPU\(s\)|Thread|MHz'
  nvidia-smi 2>/dev/null
  rocm-smi 2>/dev/null
  echo "Python: $python, $("$python" --version 2>&1)"
  (cd "$vendors" && grep -H . ./*.icd 2>/dev/null) || echo "no .icd file, and no driver's library"
}

# Neither may write into a home, which a node may not have.
export PIP_CONFIG_FILE=/dev/null FREEPATH_CACHE=$work/cache XDG_CACHE_HOME=$work/cache
export CUDA_CACHE_PATH=$work/cache/nv
mkdir "$work/cache"

all_steps() {
  local jobs group freepath=$work/env/bin/freepath chosen=()
  find_python || return
  find_drivers
  describe >"$results/machine.log" 2>&1
  export -f set_up
  export kit work python
  steps="${steps:+$steps set-up}" step set-up 90 bash -c set_up || return
  if [ -z "$device" ]; then
    # a GPU where there is one, else what freepath takes by itself
    device=$("$work/env/bin/python" - 2>>"$results/machine.log" <<'PYTHON'
from freepath.device.opencl import list_devices

found = [info for info in list_devices() if info.kind == "GPU"]
print(*[f"{info.platform} / {info.name} / {info.driver_version}" for info in found[:1]])
PYTHON
    )
  fi
  [ -z "$device" ] || chosen=(-d "$device")
  say "device:  ${device:-the first}"
  set -- ${chosen[@]+"${chosen[@]}"}
  jobs=$(nproc 2>/dev/null || echo 2)
  [ "$jobs" -le 8 ] || jobs=8
  step devices 15 "$freepath" devices
  step check-tiny 50 "$freepath" check -L tiny -j "$jobs" "$@" --output-junit "$results/check-tiny.xml"
  step run-quick 45 "$freepath" run quick "$@" -o "$results/run-quick"
  step run-lanes 40 "$freepath" run lanes -a lanes=1 "$@" -o "$results/run-lanes"
  for group in 32 64 128 256; do
    step "run-lanes-in-$group" 35 "$freepath" run lanes -a lanes=1 --work-group "$group" "$@" \
      -o "$results/run-lanes-in-$group"
  done
  # last, as it is the longest where kernels take long to build: it has what is left
  step check-identity 345 "$freepath" check -L fast -R identity -j "$jobs" "$@" \
    --output-junit "$results/check-identity.xml"
}

all_steps || failed=1
tar -czf "$results.tar.gz" -C "$(dirname "$results")" "$(basename "$results")"
echo
cat "$summary"
echo "results: $results and $results.tar.gz, after $SECONDS s"
[ "$failed" -eq 0 ] || exit 8
