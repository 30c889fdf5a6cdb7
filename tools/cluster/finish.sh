#!/bin/sh
# finish.sh MATEVAL DATASET 'FOLDERS OF STATE FILES': finishes the dataset without the scenes of which a step failed.
set -eu
mateval=$1 dataset=$2 folders=$3
set --
failed=$(for folder in $folders; do grep -L '^good' "$folder"/* || true; done | sed 's|.*/||' | sort -u)
for scene in $failed; do
    set -- "$@" --without "$scene"
done
"$mateval" prep finish "$dataset" "$@"
