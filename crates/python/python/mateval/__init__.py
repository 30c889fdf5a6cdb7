"""MatEval: a benchmark for recovering the materials of an indoor room from one photo.

>>> import mateval
>>> dataset = mateval.open("DATASET")
>>> scene = dataset["living"]
>>> maps = mateval.lift(scene, base_color=my_estimate(scene.input.rgb))
>>> with mateval.Submission("OUT", dataset, method="mine") as submission:
...     for instance, found in maps.items():
...         submission.write(scene.id, instance, base_color=found.base_color)
>>> print(mateval.lint("OUT", dataset))
>>> mateval.score("OUT", dataset)["albedo.novel.psnr"]

Arrays are NumPy's, in rows from the top left. Colours are linear Rec. 709 where they are floats and sRGB where they are
integers; channels are in the order RGB, not BGR as OpenCV reads and writes them. Lengths are metres, +Y is up.
"""

from . import _core, metrics, torch
from ._core import Camera, Delit, Instance, Maps, Mesh, Part, Scene, Submission, Truth, View, delight, lift, procedural
from .by_id import ById
from .dataset import Dataset, open
from .errors import Error, UnknownId, Withheld, WrongShape
from .reports import LintReport, Result, lint, rank, score, tables

__version__ = _core.__version__

__all__ = [
    "ById",
    "Camera",
    "Dataset",
    "Delit",
    "Error",
    "Instance",
    "LintReport",
    "Maps",
    "Mesh",
    "Part",
    "Result",
    "Scene",
    "Submission",
    "Truth",
    "UnknownId",
    "View",
    "Withheld",
    "WrongShape",
    "delight",
    "lift",
    "lint",
    "metrics",
    "open",
    "procedural",
    "rank",
    "score",
    "tables",
    "torch",
]
