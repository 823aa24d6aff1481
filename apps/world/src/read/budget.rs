//! What a file may come to: a few bytes can name a whole mesh again, so that its length alone bounds nothing.

/// The largest file that is read (bytes): five million triangles as binary STL.
pub(crate) const MAX_FILE_BYTES: u64 = 256 << 20;
/// The most triangles of a world, each face counted as those that it can be cut into.
pub(crate) const MOST_TRIANGLES: usize = 1 << 23;
/// The most vertices that faces can name.
pub(crate) const MOST_VERTICES: usize = 3 * MOST_TRIANGLES;
/// The most corners of a polygon: cutting one takes time with their square, at worst.
pub(crate) const MOST_CORNERS: usize = 1 << 15;
/// The most that the squares of all faces' corners come to: that of eight of the largest faces.
const MOST_CUTTING: u64 = 1 << 33;

/// What has been used up of it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Budget {
    triangles: usize,
    cutting: u64,
}

impl Budget {
    /// Sees whether a face may have so many corners.
    ///
    /// # Errors
    /// It has too many.
    pub fn corners(corners: usize) -> Result<(), String> {
        match corners > MOST_CORNERS {
            true => Err(format!("a face has more than {MOST_CORNERS} corners, the most that are read")),
            false => Ok(()),
        }
    }

    /// Counts a face of so many corners; what has no triangle, or is no face, counts as one triangle.
    ///
    /// # Errors
    /// It is one too many, or has too many corners.
    pub fn face(&mut self, corners: usize) -> Result<(), String> {
        self.triangles += corners.saturating_sub(2).max(1);
        self.cutting += (corners as u64).pow(2);
        Self::corners(corners)?;
        match () {
            () if self.triangles > MOST_TRIANGLES => Err(format!(
                "here it comes to more than {MOST_TRIANGLES} triangles, the most that are read: export less of it"
            )),
            () if self.cutting > MOST_CUTTING => {
                Err("here its large faces come to more than can be cut into triangles: export it with triangles"
                    .to_owned())
            }
            () => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(budget: &mut Budget, corners: usize, times: usize) -> Option<String> {
        (0..times).find_map(|_| budget.face(corners).err())
    }

    #[test]
    fn faces_count_as_the_triangles_that_they_can_be_cut_into() {
        for (corners, most) in [(0, MOST_TRIANGLES), (3, MOST_TRIANGLES), (4, MOST_TRIANGLES / 2), (258, 1 << 15)] {
            let mut budget = Budget::default();
            assert_eq!(said(&mut budget, corners, most), None, "{corners}");
            assert!(said(&mut budget, corners, 1).unwrap().contains("more than 8388608 triangles"), "{corners}");
        }
    }

    #[test]
    fn large_faces_count_more() {
        assert_eq!(said(&mut Budget::default(), MOST_CORNERS, 8), None);
        assert!(said(&mut Budget::default(), MOST_CORNERS, 9).unwrap().contains("large faces"));
        assert!(said(&mut Budget::default(), MOST_CORNERS + 1, 1).unwrap().contains("more than 32768 corners"));
    }
}
