"""Reads a `.blend` scene: bakes every material to textures and writes the scene as glTF.

    python bake_blend.py JOB.json                                                              with the bpy module
    blender --background --factory-startup --disable-autoexec --python bake_blend.py -- JOB.json    with the program

Writes `scene.glb`, `result.json` and, for a world that is not of one colour, `world.exr` into the job's folder `out`.
Lines on stdout that begin with `mateval:` report progress. The exit code is 0, or 1 with the reason in `result.json`:
`faults` for a file that is refused, `error` for anything else. No Python of the file is run.
"""

import os
import sys
import tempfile
import threading
import time
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import bpy  # noqa: E402 (the folder of this file must come first)
from mateval.bake import bake_body, edges_of, make_bench, set_up  # noqa: E402
from mateval.baking_job import RESULT_FORMAT, SMALLEST_EDGE, Findings, Job, halvings, read_job  # noqa: E402
from mateval.blend_file import open_scene, step_aside  # noqa: E402
from mateval.bodies import Body, apply_shear, make_bodies  # noqa: E402
from mateval.evaluated import TooMuchError, evaluate  # noqa: E402
from mateval.gltf import MaterialWriter, export  # noqa: E402
from mateval.job import write_result  # noqa: E402
from mateval.lighting import add_camera, add_light, read_world  # noqa: E402
from mateval.osl import prepare_scripts  # noqa: E402
from mateval.unwrap import drop_missing_uv, plan_uvs, slots_of  # noqa: E402

VERSION = (4, 5)
"""The version of Blender whose nodes are known."""


def main() -> None:
    """Runs the job that the last command-line argument names."""
    path = Path(sys.argv[-1]).resolve()
    threading.Thread(target=end_with, kwargs={"parent": os.getppid()}, daemon=True).start()
    code = 1
    try:
        code = carry_out_or_record(path=path)
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        # bpy 4.5 may hang in an ordinary exit, and on a full disk even a message about it fails.
        os._exit(code)


def carry_out_or_record(*, path: Path) -> int:
    """Runs the job and writes its result, with any error. Returns the exit code."""
    result: Job = {
        "format": RESULT_FORMAT,
        "blender": bpy.app.version_string,
        "glb": None,
        "world": None,
        "lamps": [],
        "materials": [],
        "files": [],
        "findings": [],
        "faults": [],
        "error": None,
    }
    out, findings = path.parent, Findings()
    try:
        job = read_job(path=path)
        out = Path(job["out"])
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as work:
            carry_out(job=job, work=Path(work), result=result, findings=findings)
    except BaseException as error:  # noqa: BLE001 (every error is recorded)
        result["error"] = f"{type(error).__name__}: {error}"
        traceback.print_exc()
    result["findings"], result["faults"] = findings.notes, findings.faults
    write_result(folder=out, result=result)
    return 0 if result["error"] is None and not result["faults"] else 1


def end_with(*, parent: int) -> None:
    """Ends this process when its parent has ended, since nothing would read the result."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(2)


def carry_out(*, job: Job, work: Path, result: Job, findings: Findings) -> None:
    """Opens, evaluates, bakes and exports. Returns early where the file is refused."""
    if bpy.app.version[:2] != VERSION:
        raise RuntimeError(f"expected Blender {VERSION[0]}.{VERSION[1]}, found {bpy.app.version_string}")
    report("open")
    source, result["files"] = open_scene(job=job, findings=findings)
    is_osl = prepare_scripts(folder=Path(job["folder"]), work=work, findings=findings)
    if findings.faults:
        return
    report("evaluate")
    limits = {key: job[key] for key in ("most_instances", "most_triangles")}
    try:
        found = evaluate(scene=source, findings=findings, **limits)
    except TooMuchError as error:
        findings.fault(
            code="too_much", place=source.name, message=str(error), action="simplify it, or raise the limits"
        )
        return
    scene = bpy.data.scenes.new("mateval")
    bench = make_bench(job=job, source=source, is_osl=is_osl)
    set_up(scene=scene, job=job, source=source, is_osl=is_osl)
    step_aside(items=bpy.data.objects)
    bodies = make_bodies(found=found, scene=scene, findings=findings)
    step_aside(items=bpy.data.materials)
    add_camera(camera=found.camera, source=source, scene=scene, findings=findings)
    plan(bodies=bodies, bench=bench, job=job, findings=findings)
    writer = MaterialWriter(findings=findings)
    for number, body in enumerate(bodies):
        if any(slot.is_baked for slot in body.slots):
            report(f"bake {number + 1} of {len(bodies)}: {body.objects[0].name}")
        results = bake_body(body=body, bench=bench, surroundings=scene, findings=findings)
        drop_missing_uv(body=body)
        apply_shear(body=body)
        writer.assign(body=body, results=results)
    lamps = [add_light(light=light, scene=scene, findings=findings) for light in found.lights]
    result["lamps"] = [lamp for lamp in lamps if lamp is not None]
    report("world")
    result["world"] = read_world(source=source, bench=bench, job=job, findings=findings)
    report("export")
    export(scene=scene, path=Path(job["out"]) / "scene.glb")
    result["glb"], result["materials"] = "scene.glb", writer.entries


def plan(*, bodies: list[Body], bench: bpy.types.Scene, job: Job, findings: Findings) -> None:
    """Chooses uvs and sizes of all textures; halves the sizes until their sum is within the limit."""
    report("unwrap")
    for body in bodies:
        plan_uvs(body=body, bench=bench, job=job, findings=findings)
    slots = slots_of(bodies=bodies)
    if not slots:
        return
    times = halvings(edges=edges_of(slots=slots), most=job["most_baked_texels"])
    if times == 0:
        return
    for slot in slots:
        slot.edge = max(slot.edge >> times, SMALLEST_EDGE)
    message = f"textures of more than {job['most_baked_texels']} texels"
    findings.note(code="coarser_textures", place="scene", message=message, action=f"halved every edge {times} times")


def report(text: str) -> None:
    """Prints a line of progress."""
    print(f"mateval: {text}", flush=True)


if __name__ == "__main__":
    main()
