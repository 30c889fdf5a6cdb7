"""Tests the leaderboard's site in headless Chromium: at two widths, light and dark, by mouse and by keyboard.

`tools/test_site.sh` installs the browser, builds `mateval` and runs this with the other tests of this folder. With
MATEVAL_TEST_PICTURES=DIR it writes screenshots there.
"""

import csv
import json
import os
import subprocess
import tempfile
import time
import unittest
from contextlib import closing
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from chromium import Page
from sites import EVIL, MATEVAL, METHODS, SCENES, make_large, make_small

PICTURES = os.environ.get("MATEVAL_TEST_PICTURES")

def setUpModule() -> None:
    global temporary, small
    temporary = tempfile.TemporaryDirectory()
    small = make_small(Path(temporary.name))


def tearDownModule() -> None:
    temporary.cleanup()


class Links(HTMLParser):
    """The addresses that a page refers to."""

    def __init__(self, text: str):
        super().__init__()
        self.found: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.found += [value for name, value in attributes if name in ("href", "src") and value]


def broken_links(site: Path) -> tuple[int, list[str]]:
    """Returns the number of links, and the links whose target does not exist."""
    seen, broken = 0, []
    for page in site.rglob("*.html"):
        for link in Links(page.read_text()).found:
            parts = urlsplit(link)
            if parts.scheme:
                assert parts.scheme in ("https", "data"), link
                continue
            seen += 1
            target = page if not parts.path else page.parent / unquote(parts.path)
            if not target.is_file() or (parts.fragment and f'id="{parts.fragment}"' not in target.read_text()):
                broken.append(f"{page.relative_to(site)}: {link}")
    return seen, broken


#: Finds text whose contrast is too low to read (WCAG 2: 4.5 to 1), and boxes wider than the window.
LOOK = """(() => {
  const channel = (v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  const parse = (color) => {
    const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
    canvas.fillStyle = color; canvas.fillRect(0, 0, 1, 1);
    return [...canvas.getImageData(0, 0, 1, 1).data];
  };
  const light = (c) => 0.2126 * channel(c[0]) + 0.7152 * channel(c[1]) + 0.0722 * channel(c[2]);
  const behind = (node) => {
    for (; node; node = node.parentElement) {
      const color = parse(getComputedStyle(node).backgroundColor);
      if (color[3] > 250) return color;
    }
    return [255, 255, 255, 255];
  };
  const faint = new Set();
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  let seen = 0;
  while (walker.nextNode()) {
    const node = walker.currentNode.parentElement;
    if (!walker.currentNode.textContent.trim() || !node.checkVisibility() || node.closest("script, .unseen")) continue;
    seen += 1;
    const [text, back] = [light(parse(getComputedStyle(node).color)), light(behind(node))];
    if ((Math.max(text, back) + 0.05) / (Math.min(text, back) + 0.05) < 4.5) faint.add(node.tagName + "." + node.className);
  }
  return { seen, faint: [...faint], wide: document.documentElement.scrollWidth - document.documentElement.clientWidth };
})()"""


