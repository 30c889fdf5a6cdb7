#!/usr/bin/env python3
"""Compares the procedural baseline with others on rooms whose textures are drawn at random.

The rooms are the sample's, with new textures for floor, wallpaper, sofa and furniture: built-in graphs of random
colours and sizes, which repeat as the sample's own do. All baselines start from the same estimate. Prints a line for
each room and how often `procedural` is better than `median-part`, and `procedural --keep-seen` better than `nn`; then
what parts cost that are split and merged at random, as a network's may be.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import struct
import subprocess
from pathlib import Path

# For each texture of the sample the side of its square in metres, and graphs with the parameters that are set: a whole
# number n stands for the side over n.
TEXTURES = {
    "planks": (
        1.2,
        [
            ("tile", {"size_u": (3, 8), "size_v": (3, 8)}),
            ("checks", {"size_u": (2, 6, 2), "size_v": (2, 6, 2)}),
            ("plank", {"width": (6, 14), "length": (1, 2)}),
            ("brick", {"size_u": (3, 6), "size_v": (6, 16, 2)}),
            ("mosaic", {"size": (24, 48)}),
            ("terrazzo", {}),
            ("carpet", {}),
        ],
    ),
    "wallpaper": (
        0.5,
        [
            ("stripes", {"period": (2, 6)}),
            ("dots", {"pitch_u": (3, 8), "pitch_v": (3, 8)}),
            ("trellis", {"pitch_u": (2, 4), "pitch_v": (2, 4)}),
            ("plaid", {"period_u": (2, 4), "period_v": (2, 4)}),
            ("plaster", {}),
            ("brick", {"size_u": (2, 3), "size_v": (4, 8, 2)}),
        ],
    ),
    "fabric": (
        0.3,
        [
            ("stripes", {"period": (3, 8)}),
            ("plaid", {"period_u": (2, 4), "period_v": (2, 4)}),
            ("checks", {"size_u": (4, 8, 2), "size_v": (4, 8, 2)}),
            ("leather", {}),
            ("carpet", {}),
        ],
    ),
    "wood": (0.8, [("veneer", {}), ("plank", {"width": (6, 12), "length": (1, 1)}), ("marble", {}), ("paint", {})]),
}

# The words of `mateval baseline` for each submission.
METHODS = {
    "median-part": ["median", "--parts"],
    "nn": ["nn"],
    "procedural": ["procedural"],
    "keep-seen": ["procedural", "--keep-seen"],
    "spoiled-parts": ["procedural", "--part-set", "spoiled"],
}


def main() -> None:
    """Makes rooms, submissions and scores below a folder, and prints the comparison."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder for everything; must not exist yet")
    parser.add_argument("--mateval", default="target/release/mateval", help="the command")
    parser.add_argument("--rooms", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--estimate", choices=["gt", "delight"], default="gt", help="what all baselines start from")
    parser.add_argument("--resolution", type=int, nargs=2, default=[240, 180], metavar=("WIDTH", "HEIGHT"))
    args = parser.parse_args()
    args.out.mkdir(parents=True)
    mateval = Command(program=args.mateval)
    rooms = write_rooms(mateval=mateval, out=args.out, rooms=args.rooms, seed=args.seed, size=args.resolution)
    dataset = args.out / "dataset"
    build = ["prep", "build", args.out / "recipe.toml", "--source", args.out / "source", "--out"]
    mateval.run(*build, args.out / "without-labels")
    spoil_parts(out=args.out, rooms=rooms, seed=args.seed)
    mateval.run(*build, dataset)
    estimate = ["--estimate", "gt"]
    if args.estimate == "delight":
        # Scores are those of albedo alone, which a dataset without renders gives at once.
        rendered = args.out / "rendered"
        shutil.copytree(dataset, rendered)
        mateval.run("prep", "render", rendered, "--renderer", "builtin", "--samples", "64")
        mateval.run("baseline", "delight", "--dataset", rendered, "--out", args.out / "delit")
        estimate = ["--estimate", args.out / "delit", "--adapter", "delight"]
    for method, words in METHODS.items():
        mateval.run("baseline", *words, *estimate, "--dataset", dataset, "--out", args.out / method)
    submissions = [args.out / method for method in METHODS]
    mateval.run("eval", "score", *submissions, "--dataset", dataset, "--out", args.out / "results")
    report(out=args.out, rooms=rooms)


class Command:
    """The command `mateval`, whose output is shown only where it fails."""

    def __init__(self, *, program: str) -> None:
        self.program = program

    def run(self, *words: object) -> str:
        """Runs a subcommand and returns what it prints."""
        done = subprocess.run([self.program, *map(str, words)], capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"{' '.join(map(str, words))}: exit code {done.returncode}\n{done.stderr[-2000:]}")
        return done.stdout


def write_rooms(*, mateval: Command, out: Path, rooms: int, seed: int, size: list[int]) -> dict[str, str]:
    """Writes the rooms' sources and the recipe. Returns the graphs of each room by its id."""
    draw = random.Random(seed)
    mateval.run("sample", out / "source")
    recipe = f'name = "textured"\nresolution = [{size[0]}, {size[1]}]\n'
    graphs = {}
    for number in range(rooms):
        room = f"room{number}"
        shutil.copytree(out / "source/room", out / "source" / room)
        chosen = []
        for texture, (side, options) in TEXTURES.items():
            graph, sizes = draw.choice(options)
            values = drawn(mateval=mateval, graph=graph, side=side, sizes=sizes, draw=draw)
            words = [f"--set={name}={value}" for name, value in values]
            words += ["--size", side, "--resolution", 1024, "--force"]
            picture = out / "source" / room / "textures" / f"{texture}.png"
            mateval.run("graph", "render", graph, *words, "--out", picture)
            chosen.append(graph)
        graphs[room] = ", ".join(chosen)
        recipe += f'\n[[scene]]\nid = "{room}"\nbitterli = "{room}/scene.xml"\n'
    (out / "recipe.toml").write_text(recipe)
    return graphs


def spoil_parts(*, out: Path, rooms: dict[str, str], seed: int) -> None:
    """Writes labels for each room: an instance is one part, or two of half its triangles."""
    draw = random.Random(seed)
    for room in rooms:
        scene = json.loads((out / "without-labels/scenes" / room / "scene.json").read_text())
        folder = out / "source" / room / "labels"
        folder.mkdir()
        for instance in scene["instances"]:
            count = instance["triangles"]
            half = draw.choice([0, count // 2])
            labels = [int(triangle < half) for triangle in range(count)]
            header = f"{{'descr': '<i8', 'fortran_order': False, 'shape': ({count},), }}"
            header += " " * (-(len(header) + 11) % 64) + "\n"
            start = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode()
            (folder / f"{instance['id']}.npy").write_bytes(start + struct.pack(f"<{count}q", *labels))
    recipe = out / "recipe.toml"
    text = recipe.read_text()
    recipe.write_text(text.replace("scene.xml\"\n", "scene.xml\"\npart_labels = { spoiled = \"labels\" }\n"))


def drawn(*, mateval: Command, graph: str, side: float, sizes: dict, draw: random.Random) -> list[tuple[str, str]]:
    """Values of a graph's parameters: sizes that divide the side, and colours."""
    values = [(name, str(side / draw.randrange(low, high + 1, *step))) for name, (low, high, *step) in sizes.items()]
    for line in mateval.run("graph", "list", graph).splitlines():
        words = line.split()
        if len(words) > 1 and words[1] == "color3":
            grey = draw.uniform(0.05, 0.75)
            values.append((words[0], ",".join(str(min(1.0, grey * draw.uniform(0.7, 1.3))) for _ in range(3))))
    return values


def report(*, out: Path, rooms: dict[str, str]) -> None:
    """Prints the scores and the counts."""
    results = {}
    for method in METHODS:
        file = json.loads((out / "results" / f"{method}.json").read_text())
        results[method] = file["protocols"]["mateval-3"]["scenes"]
    wins = {"LPIPS": 0, "PSNR": 0, "unobserved PSNR": 0, "unobserved LPIPS": 0}
    losses: dict[str, list[float]] = {"PSNR": [], "LPIPS": []}
    print("PSNR in dB and LPIPS of novel views: median-part, procedural; of unobserved regions: nn, keep-seen")
    for room, graphs in rooms.items():
        of = {method: results[method][room] for method in METHODS}
        flat, near, graph, kept = of["median-part"], of["nn"], of["procedural"], of["keep-seen"]
        spoiled = of["spoiled-parts"]
        losses["PSNR"].append(graph["albedo.novel.psnr"] - spoiled["albedo.novel.psnr"])
        losses["LPIPS"].append(spoiled["albedo.novel.lpips_alex"] - graph["albedo.novel.lpips_alex"])
        psnr, lpips = "albedo.novel.psnr", "albedo.novel.lpips_alex"
        far_psnr, far_lpips = "albedo.unobserved.psnr", "albedo.unobserved.lpips_alex"
        wins["LPIPS"] += graph[lpips] < flat[lpips]
        wins["PSNR"] += graph[psnr] > flat[psnr] - 0.2
        wins["unobserved PSNR"] += kept[far_psnr] >= near[far_psnr] + 1
        wins["unobserved LPIPS"] += kept[far_lpips] <= near[far_lpips]
        print(
            f"{room}: {flat[psnr]:.2f} {graph[psnr]:.2f}, {flat[lpips]:.3f} {graph[lpips]:.3f}; "
            f"{near[far_psnr]:.2f} {kept[far_psnr]:.2f}, {near[far_lpips]:.3f} {kept[far_lpips]:.3f}  ({graphs})"
        )
    print(
        f"of {len(rooms)} rooms: LPIPS lower than median-part in {wins['LPIPS']}, PSNR no more than 0.2 dB lower in "
        f"{wins['PSNR']}; keep-seen at least 1 dB above nn where nothing is observed in {wins['unobserved PSNR']}, LPIPS "
        f"not higher in {wins['unobserved LPIPS']}"
    )
    psnr_loss, lpips_loss = (sum(losses[name]) / len(rooms) for name in ("PSNR", "LPIPS"))
    print(f"spoiled parts cost {psnr_loss:.2f} dB and {lpips_loss:.3f} in LPIPS, in the mean over novel views")


if __name__ == "__main__":
    main()
