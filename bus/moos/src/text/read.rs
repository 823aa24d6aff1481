//! A text as a value.

use std::collections::BTreeMap;

use elk_describe::{Content, Field, Kind, Struct, shown};
use serde_json::{Map, Number, Value};

use super::keys::{NAME, TIME, VALUE, has_field, joined, key, plain, width};
use super::pose;
use super::write::is_nothing_itself;

/// The most keys of a text.
const MOST_KEYS: usize = 1024;
/// Keys of a type that an error lists.
const LISTED: usize = 20;

/// What a text says.
#[derive(Debug, Clone, PartialEq)]
pub struct Read {
    /// The value's bytes.
    pub bytes: Vec<u8>,
    /// When it was so (s), if the text says that.
    pub time: Option<f64>,
}

/// What a text says, its value as JSON.
#[derive(Debug)]
pub struct Said {
    pub json: Value,
    pub time: Option<f64>,
}

/// What a text of `variable` says of a value of this kind.
///
/// # Errors
/// Which key is wrong, and what would be right.
pub fn read(kind: &Kind, variable: &str, text: &str) -> Result<Said, String> {
    let mut reader = Reader(pairs(text)?);
    if !has_field(kind, NAME)
        && let Some(name) = reader.take(NAME)
        && text_of(NAME, name)? != variable
    {
        return Err(format!("{NAME} is {}; the message is of {variable}", short(name)));
    }
    let time = if has_field(kind, TIME) { None } else { reader.take(TIME) };
    let time = time.map(|said| match said.parse::<f64>() {
        Ok(time) if time.is_finite() => Ok(time),
        _ => Err(format!("{TIME} is {}; it has to be a number, in s", short(said))),
    });
    let time = time.transpose()?;
    let json = match kind.plain() {
        Kind::Struct(one) => reader.fields(&one.fields, "")?,
        _ => reader.value(kind, VALUE)?,
    };
    match reader.0.into_values().find(|pair| !pair.taken) {
        None => Ok(Said { json, time }),
        Some(Pair { key, .. }) => Err(format!("there is no {}; its keys are {}", short(key), listed(kind))),
    }
}

/// A key as it stands there, and its value.
struct Pair<'a> {
    key: &'a str,
    value: &'a str,
    taken: bool,
}

/// The pairs of a text by their keys in plain letters.
fn pairs(text: &str) -> Result<BTreeMap<String, Pair<'_>>, String> {
    let mut pairs = BTreeMap::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        let (key, behind) = rest.split_once('=').ok_or_else(|| format!("{} is no Key=Value", short(rest)))?;
        let key = key.trim();
        let (value, behind) = behind.split_at(value_end(behind));
        if pairs.insert(plain(key), Pair { key, value: value.trim(), taken: false }).is_some() {
            return Err(format!("{} is said twice", short(key)));
        }
        if pairs.len() > MOST_KEYS {
            return Err(format!("it has more than {MOST_KEYS} keys"));
        }
        rest = behind.strip_prefix(',').unwrap_or(behind).trim_start();
    }
    Ok(pairs)
}

/// Where a value ends: at a comma that lies neither in brackets nor in quotes. Quotes within a text that does not begin with
/// them are letters.
fn value_end(text: &str) -> usize {
    let (mut depth, mut quoted, mut escaped, mut begun) = (0usize, false, false, false);
    for (at, letter) in text.char_indices() {
        match letter {
            _ if escaped => escaped = false,
            '\\' if quoted => escaped = true,
            '"' if quoted || depth > 0 || !begun => quoted = !quoted,
            _ if quoted => {}
            '{' | '[' => depth += 1,
            '}' | ']' => depth = depth.saturating_sub(1),
            ',' if depth == 0 => return at,
            _ => {}
        }
        begun |= !letter.is_whitespace();
    }
    text.len()
}

struct Reader<'a>(BTreeMap<String, Pair<'a>>);

