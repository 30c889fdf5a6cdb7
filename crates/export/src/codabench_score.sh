#!/bin/sh
# Scores a submission on Codabench: score.sh rounded|whole PROTOCOL [INPUT OUTPUT]
#
# In: the dataset with its truth and, of a hidden split, the floors of its numbers in INPUT/ref, the submission in INPUT/res,
# the board's columns in columns.txt, the command mateval. Out: OUTPUT/scores.json, a number for each column, and OUTPUT/detailed_results.html, a page that loads
# nothing. Of a hidden split (rounded) neither holds more than `eval score --rounded`, and nothing else is written.
set -eu
export LC_ALL=C
numbers=$1 protocol=$2 input=${3:-/app/input} output=${4:-/app/output}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Archives of a folder hold that folder.
submission=$input/res
for folder in "$input"/res/*/; do
    [ -e "$submission/submission.json" ] || [ ! -e "$folder/submission.json" ] || submission=$folder
done

if ! mateval eval lint "$submission" --dataset "$input/ref" > "$work/lint.txt"; then
    cat "$work/lint.txt" >&2
    echo "the submission was not scored: 'mateval eval lint' finds these errors in it" >&2
    exit 1
fi
set --
if [ "$numbers" = rounded ]; then
    set -- --rounded "$work/rounded.json"
    for floor in "$input"/ref/floor_*.json; do
        set -- "$@" --floor "$floor"
    done
fi
mateval eval score "$submission" --dataset "$input/ref" --protocol "$protocol" --out "$work/whole.json" "$@" > /dev/null

# Both files have a number a line; the means over all scenes follow the word.
case $numbers in
    rounded) file=rounded.json word=headline ;;
    whole) file=whole.json word=summary ;;
esac
while read -r key; do
    number=$(sed -n "/\"$word\": {/,\$s/^ *\"$key\": \([-+.0-9e]*\),\{0,1\}\$/\1/p" "$work/$file" | head -n 1)
    # Codabench keeps at most ten decimals, and its keys have no dots.
    [ -z "$number" ] || printf '"%s": %.6f\n' "$(echo "$key" | tr . _)" "$number"
done < "$(dirname "$0")/columns.txt" > "$work/scores"
[ -s "$work/scores" ] || { echo "the result holds none of the board's numbers" >&2; exit 1; }

as_html() { sed 's/&/\&amp;/g; s/</\&lt;/g'; }
# The means of the board's columns with their intervals over houses, which Codabench's table cannot show. They come from
# a board of this method alone.
intervals() {
    if ! mateval eval leaderboard "$work/whole.json" --protocol "$protocol" --out "$work/board" \
        > "$work/board.txt" 2>&1; then
        cat "$work/board.txt" >&2
        return 1
    fi
    # A method's name may hold commas, so fields count from the right.
    awk -F, 'BEGIN { print "\nMeans, and where the mean over all such houses lies in 95 % of cases (five houses or more)\n" }
        NR == FNR { is_column[$1] = 1; next }
        $(NF - 10) in is_column {
            interval = $(NF - 7) == "" ? "no interval" : sprintf("%.4f to %.4f", $(NF - 7), $(NF - 6))
            printf "%-32s %10.4f  %s, houses: %s\n", $(NF - 10), $(NF - 8), interval, $(NF - 2)
        }' "$(dirname "$0")/columns.txt" "$work/board/downloads/leaderboard.csv"
}
{
    echo '<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>MatEval</title>'
    echo '<style>body { font: 16px sans-serif; margin: 1em } pre { overflow: auto } img { max-width: 100% }</style>'
    echo '<h1>Scores</h1><pre>'
    if [ "$numbers" = whole ]; then
        mateval eval tables "$work/whole.json" --protocol "$protocol" --format text > "$work/tables.txt"
        as_html < "$work/tables.txt"
        intervals > "$work/intervals.txt"
        as_html < "$work/intervals.txt"
    else
        as_html < "$work/rounded.json"
    fi
    echo '</pre><h1>Findings about the submission</h1><pre>'
    as_html < "$work/lint.txt"
    echo '</pre>'
    # Of a captured room the true base colours are not known.
    if [ "$numbers" = whole ] && [ "$protocol" != capture-1 ]; then
        echo '<h1>Base colours: the truth, then the submission</h1>'
        echo '<p>A row is a view. In novel views, what the photo shows is darkened. Black is not scored.</p>'
        mateval eval pictures "$submission" --dataset "$input/ref" --out "$work/pictures" > /dev/null
        for picture in "$work"/pictures/*-albedo.png; do
            printf '<h2>%s</h2><img alt="" src="data:image/png;base64,' "$(basename "$picture" -albedo.png | as_html)"
            base64 -w 0 "$picture"
            echo '">'
        done
    fi
    echo '</html>'
} > "$output/detailed_results.html"
# Last, since a run without scores has failed.
{ echo '{'; sed '$!s/$/,/' "$work/scores"; echo '}'; } > "$output/scores.json"
