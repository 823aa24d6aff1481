//! Wavefront OBJ: vertices (`v`) and faces (`f`). What has no depth is passed over; what has, or is not known, is
//! counted.

use nalgebra::Point3;

use crate::read::budget::MOST_CORNERS;
use crate::read::fault::{Fault, Location};
use crate::read::mesh::Mesh;
use crate::read::soup::Soup;
use crate::read::text;

/// Statements whose end may be anything, a `\` included: names of objects, groups, materials and files.
const NAMES: [&[u8]; 6] = [b"o", b"g", b"usemtl", b"mtllib", b"usemap", b"maplib"];

/// Statements besides [`NAMES`] that have no depth: coordinates of textures, lines, how it is drawn, what belongs to a free form.
const WITHOUT_DEPTH: [&[u8]; 27] = [
    b"vt",
    b"vn",
    b"vp",
    b"p",
    b"l",
    b"s",
    b"mg",
    b"lod",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"shadow_obj",
    b"trace_obj",
    b"ctech",
    b"stech",
    b"cstype",
    b"deg",
    b"bmat",
    b"step",
    b"parm",
    b"trim",
    b"hole",
    b"scrv",
    b"sp",
    b"end",
    b"con",
    b"res",
];
/// Curves and surfaces that are given by formulas, in today's words and those of old.
const FREE_FORMS: [&[u8]; 7] = [b"surf", b"curv", b"curv2", b"bzp", b"bsp", b"cdc", b"cdp"];

/// Words of a statement that are kept: its keyword, and one corner more than a face may have.
const MOST_WORDS: usize = MOST_CORNERS + 2;

/// A word and the line that it stands in.
type Word<'a> = (usize, &'a [u8]);

struct Obj<'a> {
    mesh: Mesh,
    soup: &'a mut Soup,
}

/// Reads all faces.
pub(crate) fn read(bytes: &[u8], soup: &mut Soup) -> Result<(), Fault> {
    let mut obj = Obj { mesh: Mesh::new(Location::Line, 1), soup };
    let decoded = text::ascii_compatible(bytes);
    let mut statement: Vec<Word> = Vec::new();
    for (number, line) in text::lines(&decoded) {
        let (words, goes_on) = parts(line, statement.first());
        let left = MOST_WORDS - statement.len();
        statement.extend(text::words(words).take(left).map(|word| (number, word)));
        if !goes_on {
            obj.take(&statement)?;
            statement.clear();
        }
    }
    obj.take(&statement)?;
    obj.mesh.put_into(obj.soup)
}

/// A line without its comment and its `\`, and whether the next one belongs to it. A comment begins with the line or
/// after a space: `1.#QNAN` is none.
fn parts<'a>(line: &'a [u8], first: Option<&Word>) -> (&'a [u8], bool) {
    let comment = (0..line.len()).find(|&i| line[i] == b'#' && (i == 0 || line[i - 1].is_ascii_whitespace()));
    let words = line[..comment.unwrap_or(line.len())].trim_ascii_end();
    let keyword = first.map(|(_, word)| *word).or_else(|| text::words(words).next());
    let is_name = keyword.is_some_and(|keyword| NAMES.contains(&keyword));
    match words.strip_suffix(b"\\") {
        Some(rest) if comment.is_none() && !is_name => (rest, true),
        _ => (words, false),
    }
}