impl<'a> Reader<'a> {
    fn take(&mut self, way: &str) -> Option<&'a str> {
        let pair = self.0.get_mut(&plain(way))?;
        pair.taken = true;
        Some(pair.value)
    }

    fn need(&mut self, way: &str, wanted: impl FnOnce() -> String) -> Result<&'a str, String> {
        self.take(way).ok_or_else(|| format!("{way} is missing; it has to be {}", wanted()))
    }

    /// Whether something is said of what lies at or under a key.
    fn has(&self, way: &str) -> bool {
        let way = plain(way);
        let under = format!("{way}.");
        self.0.contains_key(&way)
            || self.0.range(under.clone()..).next().is_some_and(|(key, _)| key.starts_with(&under))
    }

    fn fields(&mut self, fields: &[Field], way: &str) -> Result<Value, String> {
        let mut object = Map::new();
        for field in fields {
            let way = joined(way, &key(&field.name));
            // One with a default may be left out.
            if field.default.is_none() || self.has(&way) {
                object.insert(field.name.clone(), self.value(&field.kind, &way)?);
            }
        }
        Ok(object.into())
    }

    fn value(&mut self, kind: &Kind, way: &str) -> Result<Value, String> {
        match kind {
            Kind::Unnamed(one) => self.value(&one.kind, way),
            Kind::Option(inner) if !is_nothing_itself(inner) => match self.has(way) {
                true => self.value(inner, way),
                false => Ok(Value::Null),
            },
            Kind::Struct(one) => match (width(kind), self.take(way)) {
                // What is nothing but numbers may be said as these.
                (Some(_), Some(said)) => match in_plane(said).and_then(|numbers| pose::in_space(one, numbers)) {
                    Some(pose) => Ok(pose),
                    None => matrix(kind, way, said).map_err(|error| format!("{error}, or {}", others(one, way))),
                },
                (None, Some(_)) => {
                    Err(format!("{way} has no value of its own; right is {}", keys_of(&one.fields, way)))
                }
                (_, None) => self.fields(&one.fields, way),
            },
            Kind::Enum(one) => {
                let names = || one.variants.iter().map(|one| one.name.as_str()).collect::<Vec<_>>().join(", ");
                let said = self.need(way, || format!("one of {}", names()))?;
                let variant = one.variants.iter().find(|variant| plain(&variant.name) == plain(said));
                let variant =
                    variant.ok_or_else(|| format!("{way} is {}; it has to be one of {}", short(said), names()))?;
                let way = joined(way, &variant.name);
                let content = match &variant.content {
                    Content::Unit => return Ok(variant.name.as_str().into()),
                    Content::One(inner) => self.value(inner, &way)?,
                    Content::Tuple(_) => json(&way, self.need(&way, || "JSON".into())?)?,
                    Content::Fields(fields) => self.fields(fields, &way)?,
                };
                Ok(Map::from_iter([(variant.name.clone(), content)]).into())
            }
            _ => {
                let said = self.need(way, || wanted(kind))?;
                leaf(kind, way, said)
            }
        }
    }
}

/// A value that stands at one key.
fn leaf(kind: &Kind, way: &str, said: &str) -> Result<Value, String> {
    let wrong = || format!("{way} is {}; it has to be {}", short(said), wanted(kind));
    match kind {
        Kind::Bool => match said.to_ascii_lowercase().as_str() {
            "true" => Ok(true.into()),
            "false" => Ok(false.into()),
            _ => Err(wrong()),
        },
        Kind::Unsigned(_) | Kind::Signed(_) | Kind::Float(_) => number(kind, said).ok_or_else(wrong),
        Kind::Text | Kind::Symbols { .. } => text_of(way, said).map(Value::from),
        Kind::List(inner) | Kind::Packed(inner) if width(inner).is_some() => matrix(kind, way, said),
        _ if width(kind).is_some() => matrix(kind, way, said),
        _ => json(way, said),
    }
}

fn json(way: &str, said: &str) -> Result<Value, String> {
    serde_json::from_str(said).map_err(|error| format!("{way} is {}; it has to be JSON: {error}", short(said)))
}

/// A text without its quotes, if it has any.
fn text_of(way: &str, said: &str) -> Result<String, String> {
    match said.starts_with('"') {
        true => serde_json::from_str(said).map_err(|error| format!("{way} is {}: {error}", short(said))),
        false => Ok(said.to_owned()),
    }
}

/// A number. Whole ones may be said as others are: `3.000`.
fn number(kind: &Kind, said: &str) -> Option<Value> {
    /// Beyond it a double does not tell whole numbers apart.
    const EXACT: f64 = 9_007_199_254_740_992.0;
    if let Ok(number) = said.parse::<u64>() {
        return Some(number.into());
    }
    if let Ok(number) = said.parse::<i64>() {
        return Some(number.into());
    }
    let number = said.parse::<f64>().ok()?;
    match kind {
        Kind::Float(_) => Some(Number::from_f64(number).map_or_else(|| number.to_string().into(), Value::Number)),
        _ if number.fract() == 0.0 && number.abs() <= EXACT => Some((number as i64).into()),
        _ => None,
    }
}

/// `[rows x columns]{…}`: the numbers of one value, or of a list of such.
fn matrix(kind: &Kind, way: &str, said: &str) -> Result<Value, String> {
    let wrong = |why: &str| format!("{way} is {}{why}; it has to be {}", short(said), wanted(kind));
    let (rows, columns, numbers) = parts(said).ok_or_else(|| wrong(""))?;
    if rows.checked_mul(columns) != Some(numbers.len()) {
        return Err(wrong(&format!(", with {} numbers", numbers.len())));
    }
    let (inner, each) = match kind {
        Kind::List(inner) | Kind::Packed(inner) => (Some(&**inner), width(inner).unwrap_or(1)),
        _ => (None, width(kind).unwrap_or(1)),
    };
    let is_right = match inner {
        // A list of numbers may lie as well as stand.
        Some(_) => columns == each || (each == 1 && rows == 1) || numbers.is_empty(),
        None => numbers.len() == each,
    };
    if !is_right {
        return Err(wrong(""));
    }
    let mut numbers = numbers.into_iter();
    let mut next =
        |kind: &Kind| shape(kind, &mut numbers).map_err(|odd| wrong(&format!(", in which {odd} is no such number")));
    match inner {
        Some(inner) => (0..rows * columns / each).map(|_| next(inner)).collect(),
        None => next(kind),
    }
}

