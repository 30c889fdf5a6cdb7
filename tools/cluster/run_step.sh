#!/bin/sh
# Runs a step of one scene: run_step.sh STATE_FILE LOG 'STATE_FILES OF EARLIER STEPS' -- COMMAND...
# STATE_FILE gets `good`, `failed (exit N), see LOG`, or `passed over: ...` where an earlier step failed. The exit code is 0
# unless the command was ended by a signal, or another process holds the scene for long: such a step is run again.
set -u
state=$1 log=$2 earlier=$3
shift 4
mkdir -p "$(dirname "$state")" "$(dirname "$log")"
for file in $earlier; do
    if [ "$(head -c 4 "$file")" != good ]; then
        echo "passed over: $file says '$(head -n 1 "$file")'" > "$state"
        exit 0
    fi
done
# Another process may hold the scene; the lease of a lost node is broken after ten minutes.
tries=0
while :; do
    "$@" > "$log" 2>&1
    code=$?
    [ "$code" -ne 0 ] && [ "$tries" -lt 12 ] && grep -q "is at work on" "$log" || break
    tries=$((tries + 1))
    sleep 60
done
if [ "$code" -eq 0 ]; then
    echo good > "$state"
elif [ "$code" -gt 128 ] || grep -q "is at work on" "$log"; then
    exit "$code"
else
    echo "failed (exit $code), see $log" > "$state"
fi
