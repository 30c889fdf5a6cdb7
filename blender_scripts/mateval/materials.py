"""Materials and lamps of a job as Cycles' shader graphs.

The names of models and inputs are those of `reference.json` and `lights.json` (dataset_spec/format/truth.md).
`approximation` states where Cycles only comes near a model.
"""

from pathlib import Path

import bpy

from mateval.job import Job
from mateval.metal import edge_tint, reflectance
from mateval.nodes import (
    Socket,
    Tree,
    backfacing,
    constant,
    is_camera_ray,
    linear_map,
    mix,
    new,
    number,
    put,
    scaled,
    times,
    vector_math,
)
from mateval.nodes import math as operation
from mateval.plastic import base_under_coat

UV_LAYER = "uv"
INSTANCE, PART, BASE_COLOR = "instance", "part", "base_color"
"""Attributes of faces, and the passes that show them."""

EXTENSIONS = {"repeat": "REPEAT", "clamp": "EXTEND", "mirror": "MIRROR"}
DISTRIBUTIONS = {"ggx": "GGX", "beckmann": "BECKMANN"}
BLACK = (0.0, 0.0, 0.0)
WHITE = [1.0, 1.0, 1.0]
IDENTITY = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
COVERED = 0.5
"""Smallest opacity at which a place counts as part of the surface, in ids and base colour."""


class Textures:
    """The job's textures, each loaded once. A texture that cannot be read is an error: Blender would show it pink."""

    def __init__(self, *, job: Job, folder: Path) -> None:
        self._images = [self._load(path=folder / texture["file"]) for texture in job["textures"]]
        self._extensions = [EXTENSIONS[texture["wrap"]] for texture in job["textures"]]

    @staticmethod
    def _load(*, path: Path) -> bpy.types.Image:
        image = bpy.data.images.load(str(path))
        image.colorspace_settings.name = "Non-Color"
        if min(image.size) < 1 or not image.has_data:
            raise RuntimeError(f"Blender cannot read the texture '{path}'")
        return image

    def color(self, *, tree: Tree, lookup: Job) -> Socket:
        """Adds a lookup of the texture at the surface's uv, with linear values."""
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = self._images[lookup["texture"]]
        node.interpolation = "Linear"
        node.extension = self._extensions[lookup["texture"]]
        uv = tree.nodes.new("ShaderNodeUVMap")
        uv.uv_map = UV_LAYER
        place = uv.outputs["UV"]
        if lookup["uv"] != IDENTITY:
            place = vector_math(tree=tree, operation="ADD", values=[place, (0.0, 0.0, 1.0)])
            place = linear_map(tree=tree, vector=place, rows=lookup["uv"])
        tree.links.new(place, node.inputs["Vector"])
        return node.outputs["Color"]

    def image(self, *, index: int) -> bpy.types.Image:
        """Returns the image."""
        return self._images[index]


def color_of(*, tree: Tree, textures: Textures, given: Job) -> Socket:
    """Adds a colour of a material: `{"constant": rgb}` or `{"texture": ...}`."""
    if "constant" in given:
        return constant(tree=tree, color=given["constant"])
    return textures.color(tree=tree, lookup=given["texture"])


def number_of(*, tree: Tree, textures: Textures, given: Job) -> Socket:
    """Adds a number of a material: `{"constant": value}` or one channel of a texture."""
    if "constant" in given:
        return number(tree=tree, value=given["constant"])
    color = textures.color(tree=tree, lookup=given["texture"])
    return new(tree=tree, kind="ShaderNodeSeparateColor", Color=color).outputs[given["texture"]["channel"]]


def is_white(*, given: Job) -> bool:
    """Returns whether a colour is constant white, which changes nothing."""
    return given.get("constant") == WHITE


def roughness_of(*, tree: Tree, textures: Textures, microfacets: Job | None) -> Socket:
    """Adds Blender's roughness: the square root of the distribution's alpha, 0 for a smooth surface."""
    if microfacets is None:
        return number(tree=tree, value=0.0)
    alpha = number_of(tree=tree, textures=textures, given=microfacets["alpha"])
    return operation(tree=tree, operation="SQRT", values=[alpha])


def distribution_of(*, microfacets: Job | None) -> str:
    """Returns Blender's name of the distribution."""
    return DISTRIBUTIONS[microfacets["distribution"]] if microfacets else "GGX"


