//! One camera matrix holds for every picture. Points of the meshes are projected by a few lines that share no code with
//! `mateval_dataset::Camera`; at the resulting pixels, the pictures of each view must hold the points' depth, ids,
//! normals, masks and colours. With a camera rolled by three degrees they must not.

use std::path::Path;

use mateval_dataset::glb;
use mateval_image::{Mask, Picture, exr_io, png_io};
use serde_json::Value;

use super::planted::roll;
use super::sample::{dataset, json, own_materials};

type Point = [f64; 3];

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// A camera read from `scene.json` according to format/dataset.md: the columns of `world_from_camera` are its axes and
/// position, it looks along its -Z, +Y is up, pixels are counted from the top left.
struct Eye {
    axes: [Point; 3],
    place: Point,
    focal: [f64; 2],
    centre: [f64; 2],
    size: [usize; 2],
}

impl Eye {
    fn of(view: &Value) -> Self {
        let camera = &view["camera"];
        let number = |name: &str| camera["intrinsics"][name].as_f64().unwrap();
        let column = |c: usize| [0, 1, 2].map(|row| camera["world_from_camera"][row][c].as_f64().unwrap());
        Self {
            axes: [column(0), column(1), column(2)],
            place: column(3),
            focal: [number("fx"), number("fy")],
            centre: [number("cx"), number("cy")],
            size: [number("width") as usize, number("height") as usize],
        }
    }

    /// Column, row and depth of a point; none behind the camera or outside the picture.
    fn project(&self, point: Point) -> Option<([f64; 2], f64)> {
        let [right, up, back] = self.axes.map(|axis| dot(minus(point, self.place), axis));
        let depth = -back;
        let place = [self.centre[0] + self.focal[0] * right / depth, self.centre[1] - self.focal[1] * up / depth];
        let inside = (0..2).all(|c| place[c] >= 0.0 && place[c] < self.size[c] as f64);
        (depth > 0.0 && inside).then_some((place, depth))
    }

    /// The point at this depth in the middle of a pixel.
    fn point(&self, pixel: [usize; 2], depth: f64) -> Point {
        let right = (pixel[0] as f64 + 0.5 - self.centre[0]) / self.focal[0] * depth;
        let up = (self.centre[1] - pixel[1] as f64 - 0.5) / self.focal[1] * depth;
        let [x, y, z] = self.axes;
        [0, 1, 2].map(|c| self.place[c] + x[c] * right + y[c] * up - z[c] * depth)
    }
}

/// One view: its pictures, and the camera that projects points into them.
struct Seen {
    eye: Eye,
    depth: Picture<f32>,
    normal: Picture<[f32; 3]>,
    instance: Picture<u16>,
    part: Picture<u16>,
    valid: Mask,
    unobserved: Option<Mask>,
}

impl Seen {
    fn read(room: &Path, view: &Value) -> Self {
        let name = view["id"].as_str().unwrap();
        let file = |file: &str| room.join("views").join(name).join(file);
        Self {
            eye: Eye::of(view),
            depth: exr_io::read_scalar(&file("depth.exr")).unwrap(),
            normal: exr_io::read_normal(&file("normal.exr")).unwrap().map(|normal| normal.0),
            instance: png_io::read_ids(&file("instance.png")).unwrap(),
            part: png_io::read_ids(&file("part.png")).unwrap(),
            valid: png_io::read_mask(&file("valid.png")).unwrap(),
            unobserved: (name != "input").then(|| png_io::read_mask(&file("unobserved.png")).unwrap()),
        }
    }

    /// The pixel that holds `place` and its neighbours.
    fn around(&self, place: [f64; 2]) -> impl Iterator<Item = [usize; 2]> + use<> {
        let range = |c: usize, size: usize| (place[c] as usize).saturating_sub(1)..(place[c] as usize + 2).min(size);
        let (columns, rows) = (range(0, self.eye.size[0]), range(1, self.eye.size[1]));
        rows.flat_map(move |y| columns.clone().map(move |x| [x, y]))
    }

    /// The world point that the pixel shows, and its normal.
    fn shown(&self, [x, y]: [usize; 2]) -> (Point, Point) {
        (self.eye.point([x, y], f64::from(self.depth.get(x, y))), self.normal.get(x, y).map(f64::from))
    }
}

/// A point of a mesh and the values that pictures should hold for it.
struct Mark {
    point: Point,
    instance: u16,
    part: u16,
    /// The unit normal of its triangle, if the mesh is flat.
    normal: Option<Point>,
}

