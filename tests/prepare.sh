# Sourced by tests/run and sim/demo: makes this machine ready and builds. Bash.
#
#   prepare_packages [tests] [guest] [ci]   install what is missing with apt (as root, or through sudo)
#   prepare_owner "$@"      when root runs a checkout that belongs to somebody else, go on as that somebody
#   prepare_build TARGET…   configure and build into build/release

top=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build="$top/build/release"

build_packages=(
  cmake ninja-build g++ pkg-config
  libopencv-core-dev libopencv-imgproc-dev libopencv-imgcodecs-dev libeigen3-dev libflann-dev
  libmodbus-dev libusb-1.0-0-dev libhdf5-dev libsqlite3-dev libjpeg62-turbo-dev libboost-dev nlohmann-json3-dev
  libtomlplusplus-dev libcli11-dev libspdlog-dev libfmt-dev libsystemd-dev libembree-dev
  libgtest-dev libgmock-dev libbenchmark-dev
)
# Independent peers that the tests talk to.
test_packages=(mbpoll python3-pymodbus python3-serial python3-serial-asyncio socat)
# The virtual machine with real kernel devices.
guest_packages=(qemu-system-x86 seabios ipxe-qemu busybox-static cpio kmod udev xz-utils binutils)
# What .ci/run checks with.
ci_packages=(clang-format clang-tidy)

say() { printf '\n\033[1m== %s\033[0m\n' "$*"; }
fail() { printf '\n%s\n' "$*" >&2; exit 1; }

prepare_packages() {
  local wanted=("${build_packages[@]}") missing=() package status
  [[ " $* " = *" tests "* ]] && wanted+=("${test_packages[@]}")
  [[ " $* " = *" guest "* ]] && wanted+=("${guest_packages[@]}")
  [[ " $* " = *" ci "* ]] && wanted+=("${ci_packages[@]}")
  command -v dpkg-query >/dev/null || fail "This script installs Debian packages and found no dpkg here. Install by hand: ${wanted[*]}"
  for package in "${wanted[@]}"; do
    status=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
    [ "$status" = installed ] || missing+=("$package")
  done
  [ ${#missing[@]} -eq 0 ] && return
  local apt=(env DEBIAN_FRONTEND=noninteractive apt-get -o Dpkg::Use-Pty=0)
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || fail "Missing packages: ${missing[*]}
Run this once as root, or install them by hand."
    apt=(sudo "${apt[@]}")
  fi
  say "Installing ${#missing[@]} packages: ${missing[*]}"
  "${apt[@]}" -qq update || fail "apt-get update failed; is the network there, and /etc/apt/sources.list right?"
  "${apt[@]}" -qq install -y --no-install-recommends "${missing[@]}" >"${TMPDIR:-/tmp}/eigenpose-apt.$$.log" 2>&1 ||
    { tail -n 20 "${TMPDIR:-/tmp}/eigenpose-apt.$$.log" >&2; fail "apt-get install failed (log above)."; }
  rm -f "${TMPDIR:-/tmp}/eigenpose-apt.$$.log"
}

prepare_owner() {
  local owner
  owner=$(stat -c %U "$top")
  if [ "$(id -u)" -eq 0 ] && [ "$owner" != root ] && [ "$owner" != UNKNOWN ] && command -v runuser >/dev/null; then
    exec runuser -u "$owner" -- "$0" "$@"
  fi
}

prepare_build() {
  say "Building (the first time takes some minutes)"
  mkdir -p "$top/build"
  (cd "$top" && cmake --preset release >"$top/build/configure.log" 2>&1) ||
    { cat "$top/build/configure.log" >&2; fail "Configuring failed (above)."; }
  NINJA_STATUS='[%f/%t %es] ' cmake --build "$build" --target "$@" || fail "The build failed (above)."
}
