"""Compares the README's table with the results of a demo: `readme_table.py DEMO/results`."""

import json
import pathlib
import sys

README = pathlib.Path(__file__).parents[1] / "README.md"
# The results' files in the order of the printed table, and the method's name there.
METHODS = {"nn": "nn-gt", "grey": "grey", "gt": "gt (ceiling)"}
KEYS = ["albedo.input.psnr", "albedo.novel.psnr"]


def row(method, values):
    """Returns the method's row without its last column, which describes the method."""
    return " | ".join([f"| {method}", *(f"{value:.2f}" for value in values)])


def main(results):
    shown = [line.rpartition(" | ")[0] for line in README.read_text().splitlines()]
    expected, others = [], []
    for file, method in METHODS.items():
        summary = json.loads((results / f"{file}.json").read_text())["protocols"]["mateval-3"]["summary"]
        expected.append(row(method, [summary[key] for key in KEYS]))
        # The twin: values that differ by a hundredth are another row.
        others.append(row(method, [summary[key] + 0.01 for key in KEYS]))

    tables = [shown[at : at + len(METHODS)] for at in range(len(shown))]
    if others in tables:
        sys.exit("the comparison accepts other values")
    if expected not in tables:
        sys.exit("README.md lacks these rows of the demo, in this order:\n" + "\n".join(expected))
    print("the README's table is what the demo prints")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