class TestLooks(unittest.TestCase):
    PAGES = ["index.html", "scenes.html", "protocol.html", "errata.html", "robustness.html", "contamination.html", "votes.html",
             "methods/copya.html", "scenes/room-002.html"]

    def test_every_page_at_two_widths_light_and_dark(self) -> None:
        looked_at = 0
        for width, height in [(1400, 900), (400, 800)]:
            for dark in [False, True]:
                with closing(Page(width=width, height=height, dark=dark)) as page:
                    for name in self.PAGES:
                        page.open((small / name).as_uri())
                        look = page.run(LOOK)
                        self.assertGreater(look["seen"], 10, name)
                        self.assertEqual((look["faint"], look["wide"]), ([], 0), f"{name} at {width}, dark {dark}")
                        looked_at += 1
                        if PICTURES:
                            shade = "dark" if dark else "light"
                            page.picture(f"{PICTURES}/{name.replace('/', '-')}-{width}-{shade}.png", whole=True)
                    self.assertEqual(page.faults, [])
        self.assertEqual(looked_at, 36)

    def test_the_ceiling_has_the_columns_of_the_board(self) -> None:
        """As many cells as heads, the same ones hidden after a choice, and never sorted among the methods."""
        page = Page(width=1400, height=900, dark=False)
        self.addCleanup(page.close)
        page.open((small / "index.html").as_uri())
        shown = """(() => {
          const hidden = (row) => [...row.cells].map((cell) => cell.hidden);
          return { head: hidden(table.tHead.rows[0]), foot: hidden(table.tFoot.rows[0]), text: table.tFoot.innerText };
        })()"""
        first = page.run(shown)
        self.assertEqual(first["head"], first["foot"])
        self.assertIn("ceiling: the truth itself", first["text"])
        page.run("document.querySelector('input[name=metric][value=ssim]').click()")
        page.wait_for("location.hash.includes('ssim')")
        page.run("document.querySelector('thead th:not([hidden]) button').click()")
        second = page.run(shown)
        self.assertEqual(second["head"], second["foot"])
        self.assertNotEqual(first["head"], second["head"])
        self.assertEqual(page.run("table.tBodies[0].innerText.includes('ceiling')"), False)

    def test_the_check_of_the_tracer_is_stated(self) -> None:
        self.assertIn("Tracer and Blender agree in 65 of 65 informative checks.", (small / "index.html").read_text())

    def test_maps_that_are_not_predicted_have_a_dash(self) -> None:
        """In the columns that are loaded after a choice."""
        page = Page(width=1400, height=900, dark=False)
        self.addCleanup(page.close)
        page.open((small / "index.html").as_uri())
        for choice in ["[name=picture][value=roughness]", "[name=metric][value=mae]"]:
            page.run(f"document.querySelector('input{choice}').click()")
            page.wait_for("location.hash.includes('sort=')")
        cells = """(() => {
          const at = headOf("roughness.novel.mae").cellIndex;
          return Object.fromEntries([...table.tBodies[0].rows].map((row) => [row.dataset.id, row.cells[at].innerText]));
        })()"""
        found = page.run(cells)
        self.assertEqual(found["copyb"], "–")
        self.assertRegex(found["copya"], r"^0\.\d{4}")

    def test_faults_of_appearance_are_found(self) -> None:
        """The twin: text of low contrast, a wide box, a script that fails, and a picture from another site."""
        page = Page(width=400, height=800, dark=True)
        self.addCleanup(page.close)
        page.open((small / "index.html").as_uri())
        page.run("""document.querySelector('h1').style.color = 'var(--page)';
                    document.querySelector('h1').style.width = '500px';
                    setTimeout(() => { throw new Error('planted'); });""")
        look = page.run(LOOK)
        self.assertIn("H1.", look["faint"])
        self.assertGreater(look["wide"], 0)
        page.run("new Promise((done) => setTimeout(done, 50))")
        self.assertIn("planted", " ".join(page.faults))


class TestVotes(unittest.TestCase):
    def test_votes_by_keys_and_buttons_are_saved_and_counted(self) -> None:
        page = Page(width=1400, height=900, dark=False)
        self.addCleanup(page.close)
        out = tempfile.TemporaryDirectory()
        self.addCleanup(out.cleanup)
        page.send("Page.setDownloadBehavior", behavior="allow", downloadPath=out.name)
        page.open((small / "votes.html").as_uri())
        # The second vote is taken back.
        press = "document.body.dispatchEvent(new KeyboardEvent('keydown', { key: '%s', bubbles: true }))"
        click = "document.querySelector('button[value=%s]').click()"
        for act in [press % "ArrowLeft", press % "ArrowDown", press % "Backspace", press % "ArrowRight", click % "equal"]:
            page.wait_for("since !== null")
            page.run(act)
        page.run("form.elements.voter.value = 'A. B.'")
        page.run(click % "save")
        page.wait_for("saved === 3")
        end = time.monotonic() + 10
        while not list(Path(out.name).glob("votes-*.json")) and time.monotonic() < end:
            time.sleep(0.05)
        (path,) = Path(out.name).glob("votes-*.json")
        file = json.loads(path.read_text())
        self.assertEqual(([vote["choice"] for vote in file["votes"]], file["voter"]), (["left", "right", "equal"], "A. B."))
        self.assertEqual(page.faults, [])
        results = [small.parent / f"{method[:10]}.json" for _, method, *_ in METHODS]
        counted = subprocess.run([MATEVAL, "eval", "votes", path, "--result", *results, "--format", "json"],
                                 capture_output=True, text=True)
        self.assertEqual(counted.returncode, 0, counted.stderr)
        self.assertEqual(json.loads(counted.stdout)["votes"], 3)


