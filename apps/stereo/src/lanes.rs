//! Sixteen costs at a time. The compiler makes vector instructions of these functions where each takes and gives whole arrays
//! by value; of the same loops over slices it made branches. The crate `wide`, of which costs of 8 bits are made elsewhere, chooses
//! its instructions when it is compiled, and those that all x86-64 processors have (SSE2) know no least of unsigned words.

use std::array::from_fn;

/// How many costs are worked on at a time; the number of levels of a search is a multiple of it.
pub(crate) const LANES: usize = 16;

/// Sixteen numbers of 16 bits.
pub(crate) type Words = [u16; LANES];
/// Sixteen numbers of 8 bits.
pub(crate) type Bytes = [u8; LANES];

/// A slice in blocks of sixteen; what is left over is left out.
#[inline(always)]
pub(crate) fn blocks<T>(slice: &[T]) -> &[[T; LANES]] {
    slice.as_chunks().0
}

/// The same, to be written.
#[inline(always)]
pub(crate) fn blocks_mut<T>(slice: &mut [T]) -> &mut [[T; LANES]] {
    slice.as_chunks_mut().0
}

#[inline(always)]
pub(crate) fn plus(a: Words, b: Words) -> Words {
    from_fn(|i| a[i].wrapping_add(b[i]))
}

#[inline(always)]
pub(crate) fn minus(a: Words, b: Words) -> Words {
    from_fn(|i| a[i].wrapping_sub(b[i]))
}

#[inline(always)]
pub(crate) fn min(a: Words, b: Words) -> Words {
    from_fn(|i| a[i].min(b[i]))
}

#[inline(always)]
pub(crate) fn max(a: Words, b: Words) -> Words {
    from_fn(|i| a[i].max(b[i]))
}

#[inline(always)]
pub(crate) fn or(a: Words, b: Words) -> Words {
    from_fn(|i| a[i] | b[i])
}

/// All bits where `a` is less than `b`, none elsewhere.
#[inline(always)]
pub(crate) fn less(a: Words, b: Words) -> Words {
    from_fn(|i| if a[i] < b[i] { u16::MAX } else { 0 })
}

/// All bits where the two differ, none elsewhere.
#[inline(always)]
pub(crate) fn differs(a: Words, b: Words) -> Words {
    from_fn(|i| if a[i] != b[i] { u16::MAX } else { 0 })
}

/// `a` where the mask has all bits, `b` where it has none.
#[inline(always)]
pub(crate) fn pick(mask: Words, a: Words, b: Words) -> Words {
    from_fn(|i| a[i] & mask[i] | b[i] & !mask[i])
}

/// The bytes as words.
#[inline(always)]
pub(crate) fn words(bytes: Bytes) -> Words {
    from_fn(|i| u16::from(bytes[i]))
}

/// |a − b| of bytes.
#[inline(always)]
pub(crate) fn apart(a: Bytes, b: Bytes) -> Bytes {
    from_fn(|i| a[i].max(b[i]) - a[i].min(b[i]))
}

/// The least of all.
#[inline(always)]
pub(crate) fn least(words: Words) -> u16 {
    words.into_iter().fold(u16::MAX, u16::min)
}

/// A function that is compiled for all processors and, on x86-64, for those with AVX2 as well. What it calls has to be inlined
/// into it (`#[inline(always)]`) to be compiled so, too.
macro_rules! wide {
    ($(#[$doc:meta])* $vis:vis fn $name:ident($($arg:ident: $type:ty),* $(,)?) $(-> $answer:ty)? $body:block) => {
        $(#[$doc])*
        $vis fn $name($($arg: $type),*) $(-> $answer)? {
            #[inline(always)]
            fn with($($arg: $type),*) $(-> $answer)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2($($arg: $type),*) $(-> $answer)? {
                    with($($arg),*)
                }
                if is_x86_feature_detected!("avx2") {
                    // SAFETY: the processor has what the function is compiled for.
                    return unsafe { avx2($($arg),*) };
                }
            }
            with($($arg),*)
        }
    };
}
pub(crate) use wide;
