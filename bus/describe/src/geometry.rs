//! The trait, for what nalgebra has: points and vectors as x, y, z; rotations as x, y, z, w.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::check::each;
use crate::{Describe, FieldShape, Invalid, RangeShape, Shape, StructShape};

/// x, y, z.
impl<T: Describe + nalgebra::Scalar> Describe for Point3<T> {
    const SHAPE: Shape = Shape::Array(&T::SHAPE, 3);

    fn check(&self) -> Result<(), Invalid> {
        each(self.iter())
    }
}

/// x, y, z.
impl<T: Describe + nalgebra::Scalar> Describe for Vector3<T> {
    const SHAPE: Shape = Shape::Array(&T::SHAPE, 3);

    fn check(&self) -> Result<(), Invalid> {
        each(self.iter())
    }
}

/// x, y, z.
impl<T: Describe + nalgebra::Scalar> Describe for Translation3<T> {
    const SHAPE: Shape = Shape::Array(&T::SHAPE, 3);

    fn check(&self) -> Result<(), Invalid> {
        each(self.vector.iter())
    }
}

/// x, y, z, w.
impl<T: Describe + nalgebra::Scalar> Describe for Quaternion<T> {
    const SHAPE: Shape = Shape::Array(&T::SHAPE, 4);

    fn check(&self) -> Result<(), Invalid> {
        each(self.coords.iter())
    }
}

/// x, y, z, w; of length one, but for what people round away.
impl Describe for UnitQuaternion<f64> {
    const SHAPE: Shape = Shape::Rotation;

    fn check(&self) -> Result<(), Invalid> {
        /// What people round to three digits still turns.
        const TOLERANCE: f64 = 1e-3;
        let length = self.as_ref().norm();
        match (length - 1.0).abs() <= TOLERANCE {
            true => Ok(()),
            false => Err(Invalid::new("", format!("a quaternion of length {length}"), "of length 1")),
        }
    }
}

/// A rotation and a translation after it.
impl Describe for Isometry3<f64> {
    const SHAPE: Shape = Shape::Struct(&StructShape {
        name: "Isometry3",
        docs: "A rotation, and a translation after it.",
        drawn: "",
        fields: &[
            FieldShape {
                name: "rotation",
                docs: "x, y, z, w.",
                unit: "",
                default: None,
                range: RangeShape::ALL,
                shape: UnitQuaternion::<f64>::SHAPE,
            },
            FieldShape {
                name: "translation",
                docs: "x, y, z.",
                unit: "m",
                default: None,
                range: RangeShape::ALL,
                shape: Translation3::<f64>::SHAPE,
            },
        ],
    });

    fn check(&self) -> Result<(), Invalid> {
        self.rotation.check().map_err(|inner| inner.within("rotation"))?;
        self.translation.check().map_err(|inner| inner.within("translation"))
    }
}
