// Writes a small room with three.js's GLTFExporter: boxes with materials of several kinds, lights, a camera.
// Usage: node three_room.mjs NODE_MODULES OUT

import { writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [modules, out] = process.argv.slice(2);
const load = (name) => import(pathToFileURL(`${modules}/three/${name}`));

// The exporter reads blobs as browsers do.
globalThis.FileReader = class {
    readAsArrayBuffer(blob) {
        blob.arrayBuffer().then((buffer) => this.finish(buffer));
    }
    readAsDataURL(blob) {
        blob.arrayBuffer().then((buffer) => {
            this.finish(`data:${blob.type};base64,${Buffer.from(buffer).toString("base64")}`);
        });
    }
    finish(result) {
        this.result = result;
        this.onloadend();
    }
};

const three = await load("build/three.module.js");
const { GLTFExporter } = await load("examples/jsm/exporters/GLTFExporter.js");

const scene = new three.Scene();
const add = (object, name, x, y, z) => {
    object.name = name;
    object.position.set(x, y, z);
    scene.add(object);
    return object;
};
const box = new three.BoxGeometry(1, 1, 1);
const paint = new three.MeshStandardMaterial({ color: 0x8060c0, roughness: 0.4, metalness: 0, name: "paint" });
const metal = new three.MeshStandardMaterial({ color: 0xffffff, roughness: 0.1, metalness: 1, name: "metal" });
const glass = new three.MeshPhysicalMaterial({ transmission: 1, ior: 1.5, roughness: 0, name: "glass" });
const lacquer = new three.MeshPhysicalMaterial({ clearcoat: 1, color: 0x202020, name: "lacquer" });
const glow = new three.MeshStandardMaterial({ emissive: 0xffffff, emissiveIntensity: 5, name: "glow" });
add(new three.Mesh(box, paint), "box", -1, 0.5, 0);
add(new three.Mesh(box, paint), "mirrored", 1, 0.5, 0).scale.x = -1;
add(new three.Mesh(box, [paint, metal, paint, metal, paint, metal]), "patchwork", 0, 0.5, -1);
add(new three.Mesh(new three.SphereGeometry(0.4), metal), "ball", 0, 0.4, 1);
add(new three.Mesh(new three.PlaneGeometry(1, 1), glass), "pane", 2, 1, 0);
add(new three.Mesh(box, lacquer), "piano", 3, 0.5, 0);
add(new three.Mesh(new three.PlaneGeometry(0.5, 0.5), glow), "lamp", 0, 2.5, 0).rotation.x = Math.PI / 2;
add(new three.PointLight(0xffffff, 30), "bulb", 1, 2, 1);
add(new three.SpotLight(0xffffff, 30, 0, 0.5, 0.2), "spot", -1, 2, 1);
add(new three.DirectionalLight(0xffffff, 3), "sun", 0, 5, 5);
add(new three.PerspectiveCamera(50, 4 / 3), "camera", 0, 1.5, 5);
const lines = new three.BufferGeometry().setFromPoints([new three.Vector3(), new three.Vector3(1, 1, 1)]);
add(new three.Line(lines, new three.LineBasicMaterial()), "line", 0, 0, 0);
scene.updateMatrixWorld();

const binary = out.endsWith(".glb");
const written = await new GLTFExporter().parseAsync(scene, { binary });
writeFileSync(out, binary ? Buffer.from(written) : JSON.stringify(written));
