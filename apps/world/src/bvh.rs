//! A bounding volume hierarchy over the triangles of a world.
//!
//! A binary tree, split where binned surface areas promise the least work (Wald, *On fast Construction of SAH-based
//! Bounding Volume Hierarchies*, 2007). The same triangles in the same order give the same tree.

use elk_geometry::Bounds;
use nalgebra::{Point3, Vector3};

use crate::ray::{Hit, Ray};
use crate::triangle::{Triangle, bounds_of};

/// Triangles that a node keeps without being split.
const LEAF: usize = 4;
/// Places along the longest axis at which a split is considered, plus one.
const BINS: usize = 16;
/// Boxes are a little larger than what they hold (m), so that rounding in the box test cannot lose a triangle on a
/// face.
const SLACK: f64 = 1e-9;

/// The hierarchy, which owns its triangles.
#[derive(Debug, Clone)]
pub struct Bvh {
    /// In depth-first order: an inner node's left child follows it.
    nodes: Vec<Node>,
    triangles: Vec<Triangle>,
}

#[derive(Debug, Clone)]
struct Node {
    bounds: Bounds,
    content: Content,
}

#[derive(Debug, Clone)]
enum Content {
    Triangles { first: u32, count: u32 },
    RightChild(u32),
}

impl Bvh {
    /// The hierarchy over `triangles`.
    pub fn new(triangles: Vec<Triangle>) -> Self {
        Self::with_order(triangles).0
    }

    /// The hierarchy over `triangles`; and of each triangle in it, which of them it was.
    pub(crate) fn with_order(triangles: Vec<Triangle>) -> (Self, Vec<u32>) {
        let items = triangles.into_iter().zip(0..).map(|(triangle, index)| Item::new(triangle, index)).collect();
        let mut builder = Builder { items, nodes: Vec::new() };
        builder.build(0, builder.items.len());
        let (triangles, order) = builder.items.into_iter().map(|item| (item.triangle, item.index)).unzip();
        (Self { nodes: builder.nodes, triangles }, order)
    }

    /// All triangles.
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Turns a triangle over: what was its back is its front.
    pub(crate) fn turn(&mut self, index: usize) {
        self.triangles[index].0.swap(1, 2);
    }

    /// Whether a surface other than the one at `index` comes as near as `radius` (m) to `point`.
    pub(crate) fn is_met_by_another(&self, point: Point3<f64>, radius: f64, index: usize) -> bool {
        let reach = Vector3::repeat(radius);
        let around = Bounds { min: point - reach, max: point + reach };
        let own: *const Triangle = &self.triangles[index];
        let meets = |one: &Triangle| !std::ptr::eq(one, own) && one.distance_to_point(point) <= radius;
        self.any(|bounds| overlap(bounds, &around), meets)
    }

    /// How far along the ray the first surface is, in lengths of its direction, and which of [`Bvh::triangles`] it is.
    pub fn nearest(&self, ray: &Ray) -> Option<(f64, usize)> {
        let mut nearest = (f64::INFINITY, 0);
        self.descend(0, ray, &mut nearest);
        nearest.0.is_finite().then_some(nearest)
    }

    fn descend(&self, mut node: usize, ray: &Ray, nearest: &mut (f64, usize)) {
        loop {
            match self.nodes[node].content {
                Content::Triangles { first, count } => {
                    for (triangle, index) in self.range(first, count).iter().zip(first as usize..) {
                        if let Some(hit) = ray.hit(triangle)
                            && hit.t < nearest.0
                        {
                            *nearest = (hit.t, index);
                        }
                    }
                    return;
                }
                Content::RightChild(right) => {
                    let enter = |child: usize| (ray.enter(&self.nodes[child].bounds), child);
                    let (left, right) = (enter(node + 1), enter(right as usize));
                    let (near, far) = if left.0 <= right.0 { (left, right) } else { (right, left) };
                    if near.0 < nearest.0 {
                        self.descend(near.1, ray, nearest);
                    }
                    if far.0 >= nearest.0 {
                        return;
                    }
                    node = far.1;
                }
            }
        }
    }

    /// Distance from a point (m, world) to the nearest surface; infinite if there is none.
    pub fn distance(&self, point: Point3<f64>) -> f64 {
        let mut nearest = f64::INFINITY;
        self.approach(0, point, &mut nearest);
        nearest
    }

    fn approach(&self, node: usize, point: Point3<f64>, nearest: &mut f64) {
        match self.nodes[node].content {
            Content::Triangles { first, count } => {
                let distances = self.range(first, count).iter().map(|triangle| triangle.distance_to_point(point));
                *nearest = distances.fold(*nearest, f64::min);
            }
            Content::RightChild(right) => {
                let away = |child: usize| (distance_to_box(&self.nodes[child].bounds, point), child);
                let (left, right) = (away(node + 1), away(right as usize));
                let (near, far) = if left.0 <= right.0 { (left, right) } else { (right, left) };
                for (distance, child) in [near, far] {
                    if distance < *nearest {
                        self.approach(child, point, nearest);
                    }
                }
            }
        }
    }

    /// Every place where the ray meets a surface, in no particular order. At an edge both triangles may answer.
    pub fn hits(&self, ray: &Ray, mut each: impl FnMut(Hit)) {
        self.any(
            |bounds| ray.enter(bounds).is_finite(),
            |triangle| {
                if let Some(hit) = ray.hit(triangle) {
                    each(hit);
                }
                false
            },
        );
    }