/// The vertices of every part, and points within the triangles of the large flat ones, which have few vertices.
fn marks(room: &Path, scene: &Value) -> Vec<Mark> {
    let index_of = |list: &str, id: &Value| {
        let entries = scene[list].as_array().unwrap();
        entries.iter().find(|entry| entry["id"] == *id).unwrap()["index"].as_u64().unwrap() as u16
    };
    let meshes = glb::read(&room.join("geometry/instances.glb")).unwrap();
    assert_eq!(meshes.len(), scene["instances"].as_array().unwrap().len());
    let mut marks = Vec::new();
    let parts = glb::read(&room.join("geometry/parts.glb")).unwrap();
    for (part, node) in scene["parts"].as_array().unwrap().iter().zip(parts) {
        assert_eq!(part["id"], *node.name);
        let (instance, part) = (index_of("instances", &part["instance"]), index_of("parts", &part["id"]));
        let point = |v: &u32| node.mesh.positions[*v as usize].to_array().map(f64::from);
        marks.extend((0..node.mesh.positions.len() as u32).map(|v| Mark {
            point: point(&v),
            instance,
            part,
            normal: None,
        }));
        if node.mesh.triangles.len() <= 2 {
            let inner = node.mesh.triangles.iter().flat_map(|triangle| inner_points(triangle.each_ref().map(point)));
            marks.extend(inner.map(|(point, normal)| Mark { point, instance, part, normal: Some(normal) }));
        }
    }
    marks
}

/// A grid of points within a triangle, and its normal.
fn inner_points([a, b, c]: [Point; 3]) -> Vec<(Point, Point)> {
    const STEPS: usize = 24;
    let (u, v) = (minus(b, a), minus(c, a));
    let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = dot(cross, cross).sqrt();
    let grid = (1..STEPS).flat_map(|i| (1..STEPS - i).map(move |j| (i as f64 / STEPS as f64, j as f64 / STEPS as f64)));
    grid.map(|(i, j)| ([0, 1, 2].map(|k| a[k] + u[k] * i + v[k] * j), cross.map(|k| k / length))).collect()
}

/// The numbers of marks of a view that its pictures do and do not show in the right place.
#[derive(Debug, Default)]
struct Tally {
    seen: usize,
    hidden: usize,
    wrong: usize,
    normals: usize,
    wrong_normals: usize,
}

/// Largest distance of a mark from the tangent plane of a pixel that shows it, divided by its depth: the curvature of a
/// bowl within a pixel and a half.
const OFF_PLANE: f64 = 0.004;

fn tally(seen: &Seen, marks: &[Mark]) -> Tally {
    let mut tally = Tally::default();
    for mark in marks {
        let Some((place, depth)) = seen.eye.project(mark.point) else { continue };
        let off_plane = |pixel| {
            let (point, normal) = seen.shown(pixel);
            dot(minus(mark.point, point), normal).abs() / depth
        };
        let shows = |[x, y]: &[usize; 2]| {
            let ids = (seen.instance.get(*x, *y), seen.part.get(*x, *y));
            ids == (mark.instance, mark.part) && off_plane([*x, *y]) < OFF_PLANE
        };
        let nearer = |[x, y]: [usize; 2]| {
            let shown = f64::from(seen.depth.get(x, y));
            shown > 0.0 && shown < depth * (1.0 + OFF_PLANE)
        };
        match seen.around(place).find(shows) {
            Some(pixel) => {
                tally.seen += 1;
                if let Some(normal) = mark.normal {
                    tally.normals += 1;
                    tally.wrong_normals += usize::from(dot(normal, seen.shown(pixel).1).abs() < 0.999);
                }
            }
            None if seen.around(place).any(nearer) => tally.hidden += 1,
            None => tally.wrong += 1,
        }
    }
    tally
}

/// The tallies of all five views, whose cameras are first rolled by this angle.
fn tallies(rolled_deg: f64) -> Vec<Tally> {
    let room = dataset().join("scenes/room");
    let mut scene = json(&room.join("scene.json"));
    let marks = marks(&room, &scene);
    let views = scene["views"].as_array_mut().unwrap();
    assert_eq!(views.len(), 5);
    views.iter_mut().for_each(|view| roll(view, rolled_deg));
    views.iter().map(|view| tally(&Seen::read(&room, view), &marks)).collect()
}

/// At least 55 % of the marks within a picture are seen (the others are on the backs of objects), and at most 0.2 % are
/// neither seen nor behind something (objects thinner than a pixel may lie between pixel centres).
fn agrees(tally: &Tally) -> bool {
    let all = tally.seen + tally.hidden + tally.wrong;
    tally.seen * 100 >= all * 55 && tally.wrong * 1000 <= all * 2
}

#[test]
fn depth_ids_and_normals_match_the_projected_meshes() {
    for tally in tallies(0.0) {
        assert!(agrees(&tally), "{tally:?}");
        assert!(tally.seen > 5000 && tally.normals > 1000 && tally.wrong_normals == 0, "{tally:?}");
    }
}

