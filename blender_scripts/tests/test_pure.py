"""The parts of `blender_scripts` that need no Blender."""

import json
import math
import struct
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from mateval.baking_job import (  # noqa: E402 (the folder above must come first)
    Findings,
    halvings,
    place_of,
    random_of_id,
    random_of_name,
    texture_edge,
)
from mateval.baking_job import read_job as read_baking_job  # noqa: E402
from mateval.camera import lens  # noqa: E402
from mateval.devices import KINDS, choose, driver  # noqa: E402
from mateval.environment import blender_from_world  # noqa: E402
from mateval.job import JobError, light_of_world, lights_of_surfaces, read_job, read_numbers, write_result  # noqa: E402
from mateval.metal import EDGE_COSINE, edge_tint, reflectance  # noqa: E402
from mateval.plastic import base_under_coat, diffuse_reflectance, fresnel  # noqa: E402


def area(*, surfaces: list[int]) -> dict:
    """A group of lamps."""
    return {"emission": {"type": "area", "surfaces": surfaces}}


class JobFiles(unittest.TestCase):
    """Jobs and the files beside them."""

    def write(self, *, job: dict) -> Path:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        path = Path(folder.name) / "job.json"
        path.write_text(json.dumps(job), encoding="utf-8")
        return path

    def test_every_missing_file_is_named(self) -> None:
        surface = {"positions": "p", "triangles": "t", "normals": None, "uvs": None, "parts": "k"}
        job = {"format": "mateval-blender-job/1", "textures": [{"file": "x.exr"}], "surfaces": [surface]}
        path = self.write(job=job)
        (path.parent / "t").touch()
        with self.assertRaises(JobError) as caught:
            read_job(path=path)
        for name, is_named in (("'x.exr'", True), ("'p'", True), ("'k'", True), ("'t'", False)):
            self.assertEqual(name in str(caught.exception), is_named, name)
        for name in ("x.exr", "p", "k"):
            (path.parent / name).touch()
        self.assertEqual(read_job(path=path), job)

    def test_another_format_is_refused(self) -> None:
        with self.assertRaises(JobError):
            read_job(path=self.write(job={"format": "mateval-blender-job/2"}))

    def test_numbers_are_little_endian(self) -> None:
        path = self.write(job={})
        path.write_bytes(struct.pack("<2f", 1.5, -2.0))
        self.assertEqual(list(read_numbers(path=path, code="f")), [1.5, -2.0])
        path.write_bytes(bytes([1, 2]))
        self.assertEqual(list(read_numbers(path=path, code="H")), [513])

    def test_a_result_is_replaced_whole(self) -> None:
        path = self.write(job={})
        for views in ([], ["input"]):
            write_result(folder=path.parent, result={"views": views})
            self.assertEqual(json.loads((path.parent / "result.json").read_text()), {"views": views})
        self.assertEqual(sorted(p.name for p in path.parent.iterdir()), ["job.json", "result.json"])

    def test_a_surface_is_in_one_group(self) -> None:
        outside = {"emission": {"type": "constant"}}
        self.assertEqual(lights_of_surfaces(job={"lights": [outside, area(surfaces=[4, 2])]}), {4: 1, 2: 1})
        with self.assertRaises(JobError):
            lights_of_surfaces(job={"lights": [area(surfaces=[1]), area(surfaces=[1])]})
        self.assertEqual(light_of_world(job={"lights": [area(surfaces=[1]), outside]}), 1)
        self.assertIsNone(light_of_world(job={"lights": [area(surfaces=[1])]}))
        with self.assertRaises(JobError):
            light_of_world(job={"lights": [outside, outside]})


