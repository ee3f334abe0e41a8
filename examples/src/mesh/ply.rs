//! PLY, text and binary.

use core::fmt::Display;
use std::path::Path;

use fogbow::math::{Vec2, Vec3};

use super::{Attribute, Mesh};
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
        let mut roles = Roles::of(section);
        for index in 0..section.count {
            let place = || format!("{} {index}", section.name);
            let fail = |reason: &dyn Display| DataError::new(file, place(), reason);
            match section.name.as_str() {
                "vertex" => read_vertex(&mut input, section, &mut roles, &mut mesh).map_err(|e| fail(&e))?,
                "face" => read_face(&mut input, section, &mut roles, &mut mesh.triangles).map_err(|e| fail(&e))?,
                _ => skip(&mut input, section).map_err(|e| fail(&e))?,
            }
        }
        mesh.attributes.append(&mut roles.attributes);
    }
    Ok(mesh)
}

/// What a property is.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Role {
    Position(usize),
    Normal(usize),
    Texcoord(usize),
    Corners,
    /// A channel of an attribute.
    Attribute(usize, usize),
    Other,
}

/// What the properties of an element are, and attributes made of them.
struct Roles {
    roles: Vec<Role>,
    attributes: Vec<Attribute>,
}

impl Roles {
    /// Names as Mitsuba 3 knows them: `r`, `g`, `b` or `red`, `green`, `blue` are the attribute `color`; others end in `_` and a
    /// letter or digit for their channel.
    fn of(section: &Section) -> Self {
        let mut roles = Self { roles: Vec::new(), attributes: Vec::new() };
        if section.name != "vertex" && section.name != "face" {
            return roles;
        }
        let is_vertex = section.name == "vertex";
        let single = |name: &str| section.properties.iter().any(|p| p.name == name && p.count.is_none());
        let has_normals = is_vertex && ["nx", "ny", "nz"].into_iter().all(single);
        let pairs = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"]];
        let texcoords = pairs.into_iter().find(|pair| is_vertex && pair.iter().all(|name| single(name)));
        let colours = [["r", "g", "b"], ["red", "green", "blue"]];
        let colours = colours.into_iter().find(|names| names.iter().all(|name| single(name)));
        let place = |names: &[&str], name: &str| names.iter().position(|n| *n == name);
        for property in &section.properties {
            let name = property.name.as_str();
            let role = if property.count.is_some() {
                if !is_vertex && is_corners(name) { Role::Corners } else { Role::Other }
            } else if let Some(axis) = place(&["x", "y", "z"], name).filter(|_| is_vertex) {
                Role::Position(axis)
            } else if let Some(axis) = place(&["nx", "ny", "nz"], name).filter(|_| has_normals) {
                Role::Normal(axis)
            } else if let Some(axis) = texcoords.and_then(|pair| place(&pair, name)) {
                Role::Texcoord(axis)
            } else if let Some(channel) = colours.and_then(|names| place(&names, name)) {
                roles.attribute(&section.name, "color", channel)
            } else if let Some((prefix, postfix)) = name.rsplit_once('_') {
                let schemes = ["xyzw", "rgba", "0123", "1234"];
                // After "…_0", "…_1" is the second channel, else the first of another scheme.
                let started = roles.attributes.last().filter(|a| is_of(a, &section.name, prefix)).map(|a| a.channels);
                let channel = schemes.iter().filter_map(|s| s.find(postfix)).find(|c| *c == started.unwrap_or(0));
                let is_colour = postfix.len() == 1 && "rgba".contains(postfix);
                match channel.filter(|c| postfix.len() == 1 && *c < 3) {
                    Some(channel) => {
                        let full = if is_colour { format!("{prefix}_color") } else { prefix.to_owned() };
                        roles.attribute(&section.name, &full, channel)
                    }
                    None => Role::Other,
                }
            } else {
                Role::Other
            };
            roles.roles.push(role);
        }
        // A texture reads one value or three.
        for slot in &mut roles.roles {
            if let Role::Attribute(index, channel) = *slot
                && channel == 1
                && roles.attributes.get(index).is_some_and(|a| a.channels == 2)
            {
                *slot = Role::Other;
            }
        }
        for attribute in &mut roles.attributes {
            attribute.channels = if attribute.channels == 2 { 1 } else { attribute.channels };
        }
        roles
    }