    /// Whether a surface comes as near as `radius` (m) to the segment `from`–`to`: whether a ball of that radius
    /// touches anything on the straight way.
    pub fn touches(&self, from: Point3<f64>, to: Point3<f64>, radius: f64) -> bool {
        let reach = Vector3::repeat(radius);
        let swept = Bounds { min: from.inf(&to) - reach, max: from.sup(&to) + reach };
        self.any(|bounds| overlap(bounds, &swept), |triangle| triangle.distance_to_segment(from, to) <= radius)
    }

    /// Whether any surface shares a point with the box, faces included.
    pub fn overlaps(&self, cube: &Bounds) -> bool {
        self.any(|bounds| overlap(bounds, cube), |triangle| triangle.overlaps(cube))
    }

    /// Whether `found` holds for any triangle below the boxes that `enter` lets it into.
    fn any(&self, enter: impl Fn(&Bounds) -> bool, mut found: impl FnMut(&Triangle) -> bool) -> bool {
        let mut open = vec![0];
        while let Some(node) = open.pop() {
            if !enter(&self.nodes[node].bounds) {
                continue;
            }
            match self.nodes[node].content {
                Content::Triangles { first, count } => {
                    if self.range(first, count).iter().any(&mut found) {
                        return true;
                    }
                }
                Content::RightChild(right) => open.extend([right as usize, node + 1]),
            }
        }
        false
    }

    fn range(&self, first: u32, count: u32) -> &[Triangle] {
        &self.triangles[first as usize..(first + count) as usize]
    }
}

/// Whether two boxes share a point.
pub(crate) fn overlap(a: &Bounds, b: &Bounds) -> bool {
    (0..3).all(|i| a.min[i] <= b.max[i] && b.min[i] <= a.max[i])
}

/// Distance from a point to a box (m); 0 inside.
fn distance_to_box(bounds: &Bounds, point: Point3<f64>) -> f64 {
    (point - point.sup(&bounds.min).inf(&bounds.max)).norm()
}

fn union(a: &Bounds, b: &Bounds) -> Bounds {
    Bounds { min: a.min.inf(&b.min), max: a.max.sup(&b.max) }
}

/// Half the surface of a box (m²): the chance of a random ray to hit it, but for a factor.
fn half_area(bounds: &Bounds) -> f64 {
    let d = bounds.dim();
    d.x * d.y + d.y * d.z + d.z * d.x
}

struct Item {
    triangle: Triangle,
    /// Its place in what was given.
    index: u32,
    bounds: Bounds,
    center: Point3<f64>,
}

impl Item {
    fn new(triangle: Triangle, index: u32) -> Self {
        let bounds = triangle.bounds();
        let center = bounds.mid();
        Self { triangle, index, bounds, center }
    }
}

struct Builder {
    items: Vec<Item>,
    nodes: Vec<Node>,
}

impl Builder {
    fn build(&mut self, first: usize, end: usize) {
        let items = &mut self.items[first..end];
        let node = self.nodes.len();
        self.nodes.push(Node {
            bounds: padded(items),
            content: Content::Triangles { first: first as u32, count: (end - first) as u32 },
        });
        if items.len() > LEAF
            && let Some(left) = split(items)
        {
            self.build(first, first + left);
            self.nodes[node].content = Content::RightChild(self.nodes.len() as u32);
            self.build(first + left, end);
        }
    }
}

fn padded(items: &[Item]) -> Bounds {
    let tight = bounds_of(items.iter().flat_map(|i| [&i.bounds.min, &i.bounds.max]));
    Bounds { min: tight.min - Vector3::repeat(SLACK), max: tight.max + Vector3::repeat(SLACK) }
}

/// Sorts the items into two groups and answers the size of the first; `None` if their centres are all in one place.
fn split(items: &mut [Item]) -> Option<usize> {
    let centers = bounds_of(items.iter().map(|i| &i.center));
    let axis = centers.dim().imax();
    let width = centers.dim()[axis];
    if width <= 0.0 {
        return None;
    }
    let bin = |item: &Item| {
        let place = (item.center[axis] - centers.min[axis]) / width * BINS as f64;
        (place as usize).min(BINS - 1)
    };
    let cut = cheapest_cut(items, bin)?;
    items.sort_by_key(|item| bin(item) >= cut);
    Some(items.partition_point(|item| bin(item) < cut))
}

/// The first bin of the right group for which area times number of triangles, summed over both groups, is least.
fn cheapest_cut(items: &[Item], bin: impl Fn(&Item) -> usize) -> Option<usize> {
    let mut bins: [Option<(Bounds, usize)>; BINS] = [None; BINS];
    for item in items {
        let filled = &mut bins[bin(item)];
        *filled = joined(*filled, Some((item.bounds, 1)));
    }
    let cost = |group: &[Option<(Bounds, usize)>]| {
        let all = group.iter().copied().fold(None, joined)?;
        Some(half_area(&all.0) * all.1 as f64)
    };
    (1..BINS)
        .filter_map(|cut| Some((cost(&bins[..cut])? + cost(&bins[cut..])?, cut)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, cut)| cut)
}

fn joined(a: Option<(Bounds, usize)>, b: Option<(Bounds, usize)>) -> Option<(Bounds, usize)> {
    match (a, b) {
        (Some(a), Some(b)) => Some((union(&a.0, &b.0), a.1 + b.1)),
        (some, None) | (None, some) => some,
    }
}
