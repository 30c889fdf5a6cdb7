// The 3D view of a room: its geometry with the atlases of a method, seen from inside.
//
// esbuild bundles this file with what it uses of three.js into room.min.js (tools/build_viewer.sh). Pages that are
// opened from the disk may not fetch, so geometry and atlases are scripts that call the two functions at the end.

import {
  AmbientLight, Box3, ClampToEdgeWrapping, Color, DirectionalLight, LinearFilter, Matrix4, Mesh, MeshBasicMaterial,
  MeshLambertMaterial, PerspectiveCamera, Raycaster, Scene, SRGBColorSpace, Texture, Vector3, WebGLRenderer, DoubleSide,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";

// The camera keeps this distance from what it looks at and from walls, in metres.
const CLEARANCE_M = 0.1;
// How far the camera may turn about the middle of the view, in radians, to each side and up or down.
const TURN = { sideways: 0.7, up: 0.4, down: 0.35 };
// The camera is kept on this side of meshes whose diagonal is at least this share of the room's: walls, not chairs.
const WALL_SHARE = 0.45;
const KEY_STEP = 0.06;

const canvas = document.getElementById("room");
const form = document.getElementById("room-form");
const status = document.getElementById("room-status");
const folder = `${canvas.dataset.scene}/`;
const scene = new Scene();
const meshes = new Map();
const atlases = {};
let view = null;
// The choice that is being loaded or is shown.
let wanted = null;

function say(text) {
  status.textContent = text;
}

function loadScript(name) {
  const script = document.createElement("script");
  script.src = `${folder}${name}.js`;
  script.onerror = () => say(`The file ${folder}${name}.js could not be loaded.`);
  document.head.append(script);
}

function bytesOf(base64) {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0)).buffer;
}

// The camera of the photo: row-major world_from_camera, and intrinsics in pixels.
function cameraOf({ world_from_camera: rows, intrinsics }) {
  const fovY = 2 * Math.atan(intrinsics.height / 2 / intrinsics.fy) * (180 / Math.PI);
  const camera = new PerspectiveCamera(fovY, intrinsics.width / intrinsics.height, 0.02, 1000);
  new Matrix4().set(...rows.flat()).decompose(camera.position, camera.quaternion, camera.scale);
  return camera;
}

// Bounds of the room, meshes that are large enough to be walls, and a point in the middle of the photo to turn about.
function spaceAround(camera) {
  const bounds = new Box3();
  for (const mesh of meshes.values()) bounds.expandByObject(mesh);
  const size = bounds.getSize(new Vector3()).length();
  const extent = (mesh) => new Box3().setFromObject(mesh).getSize(new Vector3()).length();
  let walls = [...meshes.values()].filter((mesh) => extent(mesh) >= WALL_SHARE * size);
  const ahead = camera.getWorldDirection(new Vector3());
  const [first] = new Raycaster(camera.position, ahead).intersectObjects([...meshes.values()]);
  const distance = Math.max(0.5, 0.85 * (first ? first.distance : size / 3));
  const target = camera.position.clone().addScaledVector(ahead, distance);
  // A photo taken from outside, through a wall that the source leaves away, has no walls to keep inside of.
  if (blocked(walls, target, camera.position) < distance) walls = [];
  bounds.expandByScalar(-CLEARANCE_M).expandByPoint(camera.position);
  return { bounds, walls, target, distance };
}

// The distance from a point towards another to the first wall between them; their own distance if there is none.
function blocked(walls, from, to) {
  const way = to.clone().sub(from);
  const length = way.length();
  const [hit] = new Raycaster(from, way.normalize(), 0, length).intersectObjects(walls);
  return hit ? hit.distance : length;
}

function start(camera) {
  const renderer = new WebGLRenderer({ canvas, antialias: true });
  canvas.parentElement.style.aspectRatio = camera.aspect;
  const light = new DirectionalLight(0xffffff, 1.6);
  scene.background = new Color(0x808080);
  scene.add(new AmbientLight(0xffffff, 1.5), camera);
  camera.add(light, light.target);
  light.position.set(-0.6, 0.8, 0.4);
  light.target.position.set(0, 0, -1);
  camera.updateMatrixWorld();

  const space = spaceAround(camera);
  const home = camera.position.clone();
  const controls = new OrbitControls(camera, canvas);
  controls.target.copy(space.target);
  controls.enablePan = false;
  controls.minDistance = 0.25 * space.distance;
  controls.maxDistance = space.distance;
  const [azimuth, polar] = [controls.getAzimuthalAngle(), controls.getPolarAngle()];
  controls.minAzimuthAngle = azimuth - TURN.sideways;
  controls.maxAzimuthAngle = azimuth + TURN.sideways;
  controls.minPolarAngle = Math.max(0.1, polar - TURN.up);
  controls.maxPolarAngle = Math.min(Math.PI - 0.1, polar + TURN.down);
  // A finger that moves up or down scrolls the page, and so does the wheel until the view is chosen.
  canvas.style.touchAction = "pan-y";
  controls.enableZoom = false;
  canvas.addEventListener("focus", () => { controls.enableZoom = true; });
  canvas.addEventListener("blur", () => { controls.enableZoom = false; });

  view = { renderer, camera, controls, space, home };
  controls.addEventListener("change", draw);
  canvas.addEventListener("pointerdown", () => canvas.focus({ preventScroll: true }));
  canvas.addEventListener("keydown", turnByKey);
  document.getElementById("room-home").addEventListener("click", goHome);
  new ResizeObserver(resize).observe(canvas.parentElement);
  resize();
  goHome();
}

