//! Writes what two simulated cameras see of the apartment, as a pair of PNGs with its calibration:
//! `cargo run --release -p elk-sensor --example pair -- FOLDER`

use std::fs::File;
use std::path::PathBuf;

use elk_sensor::simulated_stereo::{Eyes, Look, Texture};
use elk_sensor::{AppError, Camera, Pose};
use elk_stereo::Image;
use elk_world::{Placement, World};
use nalgebra::Point3;

fn main() -> Result<(), AppError> {
    let folder: PathBuf = std::env::args_os().nth(1).ok_or("right is: pair FOLDER")?.into();
    std::fs::create_dir_all(&folder)?;
    let world = World::load("apartment", &Placement::default())?;
    let texture = Texture::new(&world, &Look { contrast: 20.0, blank: 0.1, seed: 1 });
    let camera = Camera::new(320, 240, 75_f64.to_radians());
    let eyes = Eyes { camera, baseline_m: 0.12, noise: 1.0, seed: 1 };
    let pose = Pose::from_yaw_pitch(Point3::new(2.2, 3.2, 1.2), -120_f64.to_radians(), -10_f64.to_radians());
    let [left, right] = eyes.render(&world, &texture, &pose, 1)?;
    for (name, image) in [("left.png", &left), ("right.png", &right)] {
        write(&folder.join(name), image)?;
    }
    let matrix = format!("[ {f}, 0., 159.5, 0., {f}, 119.5, 0., 0., 1. ]", f = camera.focal_px);
    let calibration = format!(
        "%YAML:1.0\n---\nimage_width: 320\nimage_height: 240\nM1: !!opencv-matrix\n   data: {matrix}\nD1: !!opencv-matrix\n   \
         data: [ 0., 0., 0., 0. ]\nM2: !!opencv-matrix\n   data: {matrix}\nD2: !!opencv-matrix\n   data: [ 0., 0., 0., 0. ]\n\
         R: !!opencv-matrix\n   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]\nT: !!opencv-matrix\n   data: [ -0.12, 0., 0. ]\n"
    );
    std::fs::write(folder.join("cameras.yaml"), calibration)?;
    Ok(())
}

fn write(path: &std::path::Path, image: &Image) -> Result<(), AppError> {
    let mut encoder = png::Encoder::new(File::create(path)?, image.width() as u32, image.height() as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_compression(png::Compression::Best);
    encoder.write_header()?.write_image_data(image.pixels())?;
    Ok(())
}