def base_color(*, tree: Tree, textures: Textures, model: Job) -> Socket | None:
    """Adds the base_color that methods recover (format/truth.md); none for glass."""
    match model["type"]:
        case "diffuse":
            return color_of(tree=tree, textures=textures, given=model["reflectance"])
        case "plastic":
            return color_of(tree=tree, textures=textures, given=model["diffuse_reflectance"])
        case "principled":
            return color_of(tree=tree, textures=textures, given=model["base_color"])
        case "conductor":
            tint = color_of(tree=tree, textures=textures, given=model["specular_reflectance"])
            return times(tree=tree, color=tint, factor=normal_reflectance(ior=model["ior"]))
        case _:
            return None


def normal_reflectance(*, ior: Job | str) -> tuple[float, ...]:
    """Returns F0 of a conductor."""
    if ior == "perfect_mirror":
        return (1.0, 1.0, 1.0)
    pairs = zip(ior["eta_k"]["eta"], ior["eta_k"]["k"], strict=True)
    return tuple(reflectance(cosine=1.0, eta=eta, k=k) for eta, k in pairs)


def reflecting(*, tree: Tree, textures: Textures, model: Job) -> Socket:
    """Adds the shader of a model, without emission, opacity and bump map."""
    makers = {
        "diffuse": diffuse,
        "plastic": plastic,
        "principled": principled,
        "conductor": conductor,
        "dielectric": dielectric,
        "thin_dielectric": thin_dielectric,
    }
    return makers[model["type"]](tree=tree, textures=textures, model=model)


def diffuse(*, tree: Tree, textures: Textures, model: Job) -> Socket:
    """Adds Lambert, or Blender's Oren-Nayar where there is a roughness."""
    color = color_of(tree=tree, textures=textures, given=model["reflectance"])
    roughness: Socket | float = 0.0
    if model["alpha"] is not None:
        roughness = number_of(tree=tree, textures=textures, given=model["alpha"])
    return new(tree=tree, kind="ShaderNodeBsdfDiffuse", Color=color, Roughness=roughness).outputs[0]


def principled(*, tree: Tree, textures: Textures, model: Job) -> Socket:
    """Adds Principled with every other input at its default."""
    return new(
        tree=tree,
        kind="ShaderNodeBsdfPrincipled",
        Base_Color=color_of(tree=tree, textures=textures, given=model["base_color"]),
        Roughness=number_of(tree=tree, textures=textures, given=model["roughness"]),
        Metallic=number_of(tree=tree, textures=textures, given=model["metallic"]),
        Specular_IOR_Level=model["specular"],
        IOR=1.5,
    ).outputs[0]


def plastic(*, tree: Tree, textures: Textures, model: Job) -> Socket:
    """Adds Principled with the coat's index, and with the base colour as it appears through the coat."""
    given = color_of(tree=tree, textures=textures, given=model["diffuse_reflectance"])
    scale, inner = base_under_coat(eta=model["eta"], nonlinear=model["nonlinear"])
    color = times(tree=tree, color=given, factor=(scale, scale, scale))
    if inner > 0.0:
        lost = times(tree=tree, color=given, factor=(-inner, -inner, -inner))
        rest = vector_math(tree=tree, operation="ADD", values=[lost, (1.0, 1.0, 1.0)])
        color = vector_math(tree=tree, operation="DIVIDE", values=[color, rest])
    node = new(
        tree=tree,
        kind="ShaderNodeBsdfPrincipled",
        Base_Color=color,
        Roughness=roughness_of(tree=tree, textures=textures, microfacets=model["microfacets"]),
        Specular_Tint=color_of(tree=tree, textures=textures, given=model["specular_reflectance"]),
        IOR=model["eta"],
    )
    node.distribution = "GGX"
    return node.outputs[0]


def conductor(*, tree: Tree, textures: Textures, model: Job) -> Socket:
    """Adds a metal by its complex index; a tinted one by its colour at normal incidence and at the edge."""
    roughness = roughness_of(tree=tree, textures=textures, microfacets=model["microfacets"])
    distribution = distribution_of(microfacets=model["microfacets"])
    if model["ior"] == "perfect_mirror":
        tint = color_of(tree=tree, textures=textures, given=model["specular_reflectance"])
        node = new(tree=tree, kind="ShaderNodeBsdfAnisotropic", Color=tint, Roughness=roughness)
        node.distribution = distribution
        return node.outputs[0]
    node = new(tree=tree, kind="ShaderNodeBsdfMetallic", Roughness=roughness)
    node.distribution = distribution
    eta, k = model["ior"]["eta_k"]["eta"], model["ior"]["eta_k"]["k"]
    if is_white(given=model["specular_reflectance"]):
        node.fresnel_type = "PHYSICAL_CONDUCTOR"
        node.inputs["IOR"].default_value = tuple(eta)
        node.inputs["Extinction"].default_value = tuple(k)
        return node.outputs[0]
    node.fresnel_type = "F82"
    tints = tuple(edge_tint(eta=e, k=x) for e, x in zip(eta, k, strict=True))
    put(tree=tree, socket=node.inputs["Base Color"], value=base_color(tree=tree, textures=textures, model=model))
    node.inputs["Edge Tint"].default_value = (*tints, 1.0)
    return node.outputs[0]