class TestLinks(unittest.TestCase):
    def test_all_targets_exist(self) -> None:
        seen, broken = broken_links(small)
        self.assertGreater(seen, 500)
        self.assertEqual(broken, [])
        # The twin.
        gone = small / "methods/grey.html"
        kept = gone.read_text()
        gone.unlink()
        self.assertTrue(any("grey.html" in link for link in broken_links(small)[1]))
        gone.write_text(kept)

    def test_downloads_hold_the_numbers(self) -> None:
        board = json.loads((small / "downloads/leaderboard.json").read_text())
        self.assertEqual([m["verified"] for m in board["methods"]], ["confirmed", "claimed", "claimed", "claimed", "claimed", "refuted"])
        key = board["ranking"]["keys"]["albedo.novel.psnr"]
        places = {standing["method"]: standing for standing in key["standings"]}
        self.assertEqual(places["copya"]["rank"], places["copyb"]["rank"])
        self.assertEqual(places["truetexture"]["rank"], {"best": 1, "worst": 1})
        self.assertEqual(places["grey"]["rank"], {"best": 6, "worst": 6})
        with open(small / "downloads/leaderboard.csv", newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["key"] == "albedo.novel.psnr"]
        self.assertEqual([float(row["value"]) for row in rows], [places[row["id"]]["value"] for row in rows])
        self.assertEqual(rows[4]["method"], EVIL)
        self.assertIn("\\begin{tabular}", (small / "downloads/tables.tex").read_text())
        with open(small / "methods/grey.csv", newline="") as file:
            self.assertEqual([row["scene"] for row in csv.DictReader(file)], SCENES)

    def test_scripts_in_results_do_not_run(self) -> None:
        for page in small.rglob("*.html"):
            text = page.read_text()
            self.assertNotIn(EVIL, text, page)
            self.assertNotIn('href="javascript', text, page)
        self.assertIn("&lt;script&gt;", (small / "index.html").read_text())