/// The twin.
#[test]
fn a_rolled_camera_fails() {
    for tally in tallies(3.0) {
        assert!(!agrees(&tally), "{tally:?}");
        assert!(tally.wrong > 200, "{tally:?}");
    }
}

/// The number of pixels of the novel views whose mark differs from "valid, and its point is outside the input picture",
/// with the input camera rolled; and the number of marked pixels.
fn unobserved_faults(rolled_deg: f64) -> (usize, usize) {
    let room = dataset().join("scenes/room");
    let scene = json(&room.join("scene.json"));
    let mut input = scene["views"][0].clone();
    roll(&mut input, rolled_deg);
    let input = Eye::of(&input);
    let (mut wrong, mut marked) = (0, 0);
    for view in &scene["views"].as_array().unwrap()[1..] {
        let seen = Seen::read(&room, view);
        let unobserved = seen.unobserved.as_ref().unwrap();
        let [width, height] = seen.eye.size;
        for pixel in (0..height).flat_map(|y| (0..width).map(move |x| [x, y])) {
            let outside = input.project(seen.shown(pixel).0).is_none();
            let found = unobserved.get(pixel[0], pixel[1]);
            marked += usize::from(found);
            wrong += usize::from(found != (outside && seen.valid.get(pixel[0], pixel[1])));
        }
    }
    (wrong, marked)
}

#[test]
fn unobserved_pixels_are_outside_the_input_picture() {
    let (wrong, marked) = unobserved_faults(0.0);
    assert!(wrong == 0 && marked > 1000, "{wrong} of {marked}");
    let (wrong, _) = unobserved_faults(3.0);
    assert!(wrong > 200, "a rolled input camera gives only {wrong} faults");
}

/// Compares the albedo truth with the expected colour where points of an instance of one material project to and
/// nothing else is near. Returns the largest difference and the number of pixels.
fn off_colour(instance: &str, expected: [f32; 3]) -> (f32, usize) {
    let room = own_materials().join("scenes/room");
    let scene = json(&room.join("scene.json"));
    let known = scene["instances"].as_array().unwrap().iter().find(|entry| entry["id"] == instance).unwrap();
    let index = known["index"].as_u64().unwrap() as u16;
    let node = glb::read(&room.join("geometry/instances.glb")).unwrap().swap_remove(usize::from(index) - 1);
    let point = |vertex: u32| node.mesh.positions[vertex as usize].to_array().map(f64::from);
    let points: Vec<Point> = node
        .mesh
        .triangles
        .iter()
        .flat_map(|corners| inner_points(corners.map(point)))
        .map(|(point, _)| point)
        .collect();
    let (mut worst, mut count) = (0.0_f32, 0);
    for view in scene["views"].as_array().unwrap() {
        let seen = Seen::read(&room, view);
        let truth = room.join("ground_truth/views").join(view["id"].as_str().unwrap());
        let albedo = exr_io::read_linear(&truth.join("albedo.exr")).unwrap();
        let diffuse = exr_io::read_linear(&truth.join("diffuse_albedo.exr")).unwrap();
        let metallic = exr_io::read_scalar(&truth.join("metallic.exr")).unwrap();
        for place in points.iter().filter_map(|point| Some(seen.eye.project(*point)?.0)) {
            let alone = |[x, y]: [usize; 2]| index == seen.instance.get(x, y) && seen.valid.get(x, y);
            if !seen.around(place).all(alone) {
                continue;
            }
            let [x, y] = place.map(|c| c as usize);
            let rest = 1.0 - metallic.get(x, y);
            for (c, expected) in expected.into_iter().enumerate() {
                worst = worst.max((albedo.get(x, y).0[c] - expected).abs());
                worst = worst.max((diffuse.get(x, y).0[c] - expected * rest).abs());
            }
            count += 1;
        }
    }
    (worst, count)
}

/// With the source's own materials, the colours are those of the sample's own XML.
#[test]
fn albedo_is_the_materials_own_colour() {
    const COLOURS: [(&str, [f32; 3]); 5] = [
        ("box_yellow", [0.75, 0.5, 0.06]),
        ("ceiling", [0.82, 0.81, 0.78]),
        ("box_red", [0.55, 0.05, 0.04]),
        ("box_teal", [0.03, 0.28, 0.3]),
        ("mirror", [1.0, 1.0, 1.0]),
    ];
    for (at, (instance, colour)) in COLOURS.into_iter().enumerate() {
        let (worst, count) = off_colour(instance, colour);
        assert!(worst < 1e-5 && count > 20, "{instance}: off by {worst} at {count} places");
        let (_, other) = COLOURS[(at + 1) % COLOURS.len()];
        assert!(off_colour(instance, other).0 > 0.05, "{instance} has the colour of another instance too");
    }
}
