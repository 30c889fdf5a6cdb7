#!/bin/sh
# A rehearsal of a release at full size on a Slurm of two nodes, both on this machine: tools/test_cluster.sh [ROOMS] [FOLDER].
# One serial run and one on the cluster, in which a node and the controller are killed, must give the same manifest and
# results. A third of the rooms has a twin, another third is redressed, and results are verified and signed as a keeper of
# a board does. Needs root, Debian and two cores; changes /etc/slurm. 184 rooms (the default) take about an hour.
set -eu
cd "$(dirname "$0")/.."
rooms=${1:-184}
case $rooms in
    '' | *[!0-9]*)
        echo "usage: tools/test_cluster.sh [ROOMS] [FOLDER]; ROOMS is a number, not '$rooms'" >&2
        exit 2
        ;;
esac
work=${2:-$(mktemp -d)}
mkdir -p "$work"
work=$(realpath "$work")
root=$PWD
tools/apt_install.sh slurm-wlm munge python3-venv time
cargo build --release --package mateval --bin mateval
mateval="${CARGO_TARGET_DIR:-$root/target}/release/mateval"
export MATEVAL_CACHE="${MATEVAL_CACHE:-$HOME/.cache/mateval}"
"$mateval" fetch lpips

python3 -m venv "$work/snakemake"
"$work/snakemake/bin/pip" install --quiet snakemake==9.27.1 snakemake-executor-plugin-slurm==2.8.0

if [ -f /etc/slurm/slurm.conf ] && ! grep -q '^ClusterName=rehearsal' /etc/slurm/slurm.conf; then
    echo "this machine has a Slurm of its own, which the rehearsal would replace" >&2
    exit 2
fi
# Two nodes of one core each.
mkdir -p /etc/slurm "$work/slurm"
cat > /etc/slurm/slurm.conf <<CONF
ClusterName=rehearsal
SlurmctldHost=$(hostname -s)
SlurmUser=root
AuthType=auth/munge
ProctrackType=proctrack/pgid
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
MinJobAge=3600
SlurmdTimeout=10
MessageTimeout=30
KillWait=2
StateSaveLocation=$work/slurm/state
SlurmdSpoolDir=$work/slurm/spool.%n
SlurmctldPidFile=$work/slurm/slurmctld.pid
SlurmdPidFile=$work/slurm/slurmd.%n.pid
SlurmctldLogFile=$work/slurm/slurmctld.log
SlurmdLogFile=$work/slurm/slurmd.%n.log
NodeName=n[1-2] NodeHostname=$(hostname -s) NodeAddr=127.0.0.1 Port=[17001-17002] CPUs=1 RealMemory=2000
PartitionName=batch Nodes=n[1-2] Default=YES MaxTime=INFINITE State=UP
CONF
mkdir -p "$work/slurm/state" "$work/slurm/spool.n1" "$work/slurm/spool.n2" /run/munge
[ -f /etc/munge/munge.key ] || mungekey --create
chown -R munge: /run/munge /etc/munge /var/log/munge
pgrep munged > /dev/null || runuser -u munge -- munged

controller() { slurmctld -f /etc/slurm/slurm.conf; }
node() { slurmd -f /etc/slurm/slurm.conf -N "$1"; }
stop_slurm() {
    pkill -9 slurmctld || true
    pkill -9 slurmd || true
    pkill -9 slurmstepd || true
}
operator=
trap '[ -z "$operator" ] || kill "$operator" 2> /dev/null || true; stop_slurm' EXIT
stop_slurm
controller
node n1
node n2
sleep 5
sinfo

"$mateval" sample "$work/source" --houses "$rooms" --force
sed -i 's/^resolution = .*/resolution = [32, 24]\natlas_size = 64\nsamples = 1/' "$work/source/recipe.toml"
mkdir -p "$work/secret"
[ -f "$work/secret/rooms" ] || head -c 32 /dev/urandom > "$work/secret/rooms"
awk '{ print }
    /^id = / { scene++ }
    /^id = / && scene % 3 == 1 { print "twins = [\"warm_cool\"]" }
    /^id = / && scene % 3 == 2 { print "redress = { key = \"../secret/rooms\" }" }
    ' "$work/source/recipe.toml" > "$work/recipe.toml"
mv "$work/recipe.toml" "$work/source/recipe.toml"

# One process after another.
serial() {
    "$mateval" prep build "$work/source/recipe.toml" --out dataset
    "$mateval" prep render dataset
    mkdir -p results
    for method in gt grey nn; do
        "$mateval" baseline "$method" --dataset dataset --out "submissions/$method"
        "$mateval" eval score "submissions/$method" --dataset dataset --out "results/$method.json"
    done
}
mkdir -p "$work/serial" "$work/cluster"
cd "$work/serial"
[ -f results/nn.json ] || { started=$(date +%s); serial > serial.log 2>&1; echo $(($(date +%s) - started)) > seconds; }
echo "serial: $(cat seconds) s for $rooms rooms"