function resize() {
  const { width, height } = canvas.parentElement.getBoundingClientRect();
  view.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  view.renderer.setSize(width, height, false);
  view.camera.aspect = width / height;
  view.camera.updateProjectionMatrix();
  draw();
}

function goHome() {
  view.camera.position.copy(view.home);
  view.controls.update();
  draw();
}

function turnByKey(event) {
  const { controls, camera } = view;
  const turns = {
    ArrowLeft: () => controls.rotateLeft(KEY_STEP), ArrowRight: () => controls.rotateLeft(-KEY_STEP),
    ArrowUp: () => controls.rotateUp(KEY_STEP), ArrowDown: () => controls.rotateUp(-KEY_STEP),
    "+": () => camera.position.lerp(controls.target, 0.1), "-": () => camera.position.lerp(controls.target, -0.1),
  };
  if (!turns[event.key]) return;
  event.preventDefault();
  turns[event.key]();
  controls.update();
  draw();
}

// Draws the room from the camera's place, moved to where it is inside the room; the controls keep their own place, so
// that turning back undoes the move.
function draw() {
  const { renderer, camera, controls, space } = view;
  const place = camera.position.clone();
  const free = blocked(space.walls, controls.target, place);
  if (free < place.distanceTo(controls.target)) {
    const away = place.clone().sub(controls.target).setLength(Math.max(CLEARANCE_M, free - CLEARANCE_M));
    camera.position.copy(controls.target).add(away);
  }
  space.bounds.clampPoint(camera.position, camera.position);
  camera.updateMatrixWorld();
  renderer.render(scene, camera);
  canvas.dataset.camera = camera.position.toArray().map((metres) => metres.toFixed(3)).join(" ");
  camera.position.copy(place);
}

// A map is a colour, as in "#808080", or the address of a picture.
async function paint(material, map) {
  if (map.startsWith("#")) {
    material.color = new Color(map);
    return;
  }
  const image = new Image();
  image.src = map;
  await image.decode();
  material.map = Object.assign(new Texture(image), {
    colorSpace: SRGBColorSpace, flipY: false, wrapS: ClampToEdgeWrapping, wrapT: ClampToEdgeWrapping,
    minFilter: LinearFilter, generateMipmaps: false, needsUpdate: true,
  });
  material.needsUpdate = true;
}

// Gives every mesh the map that is chosen, and draws the room once all of them are decoded.
async function dress() {
  const { method, map } = Object.fromEntries(new FormData(form));
  const maps = atlases[method];
  if (!view || !maps) return;
  const shading = form.elements.shading.checked;
  const shown = `${method} ${map} ${shading ? "shaded" : "plain"}`;
  wanted = shown;
  const Kind = shading ? MeshLambertMaterial : MeshBasicMaterial;
  const materials = new Map([...meshes.keys()].map((id) => [id, new Kind({ side: DoubleSide })]));
  for (const [id, material] of materials) {
    if (!maps[id]) Object.assign(material, { transparent: true, opacity: 0.2 });
  }
  await Promise.all(Object.entries(maps).map(([id, all]) => paint(materials.get(id), all[map])));
  // Another choice may have been made meanwhile.
  if (wanted !== shown) return;
  for (const [id, mesh] of meshes) {
    mesh.material.map?.dispose();
    mesh.material.dispose();
    mesh.material = materials.get(id);
  }
  say("");
  draw();
  canvas.dataset.shown = shown;
}

function showChoice() {
  dress().catch((error) => say(`The textures could not be read: ${error.message}`));
}

function choose() {
  const { method } = Object.fromEntries(new FormData(form));
  history.replaceState(null, "", `#${method}`);
  if (atlases[method]) {
    showChoice();
    return;
  }
  say("Loading …");
  loadScript(method);
}

window.roomMaterials = (method, maps) => {
  atlases[method] = maps;
  showChoice();
};

window.roomGeometry = ({ glb, camera }) => {
  new GLTFLoader().parse(bytesOf(glb), "", ({ scene: room }) => {
    room.traverse((node) => { if (node instanceof Mesh) meshes.set(node.userData.name ?? node.name, node); });
    scene.add(room);
    try {
      start(cameraOf(camera));
      choose();
    } catch (error) {
      say(`This browser cannot show the room: ${error.message}`);
    }
  }, (error) => say(`The room could not be read: ${error.message}`));
};

const named = decodeURIComponent(location.hash.slice(1));
if ([...form.elements.method.options].some((option) => option.value === named)) form.elements.method.value = named;
form.addEventListener("input", choose);
form.addEventListener("submit", (event) => event.preventDefault());
say("Loading …");
loadScript("_geometry");