class Baking(unittest.TestCase):
    """Jobs that bake a scene."""

    def test_a_job_is_checked_key_by_key(self) -> None:
        with tempfile.TemporaryDirectory() as name:
            path = Path(name) / "job.json"
            (Path(name) / "room.blend").touch()
            sizes = ("texels", "most_texels", "samples", "world_rows", "most_instances", "most_triangles")
            job = {"format": "mateval-bake/1", "blend": f"{name}/room.blend", "folder": name, "out": f"{name}/out"}
            job |= dict.fromkeys((*sizes, "threads", "most_baked_texels"), 64) | {"texel_m": None}
            path.write_text(json.dumps(job))
            self.assertEqual(read_baking_job(path=path), job)
            wrong = {"format": "mateval-bake/2", "blend": f"{name}/no.blend", "folder": f"{name}/no", "texels": 0}
            for key, value in {**wrong, "texel_m": -1.0, "samples": True, "threads": "1"}.items():
                path.write_text(json.dumps({**job, key: value}))
                with self.assertRaises(JobError, msg=key):
                    read_baking_job(path=path)

    def test_textures_grow_with_the_surface(self) -> None:
        job = {"texels": 512, "texel_m": 0.01, "most_texels": 1024}
        for area, covered, edge in ((1.0, 1.0, 128), (1.64, 1.0, 256), (1.0, 0.25, 256), (1e-6, 1.0, 16), (1e6, 1.0, 1024)):
            self.assertEqual(texture_edge(job=job, area=area, covered=covered), edge)
        # 1.28 m at 0.01 m are exactly 128 texels.
        self.assertEqual(texture_edge(job=job, area=1.28 * 1.28, covered=1.0), 128)
        self.assertEqual(texture_edge(job={**job, "texel_m": None}, area=1.0, covered=1.0), 512)

    def test_edges_are_halved_until_they_fit(self) -> None:
        self.assertEqual(halvings(edges=[128, 128], most=2 * 128 * 128), 0)
        self.assertEqual(halvings(edges=[128, 128], most=2 * 128 * 128 - 1), 1)
        self.assertEqual(halvings(edges=[1024], most=0), 6)

    def test_random_numbers_are_those_of_cycles(self) -> None:
        """Baked from Object Info in Blender 4.5.15."""
        for name, expected in (("first", 0.6102996), ("a", 0.5055515), ("zweites Ding ä", 0.4175181)):
            self.assertAlmostEqual(random_of_name(name=name), expected, places=6)
        self.assertEqual((random_of_id(number=-1), random_of_id(number=0)), (1.0, 0.0))

    def test_links_lead_out_of_a_folder(self) -> None:
        with tempfile.TemporaryDirectory() as name:
            inside = Path(name) / "scene"
            (inside / "maps").mkdir(parents=True)
            (inside / "link").symlink_to(Path(name))
            self.assertEqual(place_of(path=inside / "maps/../maps/wood.png", folder=inside), "maps/wood.png")
            for outside in (inside / "../wood.png", inside / "link/wood.png", Path(f"{inside}2/wood.png")):
                self.assertIsNone(place_of(path=outside, folder=inside))

    def test_findings_are_kept_once_and_sorted(self) -> None:
        findings = Findings()
        for place in ("b", "a", "b"):
            findings.note(code="omitted", place=place, message="coat", action="left it out")
        self.assertEqual([note["place"] for note in findings.notes], ["a", "b"])
        self.assertEqual(findings.faults, [])


class Lenses(unittest.TestCase):
    """Intrinsics in pixels as Blender's lens."""

    def test_a_centred_lens_has_no_shift(self) -> None:
        found = lens(intrinsics={"width": 200, "height": 100, "fx": 100.0, "fy": 100.0, "cx": 100.0, "cy": 50.0})
        self.assertAlmostEqual(found.angle_x, math.pi / 2)
        self.assertEqual(found[1:], (0.0, 0.0, 1.0))

    def test_a_principal_point_right_of_and_below_the_middle(self) -> None:
        """The picture then reaches further left and further up: Blender shifts it so."""
        found = lens(intrinsics={"width": 200, "height": 100, "fx": 100.0, "fy": 50.0, "cx": 110.0, "cy": 60.0})
        self.assertAlmostEqual(found.shift_x, -0.05)
        self.assertAlmostEqual(found.shift_y, 0.1)
        self.assertEqual(found.pixel_aspect_y, 2.0)


