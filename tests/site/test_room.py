"""Tests the 3D view of a room, and that three.js reads the uv of a dataset's geometry."""

import functools
import json
import os
import struct
import tempfile
import threading
import unittest
from contextlib import closing
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from chromium import Page
from sites import sample

PICTURES = os.environ.get("MATEVAL_TEST_PICTURES")
#: The packages that tools/build_viewer.sh installs.
NODE_MODULES = Path(os.environ["MATEVAL_NODE_MODULES"])


def setUpModule() -> None:
    global temporary, site, geometry
    temporary = tempfile.TemporaryDirectory()
    site, geometry = sample() / "site", sample() / "dataset/scenes/room/geometry"


def tearDownModule() -> None:
    temporary.cleanup()


def texcoords(path: Path) -> dict[str, list[float] | None]:
    """TEXCOORD_0 of each mesh, read from the file's bytes as the glTF specification describes them."""
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    root, blob = json.loads(data[20:20 + length]), data[28 + length:]
    found = {}
    for mesh in root["meshes"]:
        [primitive] = mesh["primitives"]
        at = primitive["attributes"].get("TEXCOORD_0")
        if at is None:
            found[mesh["name"]] = None
            continue
        accessor = root["accessors"][at]
        start = root["bufferViews"][accessor["bufferView"]]["byteOffset"]
        found[mesh["name"]] = list(struct.unpack_from(f"<{2 * accessor['count']}f", blob, start))
    return found


#: Loads a file by three.js as npm installs it; returns the uv of each mesh.
LOAD = """<!doctype html><script type="importmap">{ "imports": { "three": "./three/build/three.module.js" } }</script>
<script type="module">
import { GLTFLoader } from "./three/examples/jsm/loaders/GLTFLoader.js";
window.load = async (file) => {
  const { scene } = await new GLTFLoader().loadAsync(file);
  const found = {};
  scene.traverse((node) => {
    if (!node.isMesh) return;
    const { uv, position } = node.geometry.attributes;
    found[node.userData.name] = { uv: uv ? [...uv.array] : null, vertices: position.count };
  });
  return found;
};
</script>"""


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


class TestThree(unittest.TestCase):
    def test_every_mesh_keeps_its_uv(self) -> None:
        folder = Path(temporary.name)
        (folder / "index.html").write_text(LOAD)
        (folder / "three").symlink_to(NODE_MODULES / "three")
        (folder / "geometry").symlink_to(geometry)
        # Browsers load modules from servers only.
        server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.addCleanup(server.server_close)
        self.addCleanup(server.shutdown)
        page = Page(width=400, height=400, dark=False)
        self.addCleanup(page.close)
        page.open(f"http://127.0.0.1:{server.server_port}/index.html")
        page.wait_for("window.load")
        for name in ["instances.glb", "parts.glb"]:
            expected, found = texcoords(geometry / name), page.run(f"load('geometry/{name}')")
            self.assertEqual(set(found), set(expected))
            with_uv = 0
            for mesh, values in expected.items():
                self.assertEqual(found[mesh]["uv"], values, f"{mesh} of {name}")
                if values is not None:
                    self.assertEqual(len(values), 2 * found[mesh]["vertices"])
                    with_uv += 1
            self.assertGreater(with_uv, 15)
            # The twin: panes have no atlas, and three.js reports none.
            self.assertIn(None, expected.values())


