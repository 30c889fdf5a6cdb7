"""Compares the README's table with the results of a demo: `readme_table.py DEMO/results`."""

import json
import pathlib
import sys

README = pathlib.Path(__file__).parents[1] / "README.md"
DESCRIPTIONS = {
    "gt": "the truth baked to the atlases: the ceiling",
    "nn": "the truth of the photo alone, the rest by nearest neighbours",
    "grey": "0.5 everywhere: the floor",
}
KEYS = ["albedo.input.psnr", "albedo.novel.psnr"]


def row(method, values):
    cells = " | ".join(f"{value:.2f}" for value in values)
    return f"| {method} ({DESCRIPTIONS[method]}) | {cells} |"


def main(results):
    lines = README.read_text().splitlines()
    lacking = []
    for method in DESCRIPTIONS:
        summary = json.loads((results / f"{method}.json").read_text())["protocols"]["mateval-2"]["summary"]
        expected = row(method, [summary[key] for key in KEYS])
        if expected not in lines:
            lacking.append(expected)
        # The twin: values that differ by a hundredth are another row.
        if row(method, [summary[key] + 0.01 for key in KEYS]) in lines:
            sys.exit(f"the comparison accepts other values of {method}")
    if lacking:
        sys.exit("README.md lacks these rows of the demo:\n" + "\n".join(lacking))
    print("the README's table is what the demo prints")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
