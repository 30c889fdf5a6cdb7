"""Tests that the site is small and usable by everyone: axe-core finds minor faults alone; pictures need no script."""

import os
import tempfile
import unittest
from contextlib import closing
from pathlib import Path

from chromium import Page
from sites import make_curves, make_few, make_large, make_small, sample

PICTURES = os.environ.get("MATEVAL_TEST_PICTURES")
#: The packages that tools/build_viewer.sh installs.
NODE_MODULES = Path(os.environ["MATEVAL_NODE_MODULES"])
#: The most bytes of the first page's HTML, styles and scripts.
MOST_BYTES = 120_000

RUN_AXE = """axe.run(document, { preload: false, resultTypes: ["violations"] }).then((found) => ({
  checked: found.passes.length,
  bad: found.violations.filter((one) => one.impact !== "minor")
    .map((one) => `${one.id}: ${one.nodes.map((node) => node.target).join(", ")}`),
}))"""


def setUpModule() -> None:
    global temporary, small, few, curves, room
    temporary = tempfile.TemporaryDirectory()
    folders = [Path(temporary.name) / name for name in ["small", "few", "curves"]]
    for folder in folders:
        folder.mkdir()
    small, few, curves, room = make_small(folders[0]), make_few(folders[1]), make_curves(folders[2]), sample() / "site"


def tearDownModule() -> None:
    temporary.cleanup()


def axe(page: Page) -> dict:
    page.run((NODE_MODULES / "axe-core/axe.min.js").read_text())
    return page.run(RUN_AXE)


class TestAxe(unittest.TestCase):
    def pages(self) -> list[Path]:
        """A page of every kind, also without pictures, intervals or errata."""
        single = [page for site in [small, room] for page in sorted(site.glob("*.html"))]
        many = [small / "methods/truetexture.html", small / "scenes/room-002.html", small / "scenes/room-009.html",
                few / "index.html", few / "errata.html", few / "robustness.html", few / "methods/one.html",
                curves / "constancy.html", curves / "perturbed.html", curves / "wide_views.html",
                room / "methods/grey.html", room / "scenes/room.html", room / "rooms/room.html"]
        return single + many

    def test_only_minor_findings_on_any_kind_of_page(self) -> None:
        checked = 0
        for width, height in [(1400, 900), (400, 800)]:
            for dark in [False, True]:
                with closing(Page(width=width, height=height, dark=dark)) as page:
                    for path in self.pages():
                        page.open(path.as_uri())
                        if path.parent.name == "rooms":
                            page.wait_for("document.getElementById('room').dataset.shown")
                        found = axe(page)
                        self.assertGreater(found["checked"], 10, path)
                        self.assertEqual(found["bad"], [], f"{path} at {width}, dark {dark}")
                        wide = page.run("document.documentElement.scrollWidth - document.documentElement.clientWidth")
                        self.assertEqual(wide, 0, f"{path} at {width}")
                        checked += 1
                        if PICTURES:
                            page.picture(f"{PICTURES}/axe-{checked}.png", whole=True)
                    self.assertEqual(page.faults, [])
        self.assertEqual(checked, 4 * 26)

    def test_planted_faults_are_found(self) -> None:
        """The twin."""
        page = Page(width=1400, height=900, dark=False)
        self.addCleanup(page.close)
        page.open((small / "index.html").as_uri())
        page.run("""document.querySelector('.slider img').removeAttribute('alt');
                    document.querySelector('.slider input').removeAttribute('aria-label');
                    document.querySelector('h1').style.color = '#ddd';""")
        bad = " ".join(axe(page)["bad"])
        for rule in ["image-alt", "label", "color-contrast"]:
            self.assertIn(f"{rule}:", bad)


class TestSize(unittest.TestCase):
    def first_page(self, site: Path) -> int:
        """The bytes of the files that the first page has loaded, besides pictures."""
        page = Page(width=1400, height=900, dark=False)
        with closing(page):
            page.open((site / "index.html").as_uri())
            page.run("new Promise((done) => setTimeout(done, 300))")
            read = [Path(file) for file in page.files if not file.endswith(".png")]
        self.assertEqual({file.suffix for file in read}, {".html", ".css", ".js"})
        self.assertNotIn("room.min.js", [file.name for file in read])
        return sum(file.stat().st_size for file in read)

    def test_the_first_page_is_small(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            large = make_large(Path(folder))
            for site in [small, few, room, large]:
                size = self.first_page(site)
                print(f"first page of {site}: {size} bytes before pictures", flush=True)
                self.assertLess(size, MOST_BYTES)
            # The twin: with every column in it, the page of fifty methods would be too large.
            self.assertGreater((large / "columns.js").stat().st_size, MOST_BYTES)


class TestWithoutScripts(unittest.TestCase):
    def test_prediction_and_truth_stand_side_by_side(self) -> None:
        page = Page(width=1400, height=900, dark=False)
        self.addCleanup(page.close)
        boxes = """(() => { const slider = document.querySelector('.slider');
          return ['.prediction img', '.truth img', 'input'].map((part) => slider.querySelector(part).getBoundingClientRect().toJSON()); })()"""
        for name in ["index.html", "methods/copya.html", "scenes/room-002.html"]:
            page.send("Emulation.setScriptExecutionDisabled", value=True)
            page.open((small / name).as_uri())
            prediction, truth, slider = page.run(boxes)
            self.assertLessEqual(prediction["right"], truth["left"], name)
            self.assertGreater(min(prediction["width"], truth["width"]), 100, name)
            self.assertEqual(slider["width"], 0, name)
            # The twin: with scripts they lie over each other.
            page.send("Emulation.setScriptExecutionDisabled", value=False)
            page.open((small / name).as_uri())
            prediction, truth, slider = page.run(boxes)
            self.assertEqual((prediction["left"], slider["width"]), (truth["left"], prediction["width"]), name)


class TestFewHouses(unittest.TestCase):
    def test_it_is_said_once_and_no_empty_table_is_left(self) -> None:
        text = (few / "index.html").read_text()
        self.assertEqual(text.count("houses, so none are shown"), 1)
        for word in ["rank ", "Pairs of methods", 'class="rank"', "Intervals</label>"]:
            self.assertNotIn(word, text)
            # The twin.
            self.assertIn(word, (small / "index.html").read_text())
        self.assertFalse((few / "wins").exists())
        self.assertNotIn("too few houses", (few / "methods/one.html").read_text())

    def test_the_board_still_sorts_and_filters(self) -> None:
        page = Page(width=1400, height=900, dark=False)
        self.addCleanup(page.close)
        page.open((few / "index.html").as_uri())
        names = "[...document.querySelectorAll('#board tbody tr:not([hidden]) th a')].map((a) => a.textContent)"
        self.assertEqual(page.run(names), ["one", "two"])
        page.run("document.querySelector('#board th[data-key=name] button').click()")
        page.run("document.querySelector('#board th[data-key=name] button').click()")
        self.assertEqual(page.run(names), ["two", "one"])
        page.run("document.querySelector('input[name=metric][value=ssim]').click()")
        page.wait_for("document.querySelector('#board th[data-key=\"albedo.novel.ssim\"]:not([hidden])')")
        cells = page.run("[...document.querySelectorAll('#board tr')].map((row) => [...row.cells].filter((c) => !c.hidden).length)")
        self.assertEqual(len(set(cells)), 1)
        self.assertEqual(page.faults, [])


if __name__ == "__main__":
    unittest.main()
