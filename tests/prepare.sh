# Sourced by tests/run and sim/demo: makes this machine ready and builds. Bash.
#
#   prepare_packages [tests] [ci]   install what is missing with apt (as root, or through sudo)
#   prepare_guest_packages          the same for the virtual machine, without which everything else still works
#   prepare_cross_packages          the same for the vector kernels on AArch64
#   prepare_owner "$@"      when root runs a checkout that belongs to somebody else, go on as that somebody
#   prepare_guest           begin to fetch and unpack the virtual machine's kernel, beside what comes next
#   finish_guest            wait for it; where it cannot be had, say why, now and in each test that needs it
#   prepare_build TARGET…   configure and build into build/release

top=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build="$top/build/release"

build_packages=(
  cmake ninja-build g++ pkg-config
  libopencv-core-dev libopencv-imgproc-dev libopencv-imgcodecs-dev libeigen3-dev libflann-dev libhwy-dev
  libmodbus-dev libusb-1.0-0-dev libhdf5-dev libjpeg62-turbo-dev libpng-dev libboost-dev nlohmann-json3-dev
  libtomlplusplus-dev libcli11-dev libspdlog-dev libfmt-dev libsystemd-dev libembree-dev libtbb-dev
  libgtest-dev libgmock-dev libbenchmark-dev
)
# Independent peers that the tests talk to.
test_packages=(mbpoll python3-pymodbus python3-serial python3-serial-asyncio socat)
# The virtual machine with real kernel devices.
guest_packages=(qemu-system-x86 seabios ipxe-qemu busybox-static cpio kmod udev xz-utils binutils)
# The vector kernels on another processor: cross compiler and emulator.
cross_packages=(g++-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user-static)
# What .ci/run checks with.
ci_packages=(clang-format clang-tidy)

say() { printf '\n\033[1m== %s\033[0m\n' "$*"; }
fail() { printf '\n%s\n' "$*" >&2; exit 1; }

# Sets `missing` to those of the given packages that are not installed.
find_missing() {
  local package status
  missing=()
  for package in "$@"; do
    status=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
    [ "$status" = installed ] || missing+=("$package")
  done
}

# Installs packages. Returns 1 with the reason in `trouble` when that cannot be done.
install_packages() {
  local apt=(env DEBIAN_FRONTEND=noninteractive apt-get -o Dpkg::Use-Pty=0) log
  trouble=
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || { trouble="Missing packages: $*
Run this once as root, or install them by hand."; return 1; }
    apt=(sudo "${apt[@]}")
  fi
  say "Installing $# packages: $*"
  "${apt[@]}" -qq update || { trouble="apt-get update failed; is the network there, and /etc/apt/sources.list right?"; return 1; }
  log=$(mktemp)
  if ! "${apt[@]}" -qq install -y --no-install-recommends "$@" >"$log" 2>&1; then
    trouble="$(tail -n 20 "$log")
apt-get install failed (above)."
    rm -f "$log"
    return 1
  fi
  rm -f "$log"
}

prepare_packages() {
  local wanted=("${build_packages[@]}") missing trouble
  [[ " $* " = *" tests "* ]] && wanted+=("${test_packages[@]}")
  [[ " $* " = *" ci "* ]] && wanted+=("${ci_packages[@]}")
  command -v dpkg-query >/dev/null || fail "This script installs Debian packages and found no dpkg here. Install by hand: ${wanted[*]}"
  find_missing "${wanted[@]}"
  [ ${#missing[@]} -eq 0 ] || install_packages "${missing[@]}" || fail "$trouble"
}

prepare_cross_packages() {
  local missing trouble
  find_missing "${cross_packages[@]}"
  [ ${#missing[@]} -eq 0 ] || install_packages "${missing[@]}" ||
    printf '%s\n' "$trouble" "The vector kernels will not be tested on AArch64."
}

prepare_guest_packages() {
  local missing trouble
  find_missing "${guest_packages[@]}"
  if [ ${#missing[@]} -gt 0 ]; then
    install_packages "${missing[@]}" || printf '%s\n' "$trouble" "The virtual machine's tests will be skipped."
  elif [ "$(id -u)" -eq 0 ] && ! apt-cache show linux-image-amd64 >/dev/null 2>&1; then
    apt-get -qq update || true  # the kernel is fetched with apt, which needs its lists
  fi
}

guest_preparation=
prepare_guest() {
  mkdir -p "$top/build"
  "$top/tests/guest/prepare" "$top/build/guest" >"$top/build/guest.log" 2>&1 &
  guest_preparation=$!
}

finish_guest() {
  local code=0
  wait "$guest_preparation" || code=$?
  if [ "$code" -ne 0 ]; then
    EIGENPOSE_GUEST_MISSING=$(sed -n 's/^guest: skipped: //p' "$top/build/guest.log" | tail -1)
    export EIGENPOSE_GUEST_MISSING="${EIGENPOSE_GUEST_MISSING:-$(tail -1 "$top/build/guest.log")}"
    echo "No virtual machine: $EIGENPOSE_GUEST_MISSING"
  fi
  if [ "${EIGENPOSE_GUEST:-}" = 1 ]; then export EIGENPOSE_GUEST_REQUIRED=1; fi
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