class TestRoom(unittest.TestCase):
    def setUp(self) -> None:
        self.page = Page(width=1400, height=900, dark=False)
        self.addCleanup(self.page.close)

    def tearDown(self) -> None:
        self.assertEqual(self.page.faults, [])

    def open(self, method: str = "") -> None:
        self.page.open((site / "rooms/room.html").as_uri() + method)
        self.page.wait_for("document.getElementById('room').dataset.shown")

    def shown(self) -> str:
        """Method, map and shading that are shown."""
        return self.page.run("document.getElementById('room').dataset.shown")

    def colors(self) -> int:
        """The number of colours that the view shows."""
        return self.page.run("""(() => {
          const room = document.getElementById("room");
          room.dispatchEvent(new KeyboardEvent("keydown", { key: "+" }));
          const copy = Object.assign(document.createElement("canvas"), { width: 100, height: 75 });
          const context = copy.getContext("2d");
          context.drawImage(room, 0, 0, 100, 75);
          const data = context.getImageData(0, 0, 100, 75).data;
          return new Set(Array.from({ length: 7500 }, (_, at) => data.slice(4 * at, 4 * at + 3).join())).size;
        })()""")

    def choose(self, name: str, value: str, shown: str) -> None:
        """Chooses and waits until this is shown."""
        self.page.run(f"""(() => {{ const form = document.getElementById('room-form'); const box = form.elements['{name}'];
                          if (box.type === 'checkbox') box.checked = {json.dumps(value == "on")}; else box.value = '{value}';
                          box.dispatchEvent(new Event('input', {{ bubbles: true }})); }})()""")
        self.page.wait_for(f"document.getElementById('room').dataset.shown === '{shown}'")

    def test_a_room_opens_from_the_disk(self) -> None:
        self.open()
        self.assertEqual(self.page.run("document.getElementById('room-status').textContent"), "")
        self.assertEqual(self.shown(), "nn-gt base_color shaded")
        textured = self.colors()
        self.choose("map", "roughness", "nn-gt roughness shaded")
        self.choose("map", "base_color", "nn-gt base_color shaded")
        # The twin: grey everywhere, without shading; edges of panes are blends.
        self.choose("method", "grey", "grey base_color shaded")
        self.choose("shading", "off", "grey base_color plain")
        self.assertGreater(textured, 5 * self.colors())

    def test_links_lead_to_the_method(self) -> None:
        text = (site / "index.html").read_text()
        self.assertIn('href="rooms/room.html#grey"', text)
        self.open("#grey")
        self.assertEqual(self.shown(), "grey base_color shaded")
        self.assertIn('href="../rooms/room.html"', (site / "scenes/room.html").read_text())

    def test_the_camera_stays_inside(self) -> None:
        self.open()
        camera = lambda: [float(word) for word in self.page.run("document.getElementById('room').dataset.camera").split()]
        home = camera()
        scene = json.loads((geometry.parent / "scene.json").read_text())
        photo = next(view for view in scene["views"] if view["id"] == "input")["camera"]["world_from_camera"]
        for found, row in zip(home, photo):
            self.assertAlmostEqual(found, row[3], places=2)
        bounds = self.bounds()
        self.page.run("document.getElementById('room').focus()")
        places = []
        for key, presses in [("ArrowRight", 30), ("ArrowUp", 20), ("ArrowLeft", 60)]:
            for _ in range(presses):
                self.page.key(key)
            places.append(camera())
        self.assertGreater(len({tuple(place) for place in places}), 2)
        for place in places:
            for axis in range(3):
                self.assertTrue(bounds[0][axis] < place[axis] < bounds[1][axis], f"{place} is outside {bounds}")
        self.page.run("document.getElementById('room-home').click()")
        self.assertEqual(camera(), home)

    def bounds(self) -> list[list[float]]:
        """The least and the largest coordinates of the geometry."""
        data = (geometry / "instances.glb").read_bytes()
        root = json.loads(data[20:20 + struct.unpack_from("<I", data, 12)[0]])
        boxes = [accessor for accessor in root["accessors"] if "min" in accessor]
        return [[pick(box[end][axis] for box in boxes) for axis in range(3)] for pick, end in [(min, "min"), (max, "max")]]

    def test_the_scripts_are_small(self) -> None:
        sizes = {file.name: file.stat().st_size for file in (site / "rooms/room").iterdir()}
        print(f"3D: {sizes}", flush=True)
        self.assertEqual(set(sizes), {"_geometry.js", "_truth.js", "nn-gt.js", "grey.js"})
        self.assertLess(max(sizes.values()), 1_000_000)

    def test_pictures(self) -> None:
        if not PICTURES:
            self.skipTest("MATEVAL_TEST_PICTURES is not set")
        for width, height, dark in [(1400, 900, False), (400, 800, True)]:
            with closing(Page(width=width, height=height, dark=dark)) as self.page:
                self.open()
                self.page.picture(f"{PICTURES}/room-{width}.png", whole=True)


if __name__ == "__main__":
    unittest.main()
