#!/usr/bin/env bash
# Submits a render in shards as an array job, and the merge that waits for all of them. Folder and scene must be shared by all nodes.
#
#   SHARDS=8 SPP=1024 SCENE=scene.xml FOLDER=/shared/fog OUTPUT=/shared/fog.exr examples/farm/slurm-submit.sh
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
export VDF=${VDF:-vdf} SCENE=${SCENE:-cbox_vol2} SPP=${SPP:-64} SHARDS=${SHARDS:-8} OPTIONS=${OPTIONS:-} EVERY=${EVERY:-30s}
export FOLDER=${FOLDER:?where the shards go} OUTPUT=${OUTPUT:?the EXR}
mkdir -p "$FOLDER"
array=$(sbatch --parsable --array="0-$((SHARDS - 1))" --output="$FOLDER/%a.log" "$here/slurm-shard.sh")
# Not afterok: a task that failed once and was run again would count as failed. The merge itself says, with exit code 3, if something is missing.
merge=$(sbatch --parsable --dependency="afterany:$array" --output="$FOLDER/merge.log" \
    --wrap "'$VDF' merge '$FOLDER'/*.film -o '$OUTPUT' --reproducible")
echo "array $array, merge $merge"