def ours(*, direction: tuple[float, ...]) -> tuple[float, float]:
    """format/truth.md, "Environment lookup": u to the right, v from the top."""
    x, y, z = direction
    return (math.atan2(x, -z) / (2.0 * math.pi) % 1.0, math.acos(y) / math.pi)


def blenders(*, direction: tuple[float, ...]) -> tuple[float, float]:
    """Cycles' `direction_to_equirectangular`, v turned to run from the top."""
    x, y, z = direction
    return (0.5 - math.atan2(y, x) / (2.0 * math.pi)) % 1.0, 0.5 - math.asin(z) / math.pi


class Environments(unittest.TestCase):
    """The one change of axes."""

    def test_both_look_up_the_same_place(self) -> None:
        # A quarter of a turn about y.
        rotation = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
        rows = blender_from_world(world_from_environment=rotation)
        for own in ((0.6, 0.64, 0.48), (-0.36, -0.48, 0.8), (0.8, 0.0, -0.6)):
            world = tuple(sum(rotation[r][c] * own[c] for c in range(3)) for r in range(3))
            there = tuple(sum(a * b for a, b in zip(row, world, strict=True)) for row in rows)
            for expected, found in zip(ours(direction=own), blenders(direction=there), strict=True):
                self.assertAlmostEqual(expected, found)
            self.assertGreater(abs(ours(direction=own)[0] - blenders(direction=world)[0]), 1e-3)


class Fresnel(unittest.TestCase):
    """Reflectances against published values."""

    def test_copper_at_normal_incidence(self) -> None:
        for eta, k, expected in ((0.2004, 3.9129, 0.9522), (0.9240, 2.4528, 0.6197), (1.1022, 2.1421, 0.5106)):
            self.assertAlmostEqual(reflectance(cosine=1.0, eta=eta, k=k), expected, places=3)

    def test_a_metal_without_a_real_index_reflects_everything(self) -> None:
        for k in (1.0, 0.3, 0.0):
            for cosine in (1.0, 0.5, EDGE_COSINE, 1e-9):
                self.assertAlmostEqual(reflectance(cosine=cosine, eta=0.0, k=k), 1.0)
            self.assertAlmostEqual(edge_tint(eta=0.0, k=k), 1.0)
        self.assertLess(reflectance(cosine=1.0, eta=0.1, k=0.3), 0.9)

    def test_everything_is_a_mirror_at_grazing_angles(self) -> None:
        self.assertAlmostEqual(reflectance(cosine=1e-9, eta=0.2, k=3.9), 1.0, places=6)
        self.assertAlmostEqual(fresnel(cosine=1e-9, eta=1.5), 1.0, places=6)

    def test_the_edge_tint_gives_the_metal_back_at_its_angle(self) -> None:
        f0 = reflectance(cosine=1.0, eta=1.1, k=2.1)
        schlick = f0 + (1.0 - f0) * (1.0 - EDGE_COSINE) ** 5
        self.assertAlmostEqual(edge_tint(eta=1.1, k=2.1) * schlick, reflectance(cosine=EDGE_COSINE, eta=1.1, k=2.1))

    def test_a_coat_of_glass(self) -> None:
        """Egan and Hilgeman: 0.0918 from outside and 0.5964 from inside, for an index of 1.5."""
        self.assertAlmostEqual(diffuse_reflectance(eta=1.5), 0.0918, places=3)
        self.assertAlmostEqual(diffuse_reflectance(eta=1 / 1.5), 0.5964, places=3)

    def test_a_white_base_loses_nothing_inside(self) -> None:
        for nonlinear in (False, True):
            scale, inner = base_under_coat(eta=1.5, nonlinear=nonlinear)
            self.assertAlmostEqual(scale / (1.0 - inner), 1.0, places=2)
        scale, inner = base_under_coat(eta=1.5, nonlinear=True)
        self.assertLess(0.5 * scale / (1.0 - 0.5 * inner), 0.3)


class Card:
    """A device as Cycles lists it."""

    def __init__(self, *, kind: str, number: int) -> None:
        self.type, self.id, self.name, self.use = kind, f"{kind}_{number}", f"{kind} card {number}", True


