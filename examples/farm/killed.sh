#!/usr/bin/env bash
# Renders for some time, then the same samples again with `kill -9` at random moments, and compares the two, byte for byte.
#
#   cargo build --release && examples/farm/killed.sh target/release/vdf [SECONDS] [KILLS]
#
# SECONDS, by default 600, is how long the render takes that nobody disturbs; KILLS is 10 by default. Each life has another method and number of threads.
set -euo pipefail
vdf=$(realpath "${1:-target/release/vdf}")
seconds=${2:-600}
kills=${3:-10}
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
cd "$work"
render=(render cbox_vol2 -D width=160 -D height=120 --reproducible -q)

"$vdf" "${render[@]}" --time-limit "${seconds}s" -o whole.exr --stats whole.json
spp=$(sed -n 's/^ *"spp": *\([0-9]*\),*$/\1/p' whole.json)
echo "$spp samples per pixel in $seconds s"

resume=("${render[@]}" --spp "$spp" -o killed.exr --checkpoint killed.film --every 250ms --resume)
methods=(lb none amr-sn)
for ((kill = 1; kill <= kills; kill++)); do
    "$vdf" "${resume[@]}" --method "${methods[kill % 3]}" -j $((kill % 2 + 1)) &
    life=$!
    # At most nine tenths of all, in all.
    after=$(awk -v most="$seconds" -v kills="$kills" -v random="$RANDOM" 'BEGIN { print 0.9 * most / kills * random / 32768 }')
    sleep "$after"
    kill -9 "$life" || { echo "the render was done before kill $kill"; exit 1; }
    wait "$life" 2>/dev/null || true
    [ ! -e killed.exr ] || { echo "there is a picture after kill $kill"; exit 1; }
    echo "killed after $after s; the checkpoint has $(stat -c %s killed.film 2>/dev/null || echo no) bytes, $(find . -name '.vdf-*' | wc -l) files were being written"
    rm -f .vdf-*
done
"$vdf" "${resume[@]}"
cmp whole.exr killed.exr
cmp whole.png killed.png
echo "the EXR and PNG of $kills kills are those of the whole render, byte for byte"
