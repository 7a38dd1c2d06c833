#!/bin/bash
# A Slurm job array that lights one scene for each task:
#
#   sbatch --array=1-$(wc -l < scenes.txt) slurm_array.sh scenes.txt OUT [OPTION...]
#
# scenes.txt names one .glb or .gltf a line; OUT, which all nodes must see, receives NAME-lit.glb, its lightmaps and
# NAME.json for each. OPTIONs go to `radiosity solve`. RADIOSITY names the program where it is not in PATH.
#
# Before its time is up, or when the job is preempted, the solve saves its state (exit code 75) and the task goes back
# into the queue; it goes on where it was. The other exit codes become the task's: 0 the asked error was reached, 3 the
# scene ended above it, with output; 1 and 2 are failures that another try would not mend.
#SBATCH --job-name=radiosity
#SBATCH --cpus-per-task=2
#SBATCH --signal=B:TERM@120
#SBATCH --requeue
#SBATCH --open-mode=append
set -uo pipefail

readonly RESUMABLE=75 # EX_TEMPFAIL of sysexits.h, as `radiosity solve` uses it

# The shell gets the signal and passes it on, also one that comes before there is a solve.
stopped='' solve=''
trap 'stopped=yes; [ -z "$solve" ] || kill -TERM "$solve" 2>/dev/null' TERM

if [ $# -lt 2 ] || [ -z "${SLURM_ARRAY_TASK_ID:-}" ]; then
  echo "usage: sbatch --array=1-\$(wc -l < SCENES) slurm_array.sh SCENES OUT [OPTION...]" >&2
  exit 2
fi
scenes=$1 out=$2
shift 2

scene=$(sed -n "${SLURM_ARRAY_TASK_ID}p" "$scenes")
if [ -z "$scene" ]; then
  echo "$scenes has no line $SLURM_ARRAY_TASK_ID" >&2
  exit 2
fi
name=$(basename "$scene")
name=${name%.*}
mkdir -p "$out/state" || exit 1

"${RADIOSITY:-radiosity}" solve "$scene" -o "$out/$name-lit.glb" --report "$out/$name.json" \
  ${SLURM_CPUS_PER_TASK:+--workers "$SLURM_CPUS_PER_TASK"} --state "$out/state/$name" "$@" &
solve=$!
[ -z "$stopped" ] || kill -TERM "$solve"
while kill -0 "$solve" 2>/dev/null; do wait "$solve"; done # the signal ends a wait, too
wait "$solve"
code=$?
# A solve that was not listening yet dies of the signal: another try is right.
[ "$stopped$code" != yes143 ] || code=$RESUMABLE

if [ "$code" = "$RESUMABLE" ]; then
  echo "task $SLURM_ARRAY_TASK_ID: state saved, back into the queue"
  # Slurm ends this script by another signal when it takes the job back.
  trap '' TERM
  scontrol requeue "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}" || exit "$RESUMABLE"
  sleep 60
fi
exit "$code"