def dielectric(*, tree: Tree, textures: Textures, model: Job) -> Socket:
    """Adds glass with one colour for reflection and transmission."""
    color = color_of(tree=tree, textures=textures, given=model["specular_transmittance"])
    roughness = roughness_of(tree=tree, textures=textures, microfacets=model["microfacets"])
    node = new(tree=tree, kind="ShaderNodeBsdfGlass", Color=color, Roughness=roughness)
    node.distribution = distribution_of(microfacets=model["microfacets"])
    node.inputs["IOR"].default_value = model["eta"]
    return node.outputs[0]


def thin_dielectric(*, tree: Tree, textures: Textures, model: Job) -> Socket:
    """Adds a pane: both boundaries together reflect 2 F / (1 + F), and the rest passes straight through."""
    # Blender's Fresnel node inverts the index for the back of a surface; a pane looks the same from both sides.
    eta = model["eta"]
    behind = backfacing(tree=tree)
    index = operation(tree=tree, operation="MULTIPLY_ADD", values=[behind, 1.0 / eta - eta, eta])
    one = new(tree=tree, kind="ShaderNodeFresnel", IOR=index).outputs[0]
    twice = operation(tree=tree, operation="MULTIPLY", values=[one, 2.0])
    both = operation(
        tree=tree, operation="DIVIDE", values=[twice, operation(tree=tree, operation="ADD", values=[one, 1.0])]
    )
    through = color_of(tree=tree, textures=textures, given=model["specular_transmittance"])
    back = color_of(tree=tree, textures=textures, given=model["specular_reflectance"])
    clear = new(tree=tree, kind="ShaderNodeBsdfTransparent", Color=through).outputs[0]
    mirror = new(tree=tree, kind="ShaderNodeBsdfAnisotropic", Color=back, Roughness=0.0).outputs[0]
    return mix(tree=tree, factor=both, first=clear, second=mirror)


def approximation(*, model: Job) -> str | None:
    """Returns how Cycles deviates from the model; none where it does not."""
    match model["type"]:
        case "principled" if model["flavour"] != "blender":
            return "Mitsuba's principled is rendered as Blender's"
        case "diffuse" if model["alpha"] is not None:
            return "Oren-Nayar is Blender's own form of it"
        case "plastic":
            return "plastic is Principled with a base colour of the same mean brightness under the coat"
        case "conductor" if model["ior"] != "perfect_mirror" and not is_white(given=model["specular_reflectance"]):
            return "a tinted conductor is Blender's F82 metal"
        case "dielectric" if model["specular_reflectance"] != model["specular_transmittance"]:
            return "glass reflects with the colour that it lets through"
        case _:
            return None


def surface_material(*, textures: Textures, material: Job, light: Job | None) -> bpy.types.Material:
    """Makes the material that is lit; `light` is the light group of its surface."""
    made, tree, output = empty(name=material["name"])
    two_sided_lamp = light is not None and light["emission"]["two_sided"]
    made.cycles.emission_sampling = "FRONT_BACK" if two_sided_lamp else "FRONT" if light else "NONE"
    made.cycles.use_bump_map_correction = False
    model = material["model"]
    shader = reflecting(tree=tree, textures=textures, model=model)
    bend(tree=tree, textures=textures, bump=material["bump"])
    if not material["two_sided"] and "dielectric" not in model["type"]:
        black = new(tree=tree, kind="ShaderNodeBsdfDiffuse", Color=(*BLACK, 1.0)).outputs[0]
        shader = mix(tree=tree, factor=backfacing(tree=tree), first=shader, second=black)
    if light is not None:
        shader = lamp(tree=tree, textures=textures, surface=shader, light=light)
    covered = None
    if material["opacity"] is not None:
        opacity = number_of(tree=tree, textures=textures, given=material["opacity"])
        shader = mix(tree=tree, factor=opacity, first=clear(tree=tree), second=shader)
        covered = is_covered(tree=tree, opacity=opacity)
    tree.links.new(shader, output.inputs["Surface"])
    color = base_color(tree=tree, textures=textures, model=model)
    if color is not None:
        show_color(tree=tree, name=BASE_COLOR, color=color, covered=covered)
    return made


