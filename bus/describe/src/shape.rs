//! What a type's bytes are, as a constant that the compiler can hash.

/// What a value is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// Nothing; takes no byte.
    Unit,
    /// A byte, 0 or 1.
    Bool,
    /// An unsigned integer of so many bytes.
    Unsigned(u8),
    /// A signed integer of so many bytes.
    Signed(u8),
    /// A floating-point number of so many bytes: 4 or 8.
    Float(u8),
    /// The x, y, z and w of a quaternion of length one, eight bytes each: a rotation.
    Rotation,
    /// UTF-8 behind its length in bytes.
    Text,
    /// A byte (0: nothing follows, 1: a value does).
    Option(&'static Shape),
    /// Values behind their number.
    List(&'static Shape),
    /// Values of one width behind their length in bytes, as they lie in memory: what is borrowed instead of decoded.
    Packed(&'static Shape),
    /// Bytes behind their number, each of which holds symbols of so many bits, the lowest bits first; the letters that
    /// people read for 0, 1, 2, …; and how many there are at least where a person writes them: those left out are the first
    /// letter.
    Symbols(u8, &'static str, usize),
    /// So many values.
    Array(&'static Shape, usize),
    /// Values of several types.
    Tuple(&'static [Shape]),
    /// A value that something is said of where it has no name: in a newtype, a tuple, or a variant.
    Unnamed(&'static FieldShape),
    /// Fields.
    Struct(&'static StructShape),
    /// One of several variants, behind its number.
    Enum(&'static EnumShape),
}

/// A struct, or a variant with fields.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StructShape {
    /// The type's name.
    pub name: &'static str,
    /// What it means.
    pub docs: &'static str,
    /// As what viewers draw its values; empty: as nothing.
    pub drawn: &'static str,
    /// Its fields, in the order of their bytes.
    pub fields: &'static [FieldShape],
}

/// A field of a struct, or of a tuple or a variant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldShape {
    /// Its name; empty if it has none.
    pub name: &'static str,
    /// What it means.
    pub docs: &'static str,
    /// Its unit; empty if it has none.
    pub unit: &'static str,
    /// What it is for whoever's version of the type does not have it, if it need not be there.
    pub default: Option<DefaultValue>,
    /// What its number may be.
    pub range: RangeShape,
    /// What it is.
    pub shape: Shape,
}

/// What a number may be, as a constant: what `#[describe(range = …)]` says. It is no part of the layout.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeShape {
    /// The least that it may be.
    pub least: Option<Limit>,
    /// The most that it may be.
    pub most: Option<Limit>,
    /// What it has to be less than.
    pub below: Option<Limit>,
}

impl RangeShape {
    /// Whatever there is.
    pub const ALL: Self = Self { least: None, most: None, below: None };
}

/// An end of a range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Limit {
    /// Of an integer.
    Integer(i128),
    /// Of a floating-point number; finite.
    Float(f64),
}

/// A field's default, as a constant: what `#[describe(default = …)]` says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DefaultValue {
    /// Zeros, empty lists and texts, no option, the first variant.
    Zero,
    /// A flag.
    Bool(bool),
    /// A number.
    Integer(i128),
    /// A number.
    Float(f64),
    /// A text, or a variant that holds nothing, by its name.
    Text(&'static str),
    /// The entries of a list, an array or a tuple.
    List(&'static [DefaultValue]),
}

/// An enum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnumShape {
    /// The type's name.
    pub name: &'static str,
    /// What it means.
    pub docs: &'static str,
    /// Its variants, in the order of their numbers.
    pub variants: &'static [VariantShape],
}

/// A variant of an enum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VariantShape {
    /// Its name.
    pub name: &'static str,
    /// What it means.
    pub docs: &'static str,
    /// What follows its number.
    pub content: VariantContent,
}

/// What a variant holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum VariantContent {
    /// Nothing.
    Unit,
    /// A value without a name.
    One(Shape),
    /// Several.
    Tuple(&'static [Shape]),
    /// Fields.
    Fields(&'static [FieldShape]),
}

impl Shape {
    /// A hash of everything that decides what the bytes mean: names, units and shapes, however deep; not the docs,
    /// defaults, nor ranges. Two definitions that differ do not read each other's bytes as they are.
    pub const fn layout(&self) -> u64 {
        self.hash(Fnv::new()).0
    }

    const fn hash(&self, fnv: Fnv) -> Fnv {
        match self {
            Self::Unit => fnv.text("unit"),
            Self::Bool => fnv.text("bool"),
            Self::Unsigned(bytes) => fnv.text("u").byte(*bytes),
            Self::Signed(bytes) => fnv.text("i").byte(*bytes),
            Self::Float(bytes) => fnv.text("f").byte(*bytes),
            Self::Rotation => fnv.text("rotation"),
            Self::Text => fnv.text("text"),
            Self::Option(inner) => inner.hash(fnv.text("option")),
            Self::List(inner) => inner.hash(fnv.text("list")),
            Self::Packed(inner) => inner.hash(fnv.text("packed")),
            Self::Symbols(bits, letters, least) => fnv.text("symbols").byte(*bits).text(letters).count(*least),
            Self::Array(inner, count) => inner.hash(fnv.text("array").count(*count)),
            Self::Tuple(inner) => hash_all(inner, fnv.text("tuple")),
            Self::Unnamed(one) if one.unit.is_empty() => one.shape.hash(fnv),
            Self::Unnamed(one) => one.shape.hash(fnv.text("unnamed").text(one.unit)),
            Self::Struct(one) => hash_fields(one.fields, fnv.text("struct").text(one.name)),
            Self::Enum(EnumShape { name, variants, .. }) => {
                let (mut fnv, mut i) = (fnv.text("enum").text(name).count(variants.len()), 0);
                while i < variants.len() {
                    fnv = fnv.text(variants[i].name);
                    fnv = match &variants[i].content {
                        VariantContent::Unit => fnv.text("unit"),
                        VariantContent::One(one) => one.hash(fnv.text("one")),
                        VariantContent::Tuple(all) => hash_all(all, fnv.text("tuple")),
                        VariantContent::Fields(fields) => hash_fields(fields, fnv.text("fields")),
                    };
                    i += 1;
                }
                fnv
            }
        }
    }
}

const fn hash_all(all: &[Shape], fnv: Fnv) -> Fnv {
    let (mut fnv, mut i) = (fnv.count(all.len()), 0);
    while i < all.len() {
        fnv = all[i].hash(fnv);
        i += 1;
    }
    fnv
}

const fn hash_fields(fields: &[FieldShape], fnv: Fnv) -> Fnv {
    let (mut fnv, mut i) = (fnv.count(fields.len()), 0);
    while i < fields.len() {
        fnv = fields[i].shape.hash(fnv.text(fields[i].name).text(fields[i].unit));
        i += 1;
    }
    fnv
}

/// FNV-1a (Fowler, Noll, Vo), 64 bits; every text ends with a byte that none has in it, so that no two sequences of texts
/// are the same bytes.
#[derive(Clone, Copy)]
pub(crate) struct Fnv(pub(crate) u64);

impl Fnv {
    pub(crate) const fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    pub(crate) const fn byte(self, byte: u8) -> Self {
        Self((self.0 ^ byte as u64).wrapping_mul(0x0100_0000_01b3))
    }

    pub(crate) const fn text(mut self, text: &str) -> Self {
        let (bytes, mut i) = (text.as_bytes(), 0);
        while i < bytes.len() {
            self = self.byte(bytes[i]);
            i += 1;
        }
        self.byte(0xff)
    }

    pub(crate) const fn count(mut self, count: usize) -> Self {
        let (bytes, mut i) = ((count as u64).to_le_bytes(), 0);
        while i < bytes.len() {
            self = self.byte(bytes[i]);
            i += 1;
        }
        self
    }
}