cd "$work/cluster"
cost='{build: {threads: 1, mem_mb: 900}, render: {threads: 1, mem_mb: 900}, scorer: {threads: 1, mem_mb: 900}, score: {threads: 1, mem_mb: 900}, whole: {mem_mb: 900}}'
cat > config.yaml <<CONF
recipe: $work/source/recipe.toml
renderer: builtin
publish: --with-ground-truth
mateval: $mateval
cost: $cost
CONF
snakefile=Snakefile
run_snakemake() {
    "$work/snakemake/bin/snakemake" --snakefile "$root/tools/cluster/$snakefile" --profile "$root/tools/cluster/profiles/slurm" \
        --configfile config.yaml --jobs 8 --default-resources slurm_partition=batch --slurm-no-account \
        --slurm-status-command squeue --slurm-init-seconds-before-status-checks 2 --seconds-between-status-checks 2 \
        --latency-wait 10 --max-jobs-per-timespan 100/1s "$@" >> snakemake.log 2>&1
}
done_of() { find "state/$1" -type f 2> /dev/null | wc -l; }

# A node dies while scenes are built, and the controller while references are made.
disturb() {
    while [ "$(done_of build)" -lt $((rooms / 3)) ]; do sleep 0.5; done
    kill -9 "$(cat "$work/slurm/slurmd.n2.pid")"
    # What runs there dies with it.
    for step in $(pgrep slurmstepd); do
        grep -q "n2" "/proc/$step/cmdline" "/proc/$step/environ" 2> /dev/null && pkill -9 -P "$step" && kill -9 "$step"
    done
    echo "node n2 was killed with $(done_of build) scenes built"
    sleep 15
    node n2
    while [ "$(done_of scorer)" -lt $((rooms / 3)) ]; do sleep 0.5; done
    kill -9 "$(cat "$work/slurm/slurmctld.pid")"
    echo "the controller was killed with references of $(done_of scorer) scenes made"
    sleep 10
    controller
    sleep 5
    # Snakemake would wait for ever for jobs that the controller had accepted and not saved.
    pkill -INT -f "$work/snakemake/bin/snakemake"
}
# What an operator does after a controller was lost: it saves its state every few seconds, so that it may give the number of
# a job again, for which the nodes are drained and jobs are held.
operate() {
    while sleep 10; do
        sinfo --noheader --format=%T 2> /dev/null | grep -q drain && { scontrol update NodeName='n[1-2]' State=RESUME || true; }
        for job in $(squeue --noheader --format='%i %r' 2> /dev/null | awk '/held/ {print $1}'); do
            # It may have been started meanwhile.
            scontrol release "$job" || true
        done
    done
}
operate &
operator=$!
started=$(date +%s)
disturb &
disturber=$!
run_snakemake || { echo "Snakemake ended with an error and is started again"; run_snakemake --unlock || true; run_snakemake; }
seconds=$(($(date +%s) - started))
wait "$disturber"
# A second run finds nothing to do.
run_snakemake
tail -n 3 snakemake.log

jobs=$(grep -c "has been submitted with SLURM jobid" snakemake.log || true)
echo "cluster: $seconds s for $rooms rooms, $jobs jobs, $(grep -c "Trying to restart job" snakemake.log || true) started again"
cmp "$work/serial/dataset/MANIFEST.sha256" dataset/MANIFEST.sha256
cmp "$work/serial/dataset/dataset.json" dataset/dataset.json
for method in gt grey nn; do
    cmp "$work/serial/results/$method.json" "results/$method.json"
done
grep -q "No scene failed" report.md
cat report.md

for kind in '"twins"' '"redressed"'; do
    count=$(grep -l "$kind" dataset/dataset.json dataset/scenes/*/scene.json | wc -l)
    [ "$count" -gt 0 ] || { echo "no scene has $kind"; exit 1; }
done
"$mateval" key new "$work/secret/keeper" --force
for method in gt nn; do
    "$mateval" eval verify "results/$method.json" --submission "submissions/$method" --dataset dataset \
        --out "results/$method.verified.json" --sign "$work/secret/keeper" --force
done
"$mateval" eval leaderboard results/nn.json --ceiling results/gt.json --trust "$work/secret/keeper.pub" --out board --force
grep -q '"verified": *"confirmed"' board/downloads/leaderboard.json
echo "The manifest and the results equal those of the serial run."

# A survey of other houses, serial and in jobs of five houses.
houses="$work/houses/house"
"$mateval" sample "$work/houses" --houses $(((rooms + 3) / 4)) --force
mkdir -p "$work/survey" "$work/survey/serial"
cd "$work/survey"
cat > config.yaml <<CONF
{source: $houses, houses: 3D-FRONT, models: 3D-FUTURE-model, textures: 3D-FRONT-texture, batch: 5, mateval: $mateval,
 cost: {search: {threads: 1, mem_mb: 900}, survey: {threads: 1, mem_mb: 900}}}
CONF
"$mateval" prep survey 3D-FRONT --source "$houses" --models 3D-FUTURE-model --textures 3D-FRONT-texture \
    --out serial/survey --force
snakefile=survey.smk
run_snakemake
for file in survey.json recipe.toml; do
    cmp "serial/survey/$file" "survey/$file"
done
echo "The survey equals that of a serial run: $(cat state/surveyed)"
