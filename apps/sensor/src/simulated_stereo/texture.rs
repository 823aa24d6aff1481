//! What the surfaces of a world look like: a solid texture, worked out from the place and never stored.

use elk_geometry::random::Random;
use elk_world::World;
use elk_world::triangle::Triangle;
use nalgebra::{Point3, Vector3};

/// Edges of the lattices of the texture's octaves (m): the finest is a pixel of a near wall, the coarsest a piece of furniture.
const FINEST_M: f64 = 0.005;
const OCTAVES: i32 = 8;
/// An octave is left out whose lattice has an edge of less than this many pixels, and shows fully at twice as many: below two
/// pixels a wave cannot be told from a longer one (Nyquist).
const LEAST_PX: f32 = 1.5;
/// Mean grey of surfaces, and how far that of one plane may be from it.
const MEAN: f32 = 128.0;
const SPREAD: f32 = 30.0;
/// What is seen where there is nothing.
const SKY: f32 = 225.0;
/// Planes whose normals (of length 1) and distances from the origin (m) differ by less than about this are one: a wall is made of
/// several triangles.
const SAME_PLANE: f64 = 1e-3;

/// How surfaces look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// How far each octave of the texture takes grey levels up and down.
    pub contrast: f32,
    /// The share of planes that are blank: of one grey, with nothing to match (0 to 1).
    pub blank: f64,
    /// Seed of all of it.
    pub seed: u64,
}

/// The look of a world: noise in space at every scale (Perlin, *An Image Synthesizer*, 1985; value noise), cut by the surfaces,
/// and a mean grey for each plane. It looks the same from everywhere, as paint does.
#[derive(Debug, Clone)]
pub struct Texture {
    seed: u32,
    /// Of each triangle of the world.
    paints: Vec<Paint>,
}

#[derive(Debug, Clone, Copy)]
struct Paint {
    normal: Vector3<f64>,
    mean: f32,
    contrast: f32,
}

impl Texture {
    /// The look of all surfaces of a world.
    pub fn new(world: &World, look: &Look) -> Self {
        let paints = world.surfaces().triangles().iter().map(|triangle| Paint::new(triangle, look)).collect();
        Self { seed: Random::new(look.seed, 0).next_u64() as u32, paints }
    }

    /// The normal of a triangle, of length 1.
    pub(super) fn normal(&self, triangle: usize) -> Vector3<f64> {
        self.paints[triangle].normal
    }

    /// The grey level (0 to 255) of a place (m, world) on a triangle of the world, seen with pixels that cover `footprint` of it
    /// (m): what is finer than pixels can show is left out, so that it does not alias.
    pub(super) fn grey(&self, triangle: usize, place: Point3<f64>, footprint: f64) -> f32 {
        let Paint { mean, contrast, .. } = self.paints[triangle];
        if contrast == 0.0 {
            return mean;
        }
        let octave = |octave: i32| {
            let edge = FINEST_M * f64::from(1 << octave);
            let share = ((edge / footprint) as f32 / LEAST_PX - 1.0).clamp(0.0, 1.0);
            if share == 0.0 { 0.0 } else { share * noise(place.coords / edge, self.seed ^ octave as u32) }
        };
        mean + contrast * (0..OCTAVES).map(octave).sum::<f32>()
    }

    /// The grey level where no surface is.
    pub(super) fn sky(&self) -> f32 {
        SKY
    }
}

impl Paint {
    fn new(triangle: &Triangle, look: &Look) -> Self {
        let normal = triangle.normal().normalize();
        let of_plane = &mut Random::new(look.seed, plane(normal, triangle.0[0]));
        let mean = MEAN + SPREAD * of_plane.between(-1.0, 1.0) as f32;
        let is_blank = of_plane.unit() < look.blank;
        Self { normal, mean, contrast: if is_blank { 0.0 } else { look.contrast } }
    }
}

/// A number of the plane through a place, the same for all triangles in it, whichever way they look.
fn plane(normal: Vector3<f64>, place: Point3<f64>) -> u64 {
    let away = normal[normal.iamax()].signum();
    let [x, y, z] = [normal.x, normal.y, normal.z].map(|c| c * away);
    let offset = normal.dot(&place.coords) * away;
    // Between two steps, where few planes lie: those of files lie on round numbers.
    let stepped = |c: f64| (c / SAME_PLANE + 0.37).floor() as i64 as u64;
    [x, y, z, offset].into_iter().fold(0, |number, c| Random::new(number, stepped(c)).next_u64())
}

