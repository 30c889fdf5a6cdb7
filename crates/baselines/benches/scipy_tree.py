"""The search for nearest points of `baseline nn` by scipy: `scipy_tree.py FOLDER`, with files of 64-bit floats, three a place.

In: `points`, `queries`, and `distances`: what the other found, three times each. Prints seconds for the tree and for all
queries, on all processors, and how far apart the distances are at most.
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
    """Times scipy once."""
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