class TestBoard(unittest.TestCase):
    def setUp(self) -> None:
        self.page = Page(width=1400, height=900, dark=False)
        self.addCleanup(self.page.close)
        self.page.open((small / "index.html").as_uri())

    def tearDown(self) -> None:
        self.assertEqual(self.page.faults, [])

    def names(self) -> list[str]:
        return self.page.run("[...document.querySelectorAll('#board tbody tr:not([hidden]) th a')].map((a) => a.textContent)")

    def heads(self) -> list[str]:
        """The keys of the columns of scores."""
        return self.page.run("[...document.querySelectorAll('#board th[data-metric]:not([hidden])')].map((th) => th.dataset.key)")

    def press(self, key: str) -> None:
        self.page.run(f"document.querySelector('#board th[data-key=\"{key}\"] button').click()")

    def tick(self, name: str, value: str) -> None:
        self.page.run(f"document.querySelector('#controls input[name={name}][value=\"{value}\"]').click()")
        # The first choice loads the columns that the page does not hold; then the address holds the choices.
        self.page.wait_for("location.hash.includes('sort=')")

    def test_sorts(self) -> None:
        values = "[...document.querySelectorAll('#board tbody tr')].map((row) => Number(row.cells[%d].dataset.v))"
        at = self.page.run("document.querySelector('#board th[data-key=\"albedo.novel.psnr\"]').cellIndex")
        best_first = self.page.run(values % at)
        self.assertEqual(best_first, sorted(best_first, reverse=True))
        self.press("albedo.novel.psnr")
        self.assertEqual(self.page.run(values % at), sorted(best_first))
        self.assertEqual(self.names()[0], "grey")
        self.assertEqual(self.page.run("document.querySelector('[aria-sort]').dataset.key"), "albedo.novel.psnr")
        self.assertIn("Albedo, novel views PSNR", self.page.run("document.getElementById('status').textContent"))
        # Less is better: the first press sorts the smallest first. Methods without a value are always last.
        for expected in [["A method", "TrueTexture", "CopyA"], ["CopyA", "TrueTexture", "A method"]]:
            self.press("cost")
            self.assertEqual([name[: len(word)] for name, word in zip(self.names(), expected)], expected)
        self.press("name")
        self.assertEqual(self.names()[-2:], ["grey", "TrueTexture"])

    def test_sorts_by_keyboard(self) -> None:
        self.page.run("document.querySelector('#board th[data-key=\"name\"] button').focus()")
        self.page.key("Tab")
        self.assertEqual(self.page.run("document.activeElement.closest('th').dataset.key"), "albedo.input.psnr")
        self.page.key("Enter")
        self.assertEqual(self.page.run("document.querySelector('[aria-sort]').dataset.key"), "albedo.input.psnr")

    def test_filters_columns_and_rows(self) -> None:
        self.assertEqual(self.heads(), ["albedo.input.psnr", "albedo.novel.psnr", "albedo_aligned.novel.psnr",
                                        "rgb_true.input.psnr", "rgb_true.novel.psnr"])
        self.tick("metric", "ssim")
        self.tick("picture", "rgb_true")
        self.tick("picture", "albedo_aligned")
        self.tick("views", "input")
        self.assertEqual(self.heads(), ["albedo.novel.psnr", "albedo.novel.ssim"])
        # Cells are hidden together with their heads.
        hidden = "[...document.querySelectorAll('#board tr')].map((row) => [...row.cells].filter((c) => !c.hidden).length)"
        self.assertEqual(len(set(self.page.run(hidden))), 1)
        self.tick("verified", "1")
        self.assertEqual(self.names(), ["TrueTexture"])
        self.tick("verified", "1")
        self.page.run("""(() => { const box = document.querySelector('[name=name]'); box.value = 'copy';
                         box.dispatchEvent(new Event('input', { bubbles: true })); })()""")
        self.assertEqual(self.names(), ["CopyA", "CopyB"])
        self.assertIn("2 of 6 methods", self.page.run("document.getElementById('status').textContent"))
        # The address holds the complete state.
        address = self.page.run("location.href")
        self.page.open(address)
        self.page.wait_for("document.querySelector('#board th[data-key=\"albedo.novel.ssim\"]')")
        self.assertEqual((self.names(), self.heads()), (["CopyA", "CopyB"], ["albedo.novel.psnr", "albedo.novel.ssim"]))

    def test_intervals_and_ranks_are_shown(self) -> None:
        row = "document.querySelector('#board a[href=\"methods/copya.html\"]').closest('tr')"
        self.assertEqual(self.page.run(f"{row}.cells[0].textContent"), "2–3")
        cell = self.page.run(f"[...{row}.cells].find((c) => !c.hidden && c.dataset.l).innerText")
        self.assertRegex(cell, r"^\d+\.\d\d\n\d+\.\d\d – \d+\.\d\d\nrank \d")
        self.assertEqual(self.page.run("document.querySelectorAll('#board td svg').length"), 6)
        marks = self.page.run("[...document.querySelectorAll('#board .mark')].map((m) => m.textContent.trim())")
        self.assertEqual(marks, ["✓ verified", "✗ refuted"])

    def test_who_beats_whom(self) -> None:
        self.page.run("new Promise((done) => setTimeout(done, 300))")
        table = self.page.run("[...document.querySelectorAll('.wins tbody tr')].map((r) => [...r.cells].map((c) => c.textContent))")
        self.assertEqual(len(table), 6)
        self.assertEqual(table[0][1:], ["", "100", "100", "100", "100", "100"])
        self.assertEqual((table[1][3], table[2][2]), ("50", "50"))
        self.assertEqual(self.page.run("document.querySelectorAll('.wins tr:nth-child(2) .sure').length"), 4)

    def test_everything_has_a_name_for_screen_readers(self) -> None:
        for name in ["index.html", "scenes/room-000.html", "methods/grey.html"]:
            self.page.open((small / name).as_uri())
            nodes = self.page.send("Accessibility.getFullAXTree")["nodes"]
            roles = {"button", "checkbox", "radio", "slider", "combobox", "link", "searchbox", "image", "region"}
            exposed = [node for node in nodes if node.get("role", {}).get("value") in roles and not node.get("ignored")]
            nameless = [node for node in exposed if not node.get("name", {}).get("value")]
            self.assertGreater(len(exposed), 20)
            self.assertEqual(nameless, [], name)


