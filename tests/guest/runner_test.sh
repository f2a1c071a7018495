#!/bin/bash
# The guest runner hands back exit code, output and files; sees the host's files without writing to them; and skips,
# saying what to install, where there is no QEMU.
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
cache=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
fail() { echo "FAILED: $*" >&2; exit 1; }

echo "from the host" >"$folder/file"
"$here/run" --cache "$cache" --timeout 120 --module 'vivid n_devs=1 node_types=0x1' --env 'WORD=two words' \
  --keep "$folder/kept" -- bash -c '
    cat "$1"; echo changed >"$1"; echo "$WORD"; echo complaint >&2; echo left >/run/exchange/note
    ls /dev/video0; exit 7' bash "$folder/file" >"$folder/out" 2>"$folder/err"
code=$?
if [ $code = 77 ]; then
  cat "$folder/err" >&2
  exit 77
fi
[ $code = 7 ] || { cat "$folder/err" >&2; fail "exit code $code, not 7"; }
[ "$(cat "$folder/out")" = "from the host
two words
/dev/video0" ] || fail "output: $(cat "$folder/out")"
grep -q '^complaint$' "$folder/err" || fail "stderr: $(cat "$folder/err")"
[ "$(cat "$folder/kept/note")" = left ] || fail "the exchange folder did not come back"
[ "$(cat "$folder/file")" = "from the host" ] || fail "the guest wrote to the host's files"

mkdir "$folder/bin"
for program in bash sed cat dirname head sha256sum cut mktemp; do ln -s "$(command -v $program)" "$folder/bin/"; done
PATH=$folder/bin EIGENPOSE_GUEST_REQUIRED=0 "$here/run" --cache "$cache" -- true 2>"$folder/err"
[ $? = 77 ] || fail "without QEMU the exit code is not 77"
grep -q 'apt-get install' "$folder/err" || fail "without QEMU it does not say what to install: $(cat "$folder/err")"
PATH=$folder/bin EIGENPOSE_GUEST_REQUIRED=1 "$here/run" --cache "$cache" -- true 2>/dev/null
[ $? = 1 ] || fail "where a guest is required, a missing QEMU is not a failure"
echo "ok"