    /// A channel of the attribute with the name.
    fn attribute(&mut self, section: &str, name: &str, channel: usize) -> Role {
        let name = format!("{section}_{name}");
        let found = self.attributes.iter().position(|a| a.name == name);
        let index = found.unwrap_or_else(|| {
            self.attributes.push(Attribute { name, channels: 0, values: Vec::new() });
            self.attributes.len() - 1
        });
        if let Some(attribute) = self.attributes.get_mut(index) {
            attribute.channels = attribute.channels.max(channel + 1);
        }
        Role::Attribute(index, channel)
    }

    /// Makes room for the values of one more vertex or triangle.
    fn grow(&mut self) {
        for attribute in &mut self.attributes {
            attribute.values.resize(attribute.values.len() + attribute.channels, 0.0);
        }
    }

    fn put(&mut self, attribute: usize, channel: usize, value: f64) -> Result<(), String> {
        let value = value as f32;
        if !value.is_finite() {
            return Err("an attribute is not a finite number".to_owned());
        }
        if let Some(attribute) = self.attributes.get_mut(attribute) {
            let start = attribute.values.len().saturating_sub(attribute.channels);
            if let Some(slot) = attribute.values.get_mut(start + channel) {
                *slot = value;
            }
        }
        Ok(())
    }

    /// The values of the last triangle once more.
    fn repeat(&mut self) {
        for attribute in &mut self.attributes {
            let start = attribute.values.len().saturating_sub(attribute.channels);
            attribute.values.extend_from_within(start..);
        }
    }
}

fn is_of(attribute: &Attribute, section: &str, prefix: &str) -> bool {
    let rest = attribute.name.strip_prefix(section).and_then(|rest| rest.strip_prefix('_'));
    rest.is_some_and(|rest| rest == prefix || rest.strip_suffix("_color") == Some(prefix))
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

fn read_vertex(input: &mut Input<'_>, section: &Section, roles: &mut Roles, mesh: &mut Mesh) -> Result<(), String> {
    let (mut position, mut normal, mut texcoord) = ([0.0; 3], None, None);
    roles.grow();
    for (number, property) in section.properties.iter().enumerate() {
        let count = property.count.map_or(Ok(1), |c| input.length(c))?;
        let role = roles.roles.get(number).copied().unwrap_or(Role::Other);
        for _ in 0..count {
            let value = input.number(property.kind)?;
            match role {
                Role::Position(axis) => {
                    if !(value as f32).is_finite() {
                        return Err(format!("{} = {value} is not a finite number", property.name));
                    }
                    position[axis] = value as f32;
                }
                Role::Normal(axis) => normal.get_or_insert([0.0; 3])[axis] = value as f32,
                Role::Texcoord(axis) => texcoord.get_or_insert([0.0; 2])[axis] = value as f32,
                Role::Attribute(attribute, channel) => roles.put(attribute, channel, value)?,
                Role::Corners | Role::Other => {}
            }
        }
    }
    mesh.vertices.push(Vec3::from_array(position));
    // What is no direction counts as none.
    mesh.normals.extend(normal.map(|n| Vec3::from_array(n).normalize_or_zero()));
    mesh.texcoords.extend(texcoord.map(Vec2::from_array));
    Ok(())
}

fn read_face(
    input: &mut Input<'_>,
    section: &Section,
    roles: &mut Roles,
    triangles: &mut Vec<[u32; 3]>,
) -> Result<(), String> {
    let before = triangles.len();
    roles.grow();
    for (number, property) in section.properties.iter().enumerate() {
        let count = property.count.map_or(Ok(1), |c| input.length(c))?;
        let role = roles.roles.get(number).copied().unwrap_or(Role::Other);
        if role != Role::Corners {
            for _ in 0..count {
                let value = input.number(property.kind)?;
                if let Role::Attribute(attribute, channel) = role {
                    roles.put(attribute, channel, value)?;
                }
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
    for _ in before + 1..triangles.len() {
        roles.repeat();
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