class TestScene(unittest.TestCase):
    def setUp(self) -> None:
        self.page = Page(width=1400, height=900, dark=True)
        self.addCleanup(self.page.close)
        self.page.open((small / "scenes/room-002.html").as_uri())

    def tearDown(self) -> None:
        self.assertEqual(self.page.faults, [])

    def source(self, part: str, kind: str = "albedo") -> str:
        """The picture of a part, as in `.truth`, of the slider of a kind."""
        return self.page.run(f"document.querySelector('[data-kind={kind}] {part} img').src").split("/pictures/")[1]

    def shown(self) -> list[str]:
        """The kinds of pictures whose sliders are shown."""
        return self.page.run("[...document.querySelectorAll('#compare .kind:not([hidden])')].map((part) => part.dataset.kind)")

    def choose(self, name: str, value: str) -> None:
        self.page.run(f"""(() => {{ const box = document.querySelector('#compare-form [name={name}]'); box.value = '{value}';
                          box.dispatchEvent(new Event('input', {{ bubbles: true }})); }})()""")

    def test_the_slider_moves(self) -> None:
        sliders = "[...document.querySelectorAll('.slider')]"
        at = lambda: self.page.run(f"getComputedStyle({sliders}[0]).getPropertyValue('--at')")
        self.assertEqual(at(), "50%")
        self.page.run("document.querySelector('.slider input').focus()")
        self.page.key("ArrowRight")
        self.assertEqual(at(), "51%")
        box = self.page.run("document.querySelector('.slider').getBoundingClientRect().toJSON()")
        middle = box["y"] + box["height"] / 2
        self.page.drag((box["x"] + 0.51 * box["width"], middle), (box["x"] + 0.2 * box["width"], middle))
        self.assertLess(abs(float(at().strip("%")) - 20), 3)
        # All sliders of a page move together.
        places = self.page.run(f"{sliders}.map((slider) => slider.style.getPropertyValue('--at'))")
        self.assertEqual((len(places), set(places)), (2, {at()}))
        # The truth is shown to the left of the line: the rest of it is clipped.
        clip = self.page.run("getComputedStyle(document.querySelector('.slider .truth')).clipPath")
        self.assertRegex(clip, r"^inset\(0px (7[7-9]|8[0-3])")

    def test_pictures_are_those_chosen(self) -> None:
        self.assertEqual(self.source(".truth"), "_truth/room-002/input/albedo.png")
        # Light is shown beside albedo.
        self.assertEqual(self.shown(), ["albedo", "rgb_true"])
        self.choose("method", "grey")
        self.choose("view", "up_left")
        for kind in ["albedo", "rgb_true"]:
            self.assertEqual(self.source(".prediction", kind), f"grey/room-002/up_left/{kind}.png")
            self.assertEqual(self.source(".truth", kind), f"_truth/room-002/up_left/{kind}.png")
        self.assertEqual(self.source(".heat"), "grey/room-002/up_left/albedo-error.png")
        # Light has no heat map here.
        hidden = "[...document.querySelectorAll('.heat')].map((heat) => heat.hidden)"
        self.assertEqual(self.page.run(hidden), [False, True])
        self.page.run("document.querySelector('#compare-form [value=albedo]').click()")
        self.assertEqual(self.shown(), ["rgb_true"])
        # A click on a small picture selects it.
        self.page.run("document.querySelector('.pick[data-method=copya][data-view=input]').click()")
        self.assertEqual(self.source(".prediction", "rgb_true"), "copya/room-002/input/rgb_true.png")
        self.assertEqual(self.page.run("document.querySelectorAll('.pick[aria-pressed=true]').length"), 1)

    def test_the_gallery_shows_all_views_of_all_methods(self) -> None:
        count = "document.querySelectorAll('.gallery tbody tr').length * document.querySelectorAll('.gallery tbody tr:first-child td').length"
        self.assertEqual(self.page.run(count), 7 * 5)
        self.page.run("document.querySelector('#kinds [value=albedo-error]').click()")
        image = self.page.run("document.querySelector('.pick[data-method=grey][data-view=input] img').src")
        self.assertTrue(image.endswith("grey/room-002/input/albedo-error.png"), image)


class TestLarge(unittest.TestCase):
    def test_fifty_methods_on_184_scenes(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            site = make_large(Path(folder))
            page = Page(width=1400, height=900, dark=False)
            self.addCleanup(page.close)
            seconds = page.open((site / "index.html").as_uri())
            page.run("document.querySelector('input[name=metric][value=ssim]').click()")
            page.wait_for("location.hash.includes('ssim')")
            rows, columns = page.run("[document.querySelectorAll('#board tbody tr').length, document.querySelectorAll('#board th[data-metric]').length]")
            self.assertEqual(rows, 50)
            self.assertGreater(columns, 40)
            self.assertLess(seconds, 2.0)
            sorting = page.run("""(() => { const start = performance.now();
                document.querySelector('#board th[data-key="albedo.input.psnr"] button').click();
                document.body.offsetHeight; return performance.now() - start; })()""")
            self.assertLess(sorting, 1000)
            print(f"50 x 184: opened in {seconds:.2f} s, sorted in {sorting:.0f} ms, {columns} columns", flush=True)
            if PICTURES:
                page.picture(f"{PICTURES}/large.png")
            # Pictures far below are not loaded until they are visible.
            page.open((site / "scenes/room-000.html").as_uri())
            loaded = "document.querySelectorAll('.gallery img').length - [...document.querySelectorAll('.gallery img')].filter((i) => !i.complete).length"
            self.assertLess(page.run(loaded), 200)
            page.run("document.querySelector('.gallery tbody tr:last-child').scrollIntoView(); new Promise((done) => setTimeout(done, 500))")
            self.assertTrue(page.run("document.querySelector('.gallery tbody tr:last-child img').complete"))
            self.assertEqual(page.faults, [])


if __name__ == "__main__":
    unittest.main()
