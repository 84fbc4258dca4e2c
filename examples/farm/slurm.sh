#!/usr/bin/env bash
# Starts a Slurm cluster of this one machine, renders in eight shards, kills one task so that it is requeued, and compares the result with the whole render.
#
# As root, on Debian:
#   apt-get install slurm-wlm munge
#   cargo build --release && examples/farm/slurm.sh target/release/vdf
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
vdf=$(realpath "${1:-target/release/vdf}")
work=$(mktemp -d /tmp/vdf-slurm.XXXXXX)
chmod 755 "$work"
host=$(hostname -s)
pids=()
stop() {
    for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
    wait
    rm -rf "$work"
}
trap stop EXIT

# munge: who is who.
mkdir -p "$work/munge"
dd if=/dev/urandom of="$work/munge/key" bs=1024 count=1 status=none
chmod 700 "$work/munge"
chmod 400 "$work/munge/key"
mkdir -p /run/munge
munged --foreground --force --key-file="$work/munge/key" --socket=/run/munge/munge.socket.2 --pid-file="$work/munge/pid" \
    --log-file="$work/munge/log" --seed-file="$work/munge/seed" >"$work/munged.log" 2>&1 &
pids+=($!)

mkdir -p "$work/state" "$work/spool"
cat >"$work/slurm.conf" <<CONF
ClusterName=one
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=/run/munge/munge.socket.2,cred_expire=5
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldPort=16817
SlurmdPort=16818
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
ReturnToService=2
JobRequeue=1
RequeueExit=137
SchedulerParameters=sched_interval=2,batch_sched_delay=0
# A requeued task would wait for as long as a credential is good, two minutes by default: cred_expire above.
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$work/slurm.conf
sleep 1
slurmctld -D -i >"$work/slurmctld.log" 2>&1 &
pids+=($!)
sleep 1
slurmd -D >"$work/slurmd.log" 2>&1 &
pids+=($!)
for _ in $(seq 60); do
    [ "$(sinfo -h -o %T 2>/dev/null)" = idle ] && break
    sleep 0.5
done
sinfo

export VDF=$vdf SCENE=cbox_vol2 SPP=256 SHARDS=8 OPTIONS="-D width=96 -D height=72" EVERY=200ms
export FOLDER=$work/shards OUTPUT=$work/merged.exr
# shellcheck disable=SC2086
"$vdf" render --spp $SPP $OPTIONS -q -o "$work/whole.exr" --reproducible
"$here/slurm-submit.sh"

# The first task with a checkpoint is killed, as a machine that loses power would end it. Its exit code, 137, is one that is run again.
killed=
for _ in $(seq 1200); do
    if [ -z "$killed" ]; then
        for checkpoint in "$FOLDER"/*.checkpoint; do
            [ -e "$checkpoint" ] || continue
            number=$(basename "$checkpoint" .checkpoint)
            pid=$(pgrep -f -- "--checkpoint $checkpoint" | head -n 1) || continue
            [ -e "$FOLDER/$number.film" ] || { kill -9 "$pid" && killed=$number && echo "killed shard $number"; }
            break
        done
    fi
    [ -e "$OUTPUT" ] && break
    sleep 0.1
done
squeue
cat "$FOLDER"/*.log
[ -n "$killed" ] || { echo "no task was killed"; exit 1; }
cmp "$work/whole.exr" "$OUTPUT"
cmp "$work/whole.png" "${OUTPUT%.exr}.png"
echo "the merged EXR and PNG are those of the whole render, byte for byte"
