"""Leaderboards that the tests open: of invented results, and of the built-in sample."""

import functools
import json
import os
import subprocess
import tempfile
from pathlib import Path

import results

MATEVAL = os.environ.get("MATEVAL", str(Path(__file__).parents[2] / "target/debug/mateval"))
EVIL = "<script>document.title='broken in'</script>"

#: Name, id, PSNR, seed and further keys of each method. Two are copies of one method; one attempts to inject a script.
METHODS = [
    ("TrueTexture", "truetexture", 33.0, 1, {"licence": "MIT", "url": "https://example.org/true",
                                             "cost": {"seconds_a_scene": 12.5, "hardware": "one laptop"}}),
    ("CopyA", "copya", 27.0, 2, {"licence": "CC-BY-NC-4.0", "cost": {"seconds_a_scene": 340.0, "hardware": "one large GPU"}}),
    ("CopyB", "copyb", 27.0, 2, {"description": "the colours of CopyA, bit by bit", "not_predicted": ["roughness"]}),
    ("A method with a name that is quite a bit longer than others", "a-method-with-a-name-that-is-quite-a-bit-longer", 24.0, 4,
     {"cost": {"seconds_a_scene": 3.0, "hardware": ""}}),
    (EVIL, "script-document-title-broken-in-script", 20.0, 5, {"url": "javascript:alert(1)"}),
    ("grey", "grey", 11.0, 6, {"description": "0.5 everywhere"}),
]
SCENES = results.scene_names(12)


def make_small(folder: Path) -> Path:
    """Six submissions on twelve scenes, with pictures of six scenes, errata, verifications, results on other materials and a
    page to vote on."""
    paths = []
    for name, method, psnr, seed, said in METHODS:
        path = folder / f"{method[:10]}.json"
        path.write_text(results.pretty(results.result(method=name, psnr=psnr, scenes=SCENES, seed=seed, **said)))
        paths.append(path)
    original = folder / "original"
    original.mkdir()
    for name, method, psnr, seed, said in METHODS[1:]:
        found = results.result(method=name, psnr=psnr + seed, scenes=SCENES, seed=seed, manifest="6" * 64, **said)
        (original / f"{method[:10]}.json").write_text(results.pretty(found))
    key = folder / "key"
    subprocess.run([MATEVAL, "key", "new", key], check=True, stdout=subprocess.DEVNULL)
    results.write_verification(paths[0], confirmed=True, key=key)
    results.write_verification(paths[5], confirmed=False, key=key)
    misses = {method: 0.1 * at for at, (_, method, *_) in enumerate(METHODS)}
    results.write_pictures(folder / "pictures", methods=misses, scenes=SCENES[:6], width=64, height=36)
    entry = {"date": "2026-03-01", "title": "A lamp was missing", "text": "room-002 was rendered again.", "affects": ["room-002"]}
    (folder / "errata.json").write_text(results.pretty({"format": "mateval-errata/1", "entries": [entry]}))
    site = folder / "site"
    ceiling = folder / "truth.json"
    ceiling.write_text(results.pretty(results.result(method="gt", psnr=48.0, scenes=SCENES, seed=7)))
    results.write_verification(ceiling, confirmed=True, key=key)
    subprocess.run([MATEVAL, "eval", "leaderboard", *paths, "--out", site, "--pictures", folder / "pictures", "--ceiling", ceiling,
                    "--errata", folder / "errata.json", "--trust", f"{key}.pub", "--votes",
                    "--original", original], check=True, stdout=subprocess.DEVNULL)
    return site


def make_large(folder: Path) -> Path:
    """Fifty methods on 184 scenes; pictures of the first scene."""
    scenes = results.scene_names(184)
    paths = []
    for at in range(50):
        path = folder / f"{at}.json"
        path.write_text(json.dumps(results.result(method=f"method {at}", psnr=15 + 0.3 * at, scenes=scenes, seed=at)))
        paths.append(path)
    misses = {f"method-{at}": 0.01 * at for at in range(50)}
    results.write_pictures(folder / "pictures", methods=misses, scenes=scenes[:1], width=32, height=18)
    subprocess.run([MATEVAL, "eval", "leaderboard", *paths, "--out", folder / "site", "--pictures", folder / "pictures"],
                   check=True, stdout=subprocess.DEVNULL)
    return folder / "site"


def make_few(folder: Path) -> Path:
    """Two methods on two houses, which are too few for intervals."""
    scenes = results.scene_names(2)
    paths = []
    for method, psnr, seed in [("one", 25.0, 1), ("two", 20.0, 2)]:
        path = folder / f"{method}.json"
        path.write_text(results.pretty(results.result(method=method, psnr=psnr, scenes=scenes, seed=seed)))
        paths.append(path)
    subprocess.run([MATEVAL, "eval", "leaderboard", *paths, "--out", folder / "site"], check=True, stdout=subprocess.DEVNULL)
    return folder / "site"


def make_curves(folder: Path) -> Path:
    """A method on true and on moved furniture, and another method, with wide views and twins: all pages with curves."""
    scenes = results.scene_names(3)
    paths = []
    for at, (method, psnr, level) in enumerate([("one", 25.0, 0), ("one", 22.0, 1), ("one", 18.0, 2), ("two", 20.0, 0)]):
        said = {"geometry": {"kind": "pose", "level": level}} if level else {}
        result = results.result(method=method, psnr=psnr, scenes=scenes, seed=at, **said)
        results.add_wide_views(result, psnr=psnr)
        results.add_constancy(result, ratio=0.25 * (at + 1))
        path = folder / f"{at}.json"
        path.write_text(results.pretty(result))
        paths.append(path)
    subprocess.run([MATEVAL, "eval", "leaderboard", *paths, "--out", folder / "site"], check=True, stdout=subprocess.DEVNULL)
    return folder / "site"


RECIPE = """name = "sample"
resolution = [96, 72]
atlas_size = 128
views = [{ id = "left", x_deg = 0, y_deg = 5 }]
[[scene]]
id = "room"
bitterli = "room/scene.xml"
house = "sample"
"""


#: Removed when the tests end.
_kept = tempfile.TemporaryDirectory()


@functools.cache
def sample() -> Path:
    """A folder with the built-in room as `dataset`, and a `site` of two baselines with their pictures and rooms."""
    folder = Path(_kept.name)
    run = lambda *words: subprocess.run([MATEVAL, *words], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    source, dataset, site = folder / "source", folder / "dataset", folder / "site"
    run("sample", source)
    (source / "recipe.toml").write_text(RECIPE)
    run("prep", "build", source / "recipe.toml", "--out", dataset)
    run("prep", "render", dataset, "--renderer", "builtin", "--samples", "1")
    submissions = [folder / name for name in ["nn", "grey"]]
    for submission in submissions:
        run("baseline", submission.name, "--dataset", dataset, "--out", submission)
    run("eval", "score", *submissions, "--dataset", dataset, "--out", folder / "results")
    given = [word for submission in submissions for word in ("--submission", submission)]
    run("eval", "leaderboard", *sorted((folder / "results").glob("*.json")), "--dataset", dataset, *given, "--out", site, "--samples", "4")
    return folder