def geometry_material(*, textures: Textures, material: Job) -> bpy.types.Material:
    """Makes the material of the geometry pass: its opacity, and the ids of instance and part, without light."""
    made, tree, output = empty(name=f"geometry of {material['name']}")
    made.cycles.emission_sampling = "NONE"
    shader = new(tree=tree, kind="ShaderNodeBsdfDiffuse").outputs[0]
    covered = None
    if material["opacity"] is not None:
        opacity = number_of(tree=tree, textures=textures, given=material["opacity"])
        covered = is_covered(tree=tree, opacity=opacity)
        shader = mix(tree=tree, factor=covered, first=clear(tree=tree), second=shader)
    tree.links.new(shader, output.inputs["Surface"])
    for name in (INSTANCE, PART):
        attribute = tree.nodes.new("ShaderNodeAttribute")
        attribute.attribute_name = name
        show_number(tree=tree, name=name, value=attribute.outputs["Fac"], covered=covered)
    return made


def empty(*, name: str) -> tuple[bpy.types.Material, Tree, bpy.types.Node]:
    """Makes a material without a surface shader; returns it, its graph and its output node."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    return made, tree, tree.nodes.new("ShaderNodeOutputMaterial")


def clear(*, tree: Tree) -> Socket:
    """Adds a fully transparent shader."""
    return new(tree=tree, kind="ShaderNodeBsdfTransparent").outputs[0]


def is_covered(*, tree: Tree, opacity: Socket) -> Socket:
    """Adds 1 where the opacity is large enough to count, else 0."""
    return operation(
        tree=tree,
        operation="LESS_THAN",
        values=[COVERED, operation(tree=tree, operation="ADD", values=[opacity, 1e-6])],
    )


def bend(*, tree: Tree, textures: Textures, bump: Job | None) -> None:
    """Gives every shader of the graph the normal of the height map, whose heights are in metres times `scale`."""
    if bump is None:
        return
    height = number_of(tree=tree, textures=textures, given=bump["height"])
    node = new(tree=tree, kind="ShaderNodeBump", Strength=1.0, Distance=bump["scale"], Height=height)
    for shader in tree.nodes:
        if shader.bl_idname.startswith("ShaderNodeBsdf") and "Normal" in shader.inputs:
            tree.links.new(node.outputs["Normal"], shader.inputs["Normal"])


def lamp(*, tree: Tree, textures: Textures, surface: Socket, light: Job) -> Socket:
    """Adds emission. A hidden light shows its surface to camera rays and its emission to all other rays."""
    emission = light["emission"]
    radiance = constant(tree=tree, color=emission["radiance"])
    if emission.get("map") is not None:
        radiance = times(tree=tree, color=textures.color(tree=tree, lookup=emission["map"]), factor=radiance)
    if not emission["two_sided"]:
        front = operation(tree=tree, operation="SUBTRACT", values=[1.0, backfacing(tree=tree)])
        radiance = scaled(tree=tree, color=radiance, factor=front)
    glow = new(tree=tree, kind="ShaderNodeEmission", Color=radiance, Strength=1.0).outputs[0]
    if not light["camera_visible"]:
        return mix(tree=tree, factor=is_camera_ray(tree=tree), first=glow, second=surface)
    add = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(glow, add.inputs[0])
    tree.links.new(surface, add.inputs[1])
    return add.outputs[0]


def show_color(*, tree: Tree, name: str, color: Socket, covered: Socket | None) -> None:
    """Writes the colour to the pass with this name."""
    node = tree.nodes.new("ShaderNodeOutputAOV")
    node.aov_name = name
    value = color if covered is None else scaled(tree=tree, color=color, factor=covered)
    tree.links.new(value, node.inputs["Color"])


def show_number(*, tree: Tree, name: str, value: Socket, covered: Socket | None) -> None:
    """Writes the number to the pass with this name."""
    node = tree.nodes.new("ShaderNodeOutputAOV")
    node.aov_name = name
    shown = value if covered is None else operation(tree=tree, operation="MULTIPLY", values=[value, covered])
    tree.links.new(shown, node.inputs["Value"])
