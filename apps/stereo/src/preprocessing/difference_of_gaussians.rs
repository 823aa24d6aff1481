use crate::image::Image;
use crate::lanes::wide;

/// The ratio of the two σ at which a difference of Gaussians is nearest to the Laplacian of one (thesis 3.2.4.3).
const RATIO: f32 = 1.6;

/// (G(σ) − G(1.6 σ)) ∗ I, the difference of Gaussians of thesis 3.25 and 3.26 (with its sign turned, so that bright spots stay
/// bright), times `gain`; 128 stands for none. `sigma` in pixels.
pub fn difference_of_gaussians(image: &Image, sigma: f32, gain: f32) -> Image {
    let [small, large] = [sigma, RATIO * sigma].map(|sigma| smoothed(image, &Kernel::gaussian(sigma)));
    let scale = gain / ONE as f32;
    let pixel = |(&small, &large): (&i32, &i32)| (128.0 + (small - large) as f32 * scale).clamp(0.0, 255.0) as u8;
    let pixels = small.iter().zip(&large).map(pixel).collect();
    image.with_pixels(pixels)
}

/// What stands for 1 after both passes: kernels are of 7 bits each, so that 8 bits of grey through one of them fit 16.
const ONE: i32 = 1 << (2 * Kernel::BITS);

/// One dimension of a separable kernel.
struct Kernel {
    /// 2 r + 1 weights, which sum up to 2^BITS.
    weights: Vec<i16>,
}

impl Kernel {
    const BITS: u32 = 7;

    /// A Gaussian (thesis 3.19) cut off at 3 σ; what is left over by rounding goes to its middle.
    fn gaussian(sigma: f32) -> Self {
        let radius = (3.0 * sigma).ceil().max(1.0) as i32;
        let weight = |i: i32| (-((i * i) as f32) / (2.0 * sigma * sigma)).exp();
        let sum: f32 = (-radius..=radius).map(weight).sum();
        let whole = 1i16 << Self::BITS;
        let mut weights: Vec<i16> =
            (-radius..=radius).map(|i| (weight(i) / sum * f32::from(whole)).round() as i16).collect();
        weights[radius as usize] += whole - weights.iter().sum::<i16>();
        Self { weights }
    }

    fn radius(&self) -> usize {
        self.weights.len() / 2
    }
}

wide! {
    /// The image, smoothed along columns and then along rows, times [`ONE`].
    fn smoothed(image: &Image, kernel: &Kernel) -> Vec<i32> {
        let (width, height, radius) = (image.width(), image.height(), kernel.radius());
        let mut smooth = vec![0i32; width * height];
        // As many columns more on each side as the kernel reaches, which are those of the border.
        let mut columns = vec![0i16; width + 2 * radius];
        for (y, smooth) in smooth.chunks_exact_mut(width).enumerate() {
            columns.fill(0);
            for (k, &weight) in kernel.weights.iter().enumerate() {
                let row = image.nearest_row(y as isize + k as isize - radius as isize);
                columns[radius..].iter_mut().zip(row).for_each(|(sum, &grey)| *sum += weight * i16::from(grey));
            }
            let (first, last) = (columns[radius], columns[radius + width - 1]);
            columns[..radius].fill(first);
            columns[radius + width..].fill(last);
            for (k, &weight) in kernel.weights.iter().enumerate() {
                let weight = i32::from(weight);
                smooth.iter_mut().zip(&columns[k..]).for_each(|(sum, &column)| *sum += weight * i32::from(column));
            }
        }
        smooth
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_even_is_nothing_and_a_spot_is_a_hat() {
        let even = Image::from_fn(20, 20, |_, _| 200).unwrap();
        assert!(difference_of_gaussians(&even, 0.7, 8.0).pixels().iter().all(|&grey| grey == 128));

        let spot = Image::from_fn(21, 21, |row, column| if (row, column) == (10, 10) { 255 } else { 0 }).unwrap();
        let hat = difference_of_gaussians(&spot, 1.0, 2.0);
        // (3.25) at the middle: 1/2π − 1/(2π 1.6²) = 0.097 of 255, twice; a ring around it is darker.
        let middle = f32::from(hat.row(10)[10]) - 128.0;
        assert!((middle - 2.0 * 255.0 * 0.0970).abs() < 6.0, "{middle}");
        assert!(hat.row(10)[13] < 128 && hat.row(13)[10] == hat.row(10)[13], "{:?}", hat.row(10));
    }

    #[test]
    fn a_kernel_takes_nothing_away() {
        for sigma in [0.1, 0.7, 1.12, 5.0, 12.8] {
            let kernel = Kernel::gaussian(sigma);
            assert_eq!(kernel.weights.iter().map(|&weight| i32::from(weight)).sum::<i32>(), 128, "σ = {sigma}");
            assert!(kernel.weights.iter().all(|&weight| weight >= 0), "σ = {sigma}: {:?}", kernel.weights);
        }
    }
}
