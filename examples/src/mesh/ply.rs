//! PLY, text and binary.

use core::fmt::Display;
use std::path::Path;

use fogbow::math::Vec3;

use super::Mesh;
use crate::error::DataError;

/// How values are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Ascii,
    Little,
    Big,
}

/// A number type of the format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn parse(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn is_whole(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

#[derive(Debug)]
struct Property {
    name: String,
    /// Type of the list's length, if it is a list.
    count: Option<Kind>,
    kind: Kind,
}

#[derive(Debug)]
struct Section {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

#[derive(Debug)]
struct Header {
    format: Format,
    sections: Vec<Section>,
}

/// Most corners of a face: triangles and quads; others would need a real triangulation.
const MAX_CORNERS: usize = 4;

pub(super) fn read(file: &Path, bytes: &[u8]) -> Result<Mesh, DataError> {
    let (header, body) = read_header(file, bytes)?;
    let mut input = Input { format: header.format, rest: body };
    let mut mesh = Mesh::default();
    for section in &header.sections {
        // Every entry takes at least a byte: a size the file cannot hold is refused before
        // memory is taken for it.
        if section.count > input.rest.len() && !section.properties.is_empty() {
            let (count, left) = (section.count, input.rest.len());
            let reason = format!("element \"{}\" has {count} entries, but only {left} bytes follow", section.name);
            return Err(DataError::new(file, "header", reason));
        }
        for index in 0..section.count {
            let place = || format!("{} {index}", section.name);
            let fail = |reason: &dyn Display| DataError::new(file, place(), reason);
            match section.name.as_str() {
                "vertex" => mesh.vertices.push(read_vertex(&mut input, section).map_err(|e| fail(&e))?),
                "face" => read_face(&mut input, section, &mut mesh.triangles).map_err(|e| fail(&e))?,
                _ => skip(&mut input, section).map_err(|e| fail(&e))?,
            }
        }
    }
    Ok(mesh)
}

fn read_header<'b>(file: &Path, bytes: &'b [u8]) -> Result<(Header, &'b [u8]), DataError> {
    let fail = |line: &str, reason: &str| {
        let line: String = line.chars().take(60).collect();
        DataError::new(
            file,
            "header",
            if line.is_empty() { reason.to_owned() } else { format!("\"{line}\": {reason}") },
        )
    };
    if !bytes.starts_with(b"ply") {
        return Err(fail("", "the file does not begin with \"ply\""));
    }
    let mut rest = bytes;
    let mut next = || -> Result<&'b str, DataError> {
        let end = rest.iter().position(|b| *b == b'\n').ok_or_else(|| fail("", "end_header is missing"))?;
        let (line, after) = rest.split_at(end);
        rest = after.get(1..).unwrap_or_default();
        core::str::from_utf8(line).map(str::trim).map_err(|_| fail("", "is not text"))
    };
    if next()? != "ply" {
        return Err(fail("", "the file does not begin with \"ply\""));
    }
    let mut format = None;
    let mut sections: Vec<Section> = Vec::new();
    loop {
        let line = next()?;
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["end_header"] => break,
            [] | ["comment" | "obj_info", ..] => {}
            ["format", name, "1.0"] => {
                format = Some(match name {
                    "ascii" => Format::Ascii,
                    "binary_little_endian" => Format::Little,
                    "binary_big_endian" => Format::Big,
                    _ => return Err(fail(line, "unknown format")),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| fail(line, "the count is not a whole number"))?;
                if sections.iter().any(|s| s.name == name) {
                    return Err(fail(line, "is given twice"));
                }
                sections.push(Section { name: name.to_owned(), count, properties: Vec::new() });
            }
            ["property", ref tail @ ..] => {
                let section = sections.last_mut().ok_or_else(|| fail(line, "stands before any element"))?;
                let kind = |word: &str| Kind::parse(word).ok_or_else(|| fail(line, "unknown number type"));
                let property = match *tail {
                    ["list", count, of, name] => {
                        Property { name: name.to_owned(), count: Some(kind(count)?), kind: kind(of)? }
                    }
                    [of, name] => Property { name: name.to_owned(), count: None, kind: kind(of)? },
                    _ => return Err(fail(line, "is not understood")),
                };
                if property.count.is_some_and(|c| !c.is_whole()) {
                    return Err(fail(line, "the length of a list must be a whole number"));
                }
                if section.properties.iter().any(|p| p.name == property.name) {
                    return Err(fail(line, "is given twice"));
                }
                section.properties.push(property);
            }
            _ => return Err(fail(line, "is not understood")),
        }
    }
    let header = Header { format: format.ok_or_else(|| fail("", "\"format\" is missing"))?, sections };
    let find = |name: &str| {
        header
            .sections
            .iter()
            .find(|s| s.name == name)
            .ok_or_else(|| fail("", &format!("element \"{name}\" is missing")))
    };
    let vertex = find("vertex")?;
    for name in ["x", "y", "z"] {
        if !vertex.properties.iter().any(|p| p.name == name && p.count.is_none()) {
            return Err(fail("", &format!("a vertex has no property \"{name}\"")));
        }
    }
    let has_corners = |p: &Property| is_corners(&p.name) && p.count.is_some() && p.kind.is_whole();
    if !find("face")?.properties.iter().any(has_corners) {
        return Err(fail("", "a face has no list of whole numbers \"vertex_indices\""));
    }
    Ok((header, rest))
}