impl Obj<'_> {
    fn take(&mut self, statement: &[Word]) -> Result<(), Fault> {
        match statement.split_first() {
            Some(((line, b"v"), numbers)) => self.vertex(*line, numbers),
            Some(((line, b"f" | b"fo"), corners)) => self.face(*line, corners),
            Some((first, _)) => {
                self.leave_out(*first);
                Ok(())
            }
            None => Ok(()),
        }
    }

    fn leave_out(&mut self, (line, keyword): Word) {
        let what = match keyword {
            known if WITHOUT_DEPTH.contains(&known) || NAMES.contains(&known) => return,
            form if FREE_FORMS.contains(&form) => "free-form curves or surfaces are left out",
            b"call" | b"csh" => "statements that fetch another file or run a program are left out",
            _ => "statements that OBJ does not know are left out",
        };
        self.soup.notice(what, 1, &text::shown(keyword), || Location::Line(line));
    }

    /// `v x y z`; what follows is a weight or a colour.
    fn vertex(&mut self, line: usize, numbers: &[Word]) -> Result<(), Fault> {
        let coordinate = |axis: usize| match numbers.get(axis) {
            Some((line, word)) => text::number(word).map_err(|what| Fault::line(*line, what)),
            None => {
                let found = numbers.len();
                Err(Fault::line(line, format_args!("a vertex has {found} of three coordinates; right is `v x y z`")))
            }
        };
        self.mesh.vertex(line, Point3::new(coordinate(0)?, coordinate(1)?, coordinate(2)?))
    }

    /// `f a b c …`, each corner a vertex, perhaps with `/texture/normal`.
    fn face(&mut self, line: usize, corners: &[Word]) -> Result<(), Fault> {
        if corners.is_empty() {
            return Err(Fault::line(line, "a face has no corners; right is `f 1 2 3`, the numbers of its vertices"));
        }
        for (line, word) in corners {
            let index = self.index(word).map_err(|what| Fault::line(*line, what))?;
            self.mesh.corner(*line, index)?;
        }
        self.mesh.end_face(line)
    }

    /// The index, from 0, of a corner's vertex: counted from 1, or back from the last one so far.
    fn index(&self, word: &[u8]) -> Result<u64, String> {
        let vertex = word.split(|&byte| byte == b'/').next().unwrap_or_default();
        let number = std::str::from_utf8(vertex).ok().and_then(|text| text.parse::<i64>().ok());
        let so_far = self.mesh.vertices() as u64;
        let index = match number {
            Some(0) => Err("vertices are counted from 1; there is no 0".to_owned()),
            Some(back @ ..0) => so_far
                .checked_sub(back.unsigned_abs())
                .ok_or_else(|| format!("there are {so_far} vertices before this face")),
            Some(number @ 1..) => Ok(number.unsigned_abs() - 1),
            None => Err("right is the number of a vertex, for example 7 or 7/1/3".to_owned()),
        };
        index.map_err(|right| format!("a face has the corner {}; {right}", text::shown(word)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<Soup, String> {
        let mut soup = Soup::default();
        match read(text.as_bytes(), &mut soup) {
            Ok(()) => Ok(soup),
            Err(fault) => Err(format!("w.obj{}: {}", fault.location, fault.what)),
        }
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn a_statement_goes_on_behind_a_backslash_but_no_comment_and_no_name_does() {
        let plain = of(&format!("{SQUARE}f 1 2 3 4\n")).unwrap().triangles;
        for same in [
            "f 1 2 \\\n3 4\n",
            "f 1 2 \\ \r\n 3 \\\r\n4",
            "f \\\n\\\n1 2 3 4\\",
            "# C:\\models\\\nf 1 2 3 4",
            "mtllib C:\\models\\\nf 1 2 3 4\n",
            "f 1 2 # two of them \\\nf 1 2 3 4",
            "f 1/1/1 2//1 3/1 4 # all",
            "f -4 -3 -2 -1",
            "fo 1 2 3 4\nl 1 2 \\\n3\nf 1 1 2",
        ] {
            assert_eq!(of(&format!("{SQUARE}{same}")).unwrap().triangles, plain, "{same:?}");
        }
        assert_eq!(of(&format!("f 1 2 3 4\n\u{feff}{SQUARE}")).unwrap().triangles, plain, "faces first");
    }

    #[test]
    fn every_mistake_has_its_line() {
        let says = |more: &str| of(&format!("{SQUARE}{more}")).unwrap_err();
        assert_eq!(says("f 1 2 9"), "w.obj:5: a face has the vertex 9, and the file has 4");
        assert_eq!(says("\nf 1 \\\n2 \\\n9"), "w.obj:8: a face has the vertex 9, and the file has 4");
        assert_eq!(says("f 1 2 -5"), "w.obj:5: a face has the corner \"-5\"; there are 4 vertices before this face");
        assert_eq!(says("f 0 1 2"), "w.obj:5: a face has the corner \"0\"; vertices are counted from 1; there is no 0");
        assert!(says("f 1 x 2").contains("w.obj:5: a face has the corner \"x\"; right is the number of a vertex"));
        assert!(says("f").starts_with("w.obj:5: a face has no corners"));
        assert_eq!(says("v 1 2"), "w.obj:5: a vertex has 2 of three coordinates; right is `v x y z`");
        assert_eq!(says("v 1 2,5 3"), "w.obj:5: \"2,5\" is no number; right is a point, not a comma: 2.5");
        assert!(
            says("v 1 nan 3\nf 1 2 3\nf 1 2 5").starts_with("w.obj:7: a face has the corner (1.0; NaN; 3.0), which")
        );
        assert!(says("f 99999999999999999999 1 2").contains("right is the number of a vertex"));
        assert!(says("f -9223372036854775808 1 2").contains("there are 4 vertices"));
    }
}
