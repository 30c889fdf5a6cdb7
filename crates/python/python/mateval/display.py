"""What notebooks show of datasets, scenes, views, maps and results: HTML with pictures and numbers."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Optional

from . import _core
from .errors import Error, Withheld

if TYPE_CHECKING:
    from .dataset import Dataset
    from .reports import Result

#: The number of scenes of a dataset that are shown.
MOST_SCENES = 20

#: The numbers that a result shows first.
HEADLINES = (
    ("albedo.input.psnr", "Albedo PSNR, dB, input view"),
    ("albedo.novel.psnr", "Albedo PSNR, dB, novel views"),
    ("albedo.unobserved.psnr", "Albedo PSNR, dB, unobserved regions"),
    ("rgb_true.input.psnr", "RGB PSNR, dB, true light, input view"),
    ("rgb_true.novel.psnr", "RGB PSNR, dB, true light, novel views"),
    ("rgb_relit.novel.psnr", "RGB PSNR, dB, other lights, novel views"),
)


def picture(array: Any, caption: str) -> str:
    """A figure of bytes of shape (height, width, 3) or (height, width)."""
    data = base64.b64encode(_core.png(array)).decode()
    # Texels of small maps stay visible, and large maps fit beside each other.
    style = "max-height:240px;min-width:96px;image-rendering:pixelated"
    shown = f'<img style="{style}" alt="{html.escape(caption)}" src="data:image/png;base64,{data}">'
    return f'<figure style="display:inline-block;margin:0 8px 8px 0">{shown}<figcaption>{html.escape(caption)}</figcaption></figure>'


class Pictures:
    """Pictures side by side, by their captions, as the last line of a notebook's cell: uint8 as it is, floats as linear
    colours or, of shape (height, width), as numbers of 0 to 1, and booleans as black and white. Colours are RGB.

    >>> view = mateval.open("DATASET")["room"].input
    >>> mateval.display.Pictures({"depth": view.depth / view.depth.max(), "normal": view.normal / 2 + 0.5})
    """

    def __init__(self, pictures: Mapping[str, Any]) -> None:
        if not isinstance(pictures, Mapping):
            raise TypeError(f"pictures: expected a dictionary by captions, found {type(pictures).__name__}")
        self.pictures = dict(pictures)

    def _repr_html_(self) -> str:
        return "".join(picture(_bytes(caption, array), caption) for caption, array in self.pictures.items())


def _bytes(caption: str, array: Any) -> Any:
    import numpy as np  # `import mateval` does without.

    from .tensors import as_array

    array = as_array(caption, array)
    if array.dtype == np.uint8:
        return array
    if array.dtype != np.bool_ and not np.issubdtype(array.dtype, np.floating):
        raise ValueError(f"{caption}: expected uint8, floats or booleans, found {array.dtype}; scale it to 0 to 1")
    return _core.srgb_bytes(array) if array.ndim == 3 else (np.clip(array, 0, 1) * 255 + 0.5).astype(np.uint8)


def view(view: _core.View) -> str:
    """The photo of the input view; of other views, the truth's albedo, if the dataset holds it."""
    if view.id == "input":
        return picture(view.preview, f"{view.id}: the photo")
    try:
        return picture(_core.srgb_bytes(view.truth.albedo), f"{view.id}: the true albedo")
    except Exception as reason:
        return f"<p>{html.escape(repr(view))}: {html.escape(str(reason))}</p>"


def dataset(dataset: Dataset) -> str:
    """A table of the first scenes: their views, and what distinguishes them."""
    ids = list(dataset)
    rows = "".join(_row("td", _scene_cells(dataset, id)) for id in ids[:MOST_SCENES])
    left = [f"{len(ids) - MOST_SCENES} of the scenes"] if len(ids) > MOST_SCENES else []
    if dataset.absent:
        left.append(f"{len(dataset.absent)} that {'was' if len(dataset.absent) == 1 else 'were'} not downloaded")
    renderer = f"; photos by {dataset.photo_renderer}" if dataset.photo_renderer else ""
    text = f"version {dataset.version}, {len(ids)} {'scene' if len(ids) == 1 else 'scenes'}{renderer}"
    head = f"<p><b>{html.escape(dataset.name)}</b>: {html.escape(text)}</p>"
    table = f"<table>{_row('th', ('Scene', 'House', 'Views', 'Resolution', 'Marks'))}{rows}</table>"
    return head + table + (f"<p>not shown: {html.escape('; '.join(left))}</p>" if left else "")


def _scene_cells(dataset: Dataset, id: str) -> tuple[str, ...]:
    scene = dataset[id]
    width, height = scene.input.camera.size
    marks = []
    if id in dataset.twins:
        marks.append("twin of {} in {}".format(*dataset.twins[id]))
    if scene.photo is not None:
        marks.append("photo from elsewhere")
    if scene.redressed:
        marks.append("redressed")
    try:
        _ = scene.input.truth
    except Withheld:
        marks.append("truth withheld")
    except Error:
        marks.append("captured, true materials unknown")
    return id, scene.house, str(len(scene.views)), f"{width}x{height}", ", ".join(marks)


def _row(tag: str, cells: tuple[str, ...]) -> str:
    return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"


def scene(scene: _core.Scene) -> str:
    """The photo with what the scene holds."""
    instances = scene.instances
    with_maps = sum(instance.atlas_size is not None for instance in instances.values())
    text = f"{len(instances)} instances, {with_maps} of them with maps; {len(scene.views)} views; house {scene.house}"
    return f"<p><b>{html.escape(scene.id)}</b>: {html.escape(text)}</p>{view(scene.input)}"


def maps(maps: _core.Maps) -> str:
    """The maps side by side."""
    given: tuple[tuple[str, Optional[Any]], ...] = (
        ("base_color", maps.base_color),
        ("roughness", maps.roughness),
        ("metallic", maps.metallic),
    )
    return "".join(picture(array, name) for name, array in given if array is not None)


def result(result: Result) -> str:
    """The headline numbers, and which maps have none."""
    rows = "".join(
        f"<tr><td>{html.escape(title)}</td><td style='text-align:right'>{result[key]:.2f}</td></tr>"
        for key, title in HEADLINES
        if key in result
    )
    absent = f"<p>not predicted: {html.escape(', '.join(result.not_predicted))}</p>" if result.not_predicted else ""
    head = f"<p><b>{html.escape(result.method)}</b>, means over {len(result.scenes)} scenes</p>"
    return f"{head}<table>{rows}</table>{absent}"
