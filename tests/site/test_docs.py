"""Tests the site of the documentation, which `tools/docs.sh` builds first, in headless Chromium: at two widths, light and dark.

With MATEVAL_TEST_PICTURES=DIR it writes screenshots there.
"""

import os
import unittest
from contextlib import closing
from pathlib import Path
from urllib.parse import unquote

from chromium import Page

SITE = Path(__file__).parents[2] / "target/docs_site"
PICTURES = os.environ.get("MATEVAL_TEST_PICTURES")
#: Tables and code may be wider than the window, since they scroll by themselves.
WIDE = "document.documentElement.scrollWidth > innerWidth"


class TestDocs(unittest.TestCase):
    def test_no_page_is_wider_than_the_window(self) -> None:
        pages = sorted(path for path in SITE.rglob("*.html") if path.name != "404.html")
        self.assertGreaterEqual(len(pages), 60, "run tools/docs.sh first")
        for width in (1400, 400):
            for dark in (False, True):
                with closing(Page(width=width, height=900, dark=dark)) as page:
                    for path in pages:
                        page.open(path.as_uri())
                        self.assertFalse(page.run(WIDE), f"{path} at {width} pixels")
                        if PICTURES:
                            name = "_".join(path.relative_to(SITE).with_suffix("").parts)
                            page.picture(f"{PICTURES}/docs_{name}_{width}_{'dark' if dark else 'light'}.png")
                    # The twin: a page with a wide part.
                    page.run("document.body.insertAdjacentHTML('beforeend', '<div style=\"width: 2000px\">wide</div>')")
                    self.assertTrue(page.run(WIDE))
                    self.assertEqual(page.faults, [], "pages load nothing from elsewhere")

    def search(self, page: Page, words: str) -> list[str]:
        """The first pages that the search finds, without their folder."""
        page.open((SITE / "index.html").as_uri())
        page.run("document.querySelector('.md-search__input').focus()")
        page.run(f"document.querySelector('.md-search__input').value = {words!r}")
        # A key is released until the page has loaded its index and answers.
        page.wait_for("document.querySelector('.md-search__input').dispatchEvent(new KeyboardEvent('keyup')) && "
                      "/document/.test(document.querySelector('.md-search-result__meta').textContent)")
        links = page.run("[...document.querySelectorAll('.md-search-result__link')].map(link => link.href.split('?')[0])")
        return [unquote(link).split("/docs_site/")[1] for link in links]

    def test_search_finds_metrics_commands_and_keys(self) -> None:
        with closing(Page(width=1400, height=900, dark=False)) as page:
            for words, expected in {
                "roughness": "format/index.html",
                "albedo.novel.psnr": "PROTOCOL.html",
                "mateval eval score": "commands/eval.html",
                "half_pixel_m": "keys/scene.html",
                "blenderproc_compat": "keys/recipe.html",
                "unproject": "python.html",
            }.items():
                with self.subTest(words):
                    self.assertIn(expected, self.search(page, words))
            # The twin.
            self.assertEqual(self.search(page, "qwertyuiop"), [])


if __name__ == "__main__":
    unittest.main()
