use crate::image::Image;

/// The bilateral filter (thesis 3.17): each pixel becomes a mean of the (2 `radius` + 1)² around it, weighed by how near they are,
/// with `sigma_domain` in pixels (3.16), and by how alike, with `sigma_range` in grey levels (3.15); so noise is smoothed and edges
/// stay.
///
/// Both weights are Gaussian, as the thesis says in words; its (3.16) lacks two squares.
pub fn bilateral(image: &Image, radius: usize, sigma_domain: f32, sigma_range: f32) -> Image {
    let gaussian = |squared: f32, sigma: f32| (-squared / (2.0 * sigma * sigma)).exp();
    let alike: Vec<f32> = (0..256).map(|apart| gaussian((apart * apart) as f32, sigma_range)).collect();
    let r = radius as isize;
    let around: Vec<(isize, isize, f32)> = (-r..=r)
        .flat_map(|dy| (-r..=r).map(move |dx| (dy, dx)))
        .map(|(dy, dx)| (dy, dx, gaussian((dy * dy + dx * dx) as f32, sigma_domain)))
        .collect();
    let last = image.width() as isize - 1;
    let pixel = |row: usize, column: usize| {
        let center = image.row(row)[column];
        let (mut sum, mut weights) = (0.0, 0.0);
        for &(dy, dx, near) in &around {
            let grey = image.nearest_row(row as isize + dy)[(column as isize + dx).clamp(0, last) as usize];
            let weight = near * alike[usize::from(grey.abs_diff(center))];
            sum += weight * f32::from(grey);
            weights += weight;
        }
        (sum / weights).round() as u8
    };
    let pixel = &pixel;
    let pixels = (0..image.height()).flat_map(|row| (0..image.width()).map(move |column| pixel(row, column)));
    image.with_pixels(pixels.collect())
}

/// What the filter takes away, times `gain`; 128 stands for none. So the thesis' source uses the filter (Ansar, Castano and Matthies,
/// *Enhanced Real-time Stereo Using Bilateral Filtering*, 3DPVT 2004): smoothed images alone would differ as the cameras do, while what
/// was smoothed away of both is alike.
pub fn background_subtracted(image: &Image, radius: usize, sigma_domain: f32, sigma_range: f32, gain: f32) -> Image {
    let background = bilateral(image, radius, sigma_domain, sigma_range);
    let pixel = |(&grey, &background): (&u8, &u8)| {
        (128.0 + gain * (f32::from(grey) - f32::from(background))).clamp(0.0, 255.0) as u8
    };
    image.with_pixels(image.pixels().iter().zip(background.pixels()).map(pixel).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smoothed_and_an_edge_stays() {
        // Two sides 100 grey levels apart, with a pattern of ±4 on both.
        let pattern = |row: usize, column: usize| if (row * 7 + column * 5).is_multiple_of(3) { 4 } else { 0 };
        let side = |column: usize| if column < 10 { 50 } else { 150 };
        let image = Image::from_fn(20, 20, |row, column| (side(column) + pattern(row, column)) as u8).unwrap();
        let filtered = bilateral(&image, 3, 10.0, 5.0);
        for row in 3..17 {
            for (column, &grey) in filtered.row(row).iter().enumerate().skip(3).take(14) {
                let mean = side(column) as f32 + 4.0 / 3.0;
                assert!((f32::from(grey) - mean).abs() <= 1.5, "row {row}, column {column}: {grey}, {mean}");
            }
        }
    }

    #[test]
    fn without_its_background_an_image_is_as_bright_anywhere() {
        let pattern = |row: usize, column: usize| (row * 7 + column * 5) % 3 * 4;
        let image =
            |bright: usize| Image::from_fn(20, 20, |row, column| (bright + pattern(row, column)) as u8).unwrap();
        let [dark, light] = [image(20), image(200)].map(|image| background_subtracted(&image, 3, 10.0, 5.0, 4.0));
        assert_eq!(dark, light);
        assert!(dark.pixels().iter().any(|&grey| grey >= 136) && dark.pixels().iter().any(|&grey| grey <= 120));
    }
}