fn is_corners(name: &str) -> bool {
    name == "vertex_indices" || name == "vertex_index"
}

fn read_vertex(input: &mut Input<'_>, section: &Section) -> Result<Vec3, String> {
    let mut position = Vec3::ZERO;
    for property in &section.properties {
        let count = property.count.map_or(Ok(1), |c| input.length(c))?;
        for _ in 0..count {
            let value = input.number(property.kind)?;
            let slot = match property.name.as_str() {
                "x" => &mut position.x,
                "y" => &mut position.y,
                "z" => &mut position.z,
                _ => continue,
            };
            *slot = value as f32;
            if !slot.is_finite() {
                return Err(format!("{} = {value} is not a finite number", property.name));
            }
        }
    }
    Ok(position)
}

fn read_face(input: &mut Input<'_>, section: &Section, triangles: &mut Vec<[u32; 3]>) -> Result<(), String> {
    for property in &section.properties {
        let count = property.count.map_or(Ok(1), |c| input.length(c))?;
        if !(is_corners(&property.name) && property.count.is_some()) {
            for _ in 0..count {
                input.number(property.kind)?;
            }
            continue;
        }
        if !(3..=MAX_CORNERS).contains(&count) {
            return Err(format!("has {count} corners; triangles and quads are known"));
        }
        let mut corners = [0_u32; MAX_CORNERS];
        for corner in corners.iter_mut().take(count) {
            let value = input.number(property.kind)?;
            if !(0.0..=f64::from(u32::MAX)).contains(&value) || value.fract() != 0.0 {
                return Err(format!("{value} is not the number of a vertex"));
            }
            *corner = value as u32;
        }
        let [a, b, c, d] = corners;
        triangles.push([a, b, c]);
        if count == 4 {
            triangles.push([a, c, d]);
        }
    }
    Ok(())
}

fn skip(input: &mut Input<'_>, section: &Section) -> Result<(), String> {
    for property in &section.properties {
        let count = property.count.map_or(Ok(1), |c| input.length(c))?;
        for _ in 0..count {
            input.number(property.kind)?;
        }
    }
    Ok(())
}

/// What follows the header.
struct Input<'b> {
    format: Format,
    rest: &'b [u8],
}

impl Input<'_> {
    /// A number; every type here fits a double.
    fn number(&mut self, kind: Kind) -> Result<f64, String> {
        if self.format == Format::Ascii {
            return self.word();
        }
        let size = kind.size();
        let Some((head, tail)) = self.rest.split_at_checked(size) else {
            return Err("the file ends here".to_owned());
        };
        self.rest = tail;
        let mut raw = [0_u8; 8];
        for (slot, byte) in raw.iter_mut().zip(head) {
            *slot = *byte;
        }
        if self.format == Format::Big
            && let Some(used) = raw.get_mut(..size)
        {
            used.reverse();
        }
        let [a, b, c, d, ..] = raw;
        Ok(match kind {
            Kind::I8 => f64::from(a as i8),
            Kind::U8 => f64::from(a),
            Kind::I16 => f64::from(i16::from_le_bytes([a, b])),
            Kind::U16 => f64::from(u16::from_le_bytes([a, b])),
            Kind::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Kind::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Kind::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Kind::F64 => f64::from_le_bytes(raw),
        })
    }

    fn word(&mut self) -> Result<f64, String> {
        let start = self.rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(self.rest.len());
        let (_, text) = self.rest.split_at(start);
        let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
        let (word, tail) = text.split_at(end);
        self.rest = tail;
        if word.is_empty() {
            return Err("the file ends here".to_owned());
        }
        let shown = String::from_utf8_lossy(word);
        shown.parse().map_err(|_| format!("\"{}\" is not a number", shown.chars().take(20).collect::<String>()))
    }

    /// The length of a list; never more than bytes are left.
    fn length(&mut self, kind: Kind) -> Result<usize, String> {
        let value = self.number(kind)?;
        if value < 0.0 || value > self.rest.len() as f64 || value.fract() != 0.0 {
            return Err(format!("a list cannot have {value} entries: {} bytes follow", self.rest.len()));
        }
        Ok(value as usize)
    }
}
