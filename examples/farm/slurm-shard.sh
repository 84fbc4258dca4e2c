#!/usr/bin/env bash
# One task of an array job: shard $SLURM_ARRAY_TASK_ID of $SHARDS.
#
#SBATCH --job-name=vdf
#SBATCH --requeue
#SBATCH --open-mode=append
#
# Slurm sends SIGTERM before it kills, and the checkpoint is written then; after a requeue the same command goes on from it. A task that was killed ends with the
# code 137, which a cluster with RequeueExit=137 runs again.
set -euo pipefail
shard="$FOLDER/$SLURM_ARRAY_TASK_ID"
# shellcheck disable=SC2086
"$VDF" render "$SCENE" --spp "$SPP" ${OPTIONS:-} --shard "$SLURM_ARRAY_TASK_ID/$SHARDS" -o "$shard.film" \
    --skip-existing --checkpoint "$shard.checkpoint" --resume --every "${EVERY:-30s}" --threads "${SLURM_CPUS_PER_TASK:-1}" &
render=$!
trap 'kill -TERM "$render" 2>/dev/null' TERM
code=0
wait "$render" || code=$?
# A signal ends the first wait, not the render.
while kill -0 "$render" 2>/dev/null; do code=0; wait "$render" || code=$?; done
exit "$code"
