"""Repeats the nearest-point search of `baseline nn` with scipy: `scipy_tree.py FOLDER`.

The folder holds `points`, `queries` and `distances`, files of 64-bit floats with three per place. `distances` are those
that the other program found, each three times. Prints the seconds for building the tree and for all queries, on all
processors, and the largest difference between the distances.
"""

import sys
import time
from pathlib import Path

import numpy
from scipy.spatial import cKDTree


def places(*, folder: Path, name: str) -> numpy.ndarray:
    """One of the files as an array of shape (count, 3)."""
    return numpy.fromfile(folder / name, dtype="<f8").reshape(-1, 3)


def main() -> None:
    """Builds the tree and runs all queries once, and prints the times."""
    folder = Path(sys.argv[1])
    points, queries = places(folder=folder, name="points"), places(folder=folder, name="queries")
    begun = time.perf_counter()
    tree = cKDTree(points)
    built = time.perf_counter()
    distances, _ = tree.query(queries, workers=-1)
    done = time.perf_counter()
    apart = numpy.abs(distances - places(folder=folder, name="distances")[:, 0]).max()
    print(f"  scipy: {built - begun:.3f} s for the tree, {done - built:.3f} s for all texels; distances within {apart:.1e} m")


if __name__ == "__main__":
    main()
