"""Renders one job with Blender's Cycles.

    python render.py JOB.json                  with the bpy module
    blender -b -P render.py -- JOB.json        with the program

For each view it writes `<view>/geometry.exr`, `centre.exr`, `a.exr`, `b.exr` and `denoised.exr` beside the job, and
`result.json`, which names the complete views. Lines on stdout that begin with `mateval:` report progress. The exit code
is 0, or 1 with the reason in `result.json`.
"""

import os
import sys
import threading
import time
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import bpy  # noqa: E402 (the folder of this file must come first)
from mateval.cycles import light_passes, render_to, set_device, set_up  # noqa: E402
from mateval.denoise import denoise_to  # noqa: E402
from mateval.job import RESULT_FORMAT, Job, read_job, write_result  # noqa: E402
from mateval.scene import BuiltScene  # noqa: E402

VERSION = (4, 5)
"""The version of Blender that the shader graphs are written for."""


def main() -> None:
    """Runs the job that the last command-line argument names."""
    path = Path(sys.argv[-1]).resolve()
    threading.Thread(target=end_with, kwargs={"parent": os.getppid()}, daemon=True).start()
    result: Job = {
        "format": RESULT_FORMAT,
        "blender": bpy.app.version_string,
        "device": None,
        "remark": None,
        "approximations": [],
        "views": [],
        "error": None,
    }
    code = 1
    try:
        carry_out_or_record(path=path, result=result)
        code = 0 if result["error"] is None else 1
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        # bpy 4.5 may hang in an ordinary exit, and on a full disk even a message about it fails.
        os._exit(code)


def carry_out_or_record(*, path: Path, result: Job) -> None:
    """Runs the job and records every error in the result."""
    try:
        carry_out(path=path, result=result)
    except BaseException as error:  # noqa: BLE001 (every error is recorded)
        result["error"] = f"{type(error).__name__}: {error}"
        write_result(folder=path.parent, result=result)
        traceback.print_exc()
    else:
        write_result(folder=path.parent, result=result)


def end_with(*, parent: int) -> None:
    """Ends this process when its parent has ended, since nothing would read the pictures."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(2)


def carry_out(*, path: Path, result: Job) -> None:
    """Renders all views of the job and records each in the result."""
    if bpy.app.version[:2] != VERSION:
        raise RuntimeError(f"expected Blender {VERSION[0]}.{VERSION[1]}, found {bpy.app.version_string}")
    job, folder = read_job(path=path), path.parent
    report("scene")
    built = BuiltScene(job=job, folder=folder)
    result["approximations"] = built.approximations
    set_up(scene=built.scene, job=job)
    result["device"], result["remark"] = set_device(scene=built.scene, job=job)
    built.show_geometry()
    for view in job["views"]:
        report(f"view {view['id']} geometry")
        (folder / view["id"]).mkdir(exist_ok=True)
        built.look_from(camera=view["camera"])
        render_to(scene=built.scene, path=folder / view["id"] / "geometry.exr", samples=1, seed=0)
    built.show_light()
    for view in job["views"]:
        result["views"].append(
            {"id": view["id"], "seconds": render_view(built=built, job=job, view=view, folder=folder)}
        )
        write_result(folder=folder, result=result)


def render_view(*, built: BuiltScene, job: Job, view: Job, folder: Path) -> dict[str, float]:
    """Renders both halves of a view and their denoised mean. Returns the seconds of each."""
    place = folder / view["id"]
    built.look_from(camera=view["camera"])
    render_to(scene=built.scene, path=place / "centre.exr", samples=1, seed=0)
    seconds = {}
    halves = (place / "a.exr", place / "b.exr")
    for half, seed in zip(halves, view["seeds"], strict=True):
        report(f"view {view['id']} half {half.stem}")
        start = time.monotonic()
        render_to(scene=built.scene, path=half, samples=job["samples_each_half"], seed=seed)
        seconds[half.stem] = round(time.monotonic() - start, 3)
    report(f"view {view['id']} denoise")
    start = time.monotonic()
    denoise_to(scene=built.scene, halves=halves, passes=light_passes(job=job), path=place / "denoised.exr")
    seconds["denoise"] = round(time.monotonic() - start, 3)
    return seconds


def report(text: str) -> None:
    """Prints a line of progress."""
    print(f"mateval: {text}", flush=True)


if __name__ == "__main__":
    main()
