#!/bin/sh
# report.sh STATE: prints what every step did, and each scene that a step failed on, with the log that says why.
set -eu
echo "# Steps of the release"
echo
echo "| Step | Good | Failed | Passed over |"
echo "|---|---|---|---|"
for folder in "$1"/build "$1"/render "$1"/scorer "$1"/compare "$1"/score/*; do
    [ -d "$folder" ] || continue
    count() { grep -l "^$1" "$folder"/* | wc -l; }
    echo "| ${folder#"$1"/} | $(count good) | $(count failed) | $(count 'passed over') |"
done
echo
failures=$(grep -r '^failed' "$1" || true)
if [ -z "$failures" ]; then
    echo "No scene failed."
else
    echo "$failures" | sort | sed 's|^\([^:]*\):\(.*\)$|- `\1`: \2|'
fi
