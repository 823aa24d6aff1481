//! Eight numbers at once.
//!
//! What is written for any [`Lanes`] is compiled for arrays, and on x86-64 for the registers of AVX2, which are taken where the
//! processor has them. The compiler finds vector code in such short rows only by luck. Both do the same operations in the
//! same order, and neither fuses any: results are equal to the bit.

/// Eight numbers.
pub trait Lanes: Copy {
    /// The same number eight times.
    fn splat(number: f32) -> Self;

    /// A row of numbers.
    fn of(row: &[f32; 8]) -> Self;

    /// A row of small whole numbers.
    fn of_bytes(row: &[u8; 8]) -> Self;

    /// The numbers, as a row.
    fn to(self, row: &mut [f32; 8]);

    /// Sums.
    fn plus(self, other: Self) -> Self;

    /// Differences.
    fn minus(self, other: Self) -> Self;

    /// Products.
    fn times(self, other: Self) -> Self;

    /// The numbers where those of `mask` are above 0, and 0 elsewhere.
    fn where_positive(self, mask: Self) -> Self;
}

/// Eight numbers in an array.
impl Lanes for [f32; 8] {
    #[inline(always)]
    fn splat(number: f32) -> Self {
        [number; 8]
    }

    #[inline(always)]
    fn of(row: &[f32; 8]) -> Self {
        *row
    }

    #[inline(always)]
    fn of_bytes(row: &[u8; 8]) -> Self {
        row.map(f32::from)
    }

    #[inline(always)]
    fn to(self, row: &mut [f32; 8]) {
        *row = self;
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] + other[i])
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] - other[i])
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] * other[i])
    }

    #[inline(always)]
    fn where_positive(self, mask: Self) -> Self {
        std::array::from_fn(|i| if mask[i] > 0.0 { self[i] } else { 0.0 })
    }
}

/// Eight numbers in a register of AVX2.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{
        __m256, _CMP_GT_OQ, _mm_loadl_epi64, _mm256_add_ps, _mm256_and_ps, _mm256_cmp_ps, _mm256_cvtepi32_ps,
        _mm256_cvtepu8_epi32, _mm256_loadu_ps, _mm256_mul_ps, _mm256_set1_ps, _mm256_setzero_ps, _mm256_storeu_ps,
        _mm256_sub_ps,
    };

    // SAFETY of all: what is written for lanes is compiled for these by `wide!` only, in functions that are entered only
    // where the processor has AVX2; a row is as long as what is read and written, and need not be aligned.
    impl super::Lanes for __m256 {
        #[inline(always)]
        fn splat(number: f32) -> Self {
            unsafe { _mm256_set1_ps(number) }
        }

        #[inline(always)]
        fn of(row: &[f32; 8]) -> Self {
            unsafe { _mm256_loadu_ps(row.as_ptr()) }
        }

        #[inline(always)]
        fn of_bytes(row: &[u8; 8]) -> Self {
            unsafe { _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(row.as_ptr().cast()))) }
        }

        #[inline(always)]
        fn to(self, row: &mut [f32; 8]) {
            unsafe { _mm256_storeu_ps(row.as_mut_ptr(), self) }
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            unsafe { _mm256_add_ps(self, other) }
        }

        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            unsafe { _mm256_sub_ps(self, other) }
        }

        #[inline(always)]
        fn times(self, other: Self) -> Self {
            unsafe { _mm256_mul_ps(self, other) }
        }

        #[inline(always)]
        fn where_positive(self, mask: Self) -> Self {
            unsafe { _mm256_and_ps(self, _mm256_cmp_ps::<_CMP_GT_OQ>(mask, _mm256_setzero_ps())) }
        }
    }
}

/// A function that is compiled for arrays and for AVX2; its first generic parameter is the [`Lanes`] that it works with.
macro_rules! wide {
    ($(#[$doc:meta])* $vis:vis fn $name:ident [$lanes:ident $(, $other:ident: $bound:path)?] ($($arg:ident: $type:ty),* $(,)?) $(-> $answer:ty)? $body:block) => {
        $(#[$doc])*
        $vis fn $name<$($other: $bound)?>($($arg: $type),*) $(-> $answer)? {
            #[inline(always)]
            fn with<$lanes: crate::domain::lanes::Lanes $(, $other: $bound)?>($($arg: $type),*) $(-> $answer)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2<$($other: $bound)?>($($arg: $type),*) $(-> $answer)? {
                    with::<std::arch::x86_64::__m256 $(, $other)?>($($arg),*)
                }
                if is_x86_feature_detected!("avx2") {
                    // SAFETY: the processor has what the function is compiled for.
                    return unsafe { avx2($($arg),*) };
                }
            }
            with::<[f32; 8] $(, $other)?>($($arg),*)
        }
    };
}
pub(super) use wide;
