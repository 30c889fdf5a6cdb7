"""Settings and passes of a render."""

from pathlib import Path

import bpy

from mateval import devices
from mateval.job import Job, group_name
from mateval.materials import BASE_COLOR, INSTANCE, PART


def set_up(*, scene: bpy.types.Scene, job: Job) -> None:
    """Sets up Cycles without clamping, filtering, guiding or denoising, and one file of 32-bit passes."""
    render = scene.render
    render.engine = "CYCLES"
    render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    render.image_settings.color_depth = "32"
    render.image_settings.exr_codec = "ZIP"
    render.use_persistent_data = True
    render.film_transparent = False
    render.use_compositing = False
    render.use_sequencer = False
    render.dither_intensity = 0.0
    if job["threads"] > 0:
        render.threads_mode = "FIXED"
        render.threads = job["threads"]
    cycles = scene.cycles
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.use_guiding = False
    # In rooms, cost times noise is 1.5 to 1.8 times as high with the light tree, and up to ten times as high in dim light
    # groups (benches/noise_for_cost.py).
    cycles.use_light_tree = False
    cycles.sampling_pattern = "TABULATED_SOBOL"
    cycles.pixel_filter_type = "BOX"
    cycles.film_exposure = 1.0
    cycles.sample_clamp_direct = 0.0
    cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0
    cycles.caustics_reflective = True
    cycles.caustics_refractive = True
    cycles.light_sampling_threshold = 0.0
    cycles.min_light_bounces = 0
    cycles.min_transparent_bounces = 0
    bounces = job["max_bounces"]
    cycles.max_bounces = bounces
    cycles.transparent_max_bounces = 4 * bounces
    for kind in ("diffuse", "glossy", "transmission", "volume"):
        setattr(cycles, f"{kind}_bounces", bounces)
    add_passes(layer=scene.view_layers[0])


def set_device(*, scene: bpy.types.Scene, job: Job) -> tuple[dict | None, str | None]:
    """Chooses the device that renders. Returns it, or None for the processor, and a remark for the user."""
    # The denoiser stays on the processor, so that it denoises the same pictures to the same bytes.
    scene.render.compositor_device = "CPU"
    scene.render.compositor_denoise_device = "CPU"
    device, remark = devices.choose(
        preferences=bpy.context.preferences.addons["cycles"].preferences,
        wanted=job["device"],
        required=job["required_device"],
        turn=job["turn"],
    )
    scene.cycles.device = "CPU" if device is None else "GPU"
    return device, remark


def add_passes(*, layer: bpy.types.ViewLayer) -> None:
    """Enables the passes of depth, normals, ids and base colour. Light groups have passes of their own."""
    layer.use_pass_combined = True
    layer.use_pass_z = True
    layer.use_pass_normal = True
    layer.cycles.denoising_store_passes = True
    for name, kind in ((INSTANCE, "VALUE"), (PART, "VALUE"), (BASE_COLOR, "COLOR")):
        aov = layer.aovs.add()
        aov.name, aov.type = name, kind


def render_to(*, scene: bpy.types.Scene, path: Path, samples: int, seed: int) -> None:
    """Renders the scene to the file."""
    scene.cycles.samples = samples
    scene.cycles.seed = seed
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    if not path.is_file():
        raise RuntimeError(f"Blender did not write '{path}'")


def light_passes(*, job: Job) -> list[str]:
    """Returns the names of the passes of light: RGB, then each group."""
    return ["Combined"] + [f"Combined_{group_name(group=group)}" for group in range(len(job["lights"]))]