/// Value noise (−1 to 1): random values at the corners of a lattice of edge 1, between which it goes smoothly.
fn noise(place: Vector3<f64>, seed: u32) -> f32 {
    let corner = place.map(f64::floor);
    let [x, y, z] = [0, 1, 2].map(|axis| {
        let t = (place[axis] - corner[axis]) as f32;
        t * t * (3.0 - 2.0 * t)
    });
    // Indices wrap around after 2³² edges.
    let [i, j, k] = [0, 1, 2].map(|axis| corner[axis] as i64 as u32);
    let value = |di: u32, dj: u32, dk: u32| value(i.wrapping_add(di), j.wrapping_add(dj), k.wrapping_add(dk), seed);
    let mix = |a: f32, b: f32, share: f32| a + (b - a) * share;
    let along_x = |dj: u32, dk: u32| mix(value(0, dj, dk), value(1, dj, dk), x);
    let along_y = |dk: u32| mix(along_x(0, dk), along_x(1, dk), y);
    mix(along_y(0), along_y(1), z)
}

/// The value (−1 to 1) at a corner: its indices through a finaliser of 32 bits (Wellons, *Prospecting for Hash Functions*, 2018).
fn value(i: u32, j: u32, k: u32, seed: u32) -> f32 {
    let mut h = i.wrapping_mul(0x8da6_b343)
        ^ j.wrapping_mul(0xd816_3841)
        ^ k.wrapping_mul(0xcb1a_b31f)
        ^ seed.wrapping_mul(0x9e37_79b9);
    h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
    h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
    h ^= h >> 16;
    h as i32 as f32 / 2_147_483_648.0
}

#[cfg(test)]
mod tests {
    use elk_world::scenery::{Scenery, Solid};

    use super::*;

    fn room() -> World {
        let scenery = Scenery::within(Solid::block("room", [0.0; 3], [4.0, 3.0, 2.0]));
        World::from_triangles("room", scenery.triangles_at(Vector3::zeros())).unwrap()
    }

    fn look() -> Look {
        Look { contrast: 20.0, blank: 0.0, seed: 1 }
    }

    /// The grey levels along a line on a wall, a pixel every `footprint` metres.
    fn line(texture: &Texture, footprint: f64) -> Vec<f32> {
        (0..4000).map(|i| texture.grey(0, Point3::new(0.0, 0.3 + f64::from(i) * footprint, 1.234), footprint)).collect()
    }

    fn deviation(values: &[f32]) -> f32 {
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        (values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / values.len() as f32).sqrt()
    }

    /// Of waves that pixels cannot show nothing is left, and of others something at every distance.
    #[test]
    fn it_is_rich_at_every_distance_and_aliases_at_none() {
        let texture = Texture::new(&room(), &look());
        for footprint in [0.002, 0.005, 0.01, 0.02, 0.05] {
            let line = line(&texture, footprint);
            let steps: Vec<f32> = line.windows(2).map(|pair| pair[1] - pair[0]).collect();
            // Neighbours that have nothing to do with each other differ by √2 as much as each does from the mean.
            let ratio = deviation(&steps) / deviation(&line);
            assert!(deviation(&line) > 8.0, "{footprint}: {}", deviation(&line));
            assert!(ratio < 0.9, "{footprint}: {ratio}");
            assert!(deviation(&steps) > 3.0, "{footprint}: {}", deviation(&steps));
        }
        let far = line(&texture, 2.0);
        assert!(far.iter().all(|grey| *grey == far[0]), "coarser than the coarsest octave");
    }

    #[test]
    fn it_depends_on_place_and_seed_alone() {
        let greys = |seed| line(&Texture::new(&room(), &Look { seed, ..look() }), 0.01);
        assert_eq!(greys(1), greys(1));
        assert_ne!(greys(1), greys(2));
    }

    #[test]
    fn all_triangles_of_a_plane_look_alike_and_so_many_planes_are_blank() {
        let (mut blank, mut planes) = (0, 0);
        for seed in 0..200 {
            let texture = Texture::new(&room(), &Look { blank: 0.3, seed, ..look() });
            let walls = room();
            for (i, one) in walls.surfaces().triangles().iter().enumerate() {
                let is_beside =
                    |other: &Triangle| (one.normal().normalize() - other.normal().normalize()).norm() < 1e-9;
                for (j, _) in walls.surfaces().triangles().iter().enumerate().filter(|(_, other)| is_beside(other)) {
                    let [a, b] = [i, j].map(|index| (texture.paints[index].mean, texture.paints[index].contrast));
                    assert_eq!(a, b, "the room is convex: what looks the same way lies in one plane");
                }
                planes += 1;
                blank += usize::from(texture.paints[i].contrast == 0.0);
            }
        }
        let share = blank as f64 / planes as f64;
        assert!((share - 0.3).abs() < 0.05, "{share}");
    }

    #[test]
    fn noise_is_smooth_and_even() {
        let mut random = Random::new(5, 1);
        let mut sum = 0.0;
        for _ in 0..20_000 {
            let place = Vector3::from_fn(|_, _| random.between(-100.0, 100.0));
            let (here, there) = (noise(place, 7), noise(place + Vector3::new(1e-4, -1e-4, 1e-4), 7));
            assert!(here.abs() <= 1.0 && (here - there).abs() < 2e-3, "{place}: {here} {there}");
            sum += here;
        }
        assert!((sum / 20_000.0).abs() < 0.02, "{sum}");
    }
}