/// The numbers of a pose in the plane, if it is said as one.
fn in_plane(said: &str) -> Option<[f64; pose::NUMBERS]> {
    let (rows, columns, numbers) = parts(said)?;
    let numbers: Vec<f64> = numbers.into_iter().map(|number| number.parse().ok()).collect::<Option<_>>()?;
    (rows.min(columns) == 1 && rows.max(columns) == pose::NUMBERS).then_some(())?;
    numbers.try_into().ok()
}

/// What else than all of its numbers a struct may be said as.
fn others(one: &Struct, way: &str) -> String {
    let in_plane = if pose::names(one).is_some() { "[3x1]{x,y,heading}, or " } else { "" };
    format!("{in_plane}{}", keys_of(&one.fields, way))
}

/// Rows, columns and numbers of a matrix as it is written.
fn parts(said: &str) -> Option<(usize, usize, Vec<&str>)> {
    let (size, numbers) = said.strip_prefix('[')?.split_once(']')?;
    let (rows, columns) = size.split_once(['x', 'X'])?;
    let numbers = numbers.trim().strip_prefix('{')?.strip_suffix('}')?.trim();
    let numbers = if numbers.is_empty() { Vec::new() } else { numbers.split(',').map(str::trim).collect() };
    Some((rows.trim().parse().ok()?, columns.trim().parse().ok()?, numbers))
}

/// A value of the next numbers; or the one that is none.
fn shape<'a>(kind: &Kind, numbers: &mut impl Iterator<Item = &'a str>) -> Result<Value, String> {
    let one = |kind: &Kind, numbers: &mut dyn Iterator<Item = &'a str>| {
        let said = numbers.next().unwrap_or_default();
        number(kind, said).ok_or_else(|| short(said))
    };
    match kind {
        Kind::Unnamed(inner) => shape(&inner.kind, numbers),
        Kind::Rotation => (0..4).map(|_| one(&Kind::Float(8), numbers)).collect(),
        Kind::Array { of, count } => (0..*count).map(|_| shape(of, numbers)).collect(),
        Kind::Tuple(kinds) => kinds.iter().map(|kind| shape(kind, numbers)).collect(),
        Kind::Struct(inner) => {
            let fields = inner.fields.iter().map(|field| Ok((field.name.clone(), shape(&field.kind, numbers)?)));
            fields.collect::<Result<Map<_, _>, _>>().map(Value::Object)
        }
        _ => one(kind, numbers),
    }
}

/// What would be right for a value that stands at one key.
fn wanted(kind: &Kind) -> String {
    match kind {
        Kind::Bool => "true or false".into(),
        Kind::Unsigned(_) => "a whole number from 0 on".into(),
        Kind::Signed(_) => "a whole number".into(),
        Kind::Float(_) => "a number".into(),
        Kind::Text => "a text".into(),
        Kind::Symbols { letters, .. } => format!("a text of the letters {letters}"),
        Kind::List(inner) | Kind::Packed(inner) => match width(inner) {
            Some(width) => format!("[Nx{width}]{{…}}, for N of them"),
            None => "a list, as JSON".into(),
        },
        _ => match width(kind) {
            Some(width) => format!("[{width}x1]{{…}}"),
            None => "JSON".into(),
        },
    }
}

/// The keys of fields.
fn keys_of(fields: &[Field], way: &str) -> String {
    fields.iter().map(|field| joined(way, &key(&field.name))).collect::<Vec<_>>().join(" and ")
}

/// The keys of a type, for who has said another one.
fn listed(kind: &Kind) -> String {
    let mut keys = Vec::new();
    match kind.plain() {
        Kind::Struct(one) => list(&one.fields, "", &mut keys),
        _ => keys.push(VALUE.to_owned()),
    }
    let more = if keys.len() > LISTED { ", …" } else { "" };
    keys.truncate(LISTED);
    format!("{}{more}", keys.join(", "))
}

fn list(fields: &[Field], way: &str, keys: &mut Vec<String>) {
    for field in fields {
        let way = joined(way, &key(&field.name));
        match field.kind.plain() {
            Kind::Struct(one) => list(&one.fields, &way, keys),
            _ => keys.push(way),
        }
    }
}

/// The beginning of what was said.
fn short(said: &str) -> String {
    shown(&Value::from(said))
}
