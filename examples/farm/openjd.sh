#!/usr/bin/env bash
# Renders in eight shards by Open Job Description on this machine, kills one task and runs it again, and compares the result with the whole render.
#
#   pip install openjd-cli
#   cargo build --release && examples/farm/openjd.sh target/release/vdf [SPP]
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
vdf=$(realpath "${1:-target/release/vdf}")
spp=${2:-512}
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
mkdir "$work/shards"
size="-D width=96 -D height=72"
parameters=(-p "Vdf=$vdf" -p Spp="$spp" -p Every=100ms -p "Options=$size" -p "Folder=$work/shards" -p "Output=$work/merged.exr")

# shellcheck disable=SC2086
"$vdf" render --spp "$spp" $size -q -o "$work/whole.exr" --reproducible

# One task is killed like a machine that loses power, as soon as it has a checkpoint.
setsid openjd run "$here/openjd.yaml" "${parameters[@]}" --step Render -tp Shard=3 >"$work/killed.log" 2>&1 &
job=$!
until [ -e "$work/shards/3.checkpoint" ]; do
    kill -0 "$job" 2>/dev/null || { cat "$work/killed.log"; exit 1; }
    sleep 0.02
done
pkill -9 -f -- "--checkpoint $work/shards/3.checkpoint"
wait "$job" || true
if [ -e "$work/shards/3.film" ]; then
    echo "shard 3 was done before it was killed"
    exit 1
fi
echo "shard 3 was killed"

openjd run "$here/openjd.yaml" "${parameters[@]}" --step Merge --run-dependencies
cmp "$work/whole.exr" "$work/merged.exr"
cmp "$work/whole.png" "$work/merged.png"
echo "the merged EXR and PNG are those of the whole render, byte for byte"