class Preferences:
    """The preferences of Cycles on a machine with these cards, of a build that knows no oneAPI."""

    def __init__(self, *, cards: dict[str, int]) -> None:
        self.devices = [Card(kind=kind, number=number) for kind, count in cards.items() for number in range(count)]
        self.devices.append(Card(kind="CPU", number=0))
        self.compute_device_type = "NONE"

    def get_devices_for_type(self, kind: str) -> list[Card]:
        if kind == "ONEAPI":
            raise TypeError("enum 'ONEAPI' not found")
        return [device for device in self.devices if device.type in (kind, "CPU")]


class Devices(unittest.TestCase):
    """The choice of the device that renders."""

    def chosen(self, *, cards: dict[str, int], wanted: str, required: str | None = None, turn: int = 0) -> tuple:
        """The device that was chosen, the devices that then render, and the remark."""
        preferences = Preferences(cards=cards)
        device, remark = choose(preferences=preferences, wanted=wanted, required=required, turn=turn)
        used = [listed.id for listed in preferences.devices if listed.use]
        self.assertEqual(preferences.compute_device_type, "NONE" if device is None else device["kind"].upper())
        return device and device["name"], used, remark

    def test_one_card_renders_alone_and_processes_take_turns(self) -> None:
        cards = {"CUDA": 2, "OPTIX": 2}
        self.assertEqual(self.chosen(cards=cards, wanted="auto"), ("OPTIX card 0", ["OPTIX_0"], None))
        self.assertEqual(self.chosen(cards=cards, wanted="auto", turn=3), ("OPTIX card 1", ["OPTIX_1"], None))
        self.assertEqual(self.chosen(cards=cards, wanted="cuda", turn=2), ("CUDA card 0", ["CUDA_0"], None))
        self.assertEqual(self.chosen(cards={"HIP": 1}, wanted="auto")[0], "HIP card 0")

    def test_the_processor_is_taken_with_a_message_where_there_is_no_card(self) -> None:
        device, _, remark = self.chosen(cards={}, wanted="auto")
        self.assertIsNone(device)
        self.assertIn("found no graphics card (devices found: optix 0, cuda 0, hip 0, oneapi 0, metal 0)", remark)
        self.assertEqual(self.chosen(cards={"CUDA": 1}, wanted="cpu")[::2], (None, None))

    def test_a_kind_that_is_absent_is_refused(self) -> None:
        for kind in KINDS:
            other = "CUDA" if kind != "CUDA" else "HIP"
            with self.assertRaises(JobError) as caught:
                self.chosen(cards={other: 1}, wanted=kind.lower())
            self.assertIn(f"no device of the kind {kind.lower()}", str(caught.exception))
            self.assertIn(f"{other.lower()} 1", str(caught.exception))
        with self.assertRaises(JobError):
            self.chosen(cards={"CUDA": 1}, wanted="gpu")

    def test_views_of_one_scene_come_from_one_kind(self) -> None:
        cards = {"CUDA": 1, "OPTIX": 1}
        self.assertEqual(self.chosen(cards=cards, wanted="auto", required="cuda")[0], "CUDA card 0")
        device, _, remark = self.chosen(cards=cards, wanted="auto", required="cpu")
        self.assertIsNone(device)
        self.assertIn("rendered on the processor", remark)
        with self.assertRaises(JobError) as caught:
            self.chosen(cards=cards, wanted="auto", required="hip")
        self.assertIn("other views of this scene", str(caught.exception))

    def test_the_driver_is_stated_where_the_system_does(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "version"
            self.assertIsNone(driver(kind="OPTIX", file=file))
            file.write_text("NVRM version: NVIDIA UNIX x86_64 Kernel Module  550.54.15  Tue Mar  5\n", encoding="utf-8")
            self.assertEqual(driver(kind="OPTIX", file=file), "550.54.15")
            self.assertIsNone(driver(kind="HIP", file=file))


if __name__ == "__main__":
    unittest.main()
