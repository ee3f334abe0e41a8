//! Emitters, and the tables they borrow.

use std::path::Path;

use fogbow::host::Scene;
use fogbow::light::{
    EnvironmentMap, Light, LightError, LightTree, MeshLight, PictureLight, PointLight, Projector, QuadLight, ShadowMap,
    SphereLight, SpotLight, Sun, Triangle,
};
use fogbow::math::{Mat3, Vec3};
use fogbow::spectrum::Spectrum;

use super::glow::{self, Glow};
use super::media::MediumTable;
use crate::error::SceneError;
use crate::mesh::has_area;
use crate::scene_file::{Emitter, Geometry, SceneFile, Shape};
use crate::transform::{Transform, to_vec3};

/// Memory that lights and media borrow.
#[derive(Debug, Default)]
pub struct Storage {
    lights: LightTables,
    media: Vec<MediumTable>,
}

/// Tables of lights.
#[derive(Debug, Default)]
pub(super) struct LightTables {
    /// For each shape that is a light of triangles, in order.
    meshes: Vec<MeshTable>,
    /// For each shape that shows a picture, in order.
    glows: Vec<Vec<Glow>>,
    /// For each emitter that shows one.
    projectors: Vec<Glow>,
    environment: Option<EnvironmentTable>,
}

#[derive(Debug)]
struct MeshTable {
    triangles: Vec<Triangle>,
    areas: Vec<f32>,
}

#[derive(Debug)]
struct EnvironmentTable {
    texels: Vec<Spectrum>,
    weights: Vec<f32>,
    column: Vec<f32>,
}

impl Storage {
    /// Memory for the lights and media of a scene.
    #[must_use]
    pub fn new(scene: &SceneFile) -> Self {
        let even = scene.shapes.iter().filter(|s| s.radiance.is_some() && s.glow.is_none());
        let meshes = even.filter_map(triangles_of).map(|triangles| {
            let areas = vec![0.0; triangles.len()];
            MeshTable { triangles, areas }
        });
        let environment = scene.emitters.iter().find_map(|emitter| match emitter {
            Emitter::Environment { picture, .. } => Some(EnvironmentTable {
                texels: picture.pixels.iter().map(|p| Spectrum(*p)).collect(),
                weights: vec![0.0; picture.pixels.len()],
                column: vec![0.0; picture.height],
            }),
            _ => None,
        });
        let glows = scene.shapes.iter().filter(|s| s.radiance.is_some() && s.glow.is_some()).map(glow::of_shape);
        let projectors = scene.emitters.iter().filter_map(glow::of_emitter);
        let (glows, projectors) = (glows.collect(), projectors.collect());
        let lights = LightTables { meshes: meshes.collect(), glows, projectors, environment };
        Self { lights, media: super::media::tables(scene) }
    }

    /// Bytes held.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let meshes = self.lights.meshes.iter().map(|m| size_of_val(&*m.triangles) + size_of_val(&*m.areas));
        let environment = self.lights.environment.iter().map(|e| size_of_val(&*e.texels) + size_of_val(&*e.weights));
        let glows = self.lights.glows.iter().flatten().chain(&self.lights.projectors).map(Glow::bytes);
        meshes.chain(environment).chain(glows).chain(self.media.iter().map(MediumTable::bytes)).sum()
    }

    pub(super) fn split(&mut self) -> (&mut LightTables, &mut [MediumTable]) {
        (&mut self.lights, &mut self.media)
    }
}

/// The triangles of a light that is neither flat nor round, with their normals to the side that
/// shines.
fn triangles_of(shape: &Shape) -> Option<Vec<Triangle>> {
    let corners: Vec<[Vec3; 3]> = match &shape.geometry {
        Geometry::Mesh(mesh) => mesh.triangles.iter().map(|t| mesh.corners(*t)).filter(|c| has_area(*c)).collect(),
        Geometry::Cube(to_world) => cube_triangles(to_world),
        Geometry::Rectangle(_) | Geometry::Disk(_) | Geometry::Cylinder(_) | Geometry::Sphere { .. } => return None,
    };
    let turned = |[a, b, c]: [Vec3; 3]| if shape.is_flipped { [a, c, b] } else { [a, b, c] };
    Some(corners.into_iter().map(|c| Triangle { corners: turned(c) }).collect())
}

fn cube_triangles(to_world: &Transform) -> Vec<[Vec3; 3]> {
    let mut triangles = Vec::with_capacity(12);
    let is_mirrored = to_world.determinant() < 0.0;
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let corner = |a: f64, b: f64| {
                let mut local = [0.0; 3];
                local[axis] = sign;
                local[(axis + 1) % 3] = a;
                local[(axis + 2) % 3] = b;
                to_vec3(to_world.point(local))
            };
            let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            if (sign > 0.0) == is_mirrored {
                triangles.extend([[a, c, b], [a, d, c]]);
            } else {
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    triangles
}

/// Lights in the order [`super::Part::light`] counts: shapes first, then other emitters.
#[derive(Debug)]
pub(super) struct Lights<'a> {
    lights: Vec<Kept<'a>>,
    environment: Option<EnvironmentMap<'a>>,
}

/// A light, or what one borrows.
#[derive(Debug)]
enum Kept<'a> {
    Light(Light<'a>),
    Picture(PictureLight<'a>),
    Projector(Projector<'a>),
}

impl<'a> Lights<'a> {
    pub(super) fn new(scene: &SceneFile, tables: &'a mut LightTables) -> Result<Self, SceneError> {
        let fail = |place: Option<(&Path, u32)>, element: &str, error: LightError| SceneError {
            file: place.map_or_else(|| scene.file.clone(), |(file, _)| file.to_owned()),
            line: place.map(|(_, line)| line).filter(|line| *line > 0),
            element: element.to_owned(),
            attribute: None,
            reason: error.to_string(),
        };
        let mut lights = Vec::new();
        let (mut meshes, mut glows) = (tables.meshes.iter_mut(), tables.glows.iter_mut());
        let mut projectors = tables.projectors.iter_mut();
        for shape in &scene.shapes {
            let Some(radiance) = shape.radiance else { continue };
            let failed = |e| fail(Some((&shape.file, shape.line)), "<emitter type=\"area\">", e);
            if shape.glow.is_some() {
                for glow in glows.next().into_iter().flatten() {
                    lights.push(Kept::Picture(glow.light().map_err(failed)?));
                }
                continue;
            }
            lights.push(Kept::Light(area_light(shape, radiance, &mut meshes).map_err(failed)?));
        }
        let mut environment = None;
        let mut table = tables.environment.as_mut();
        for emitter in &scene.emitters {
            match emitter {
                Emitter::Environment { picture, to_world } => {
                    let Some(EnvironmentTable { texels, weights, column }) = table.take() else { continue };
                    let [x, y, z] = [0, 1, 2].map(|i| to_vec3(to_world.column(i)));
                    let rotation = Mat3::from_cols(x, y, z);
                    let map = EnvironmentMap::new(picture.width, picture.height, texels, weights, column, rotation)
                        .map_err(|e| fail(None, "<emitter type=\"envmap\">", e))?;
                    environment = Some(map);
                }
                Emitter::Projector { .. } => {
                    let Some(glow) = projectors.next() else { continue };
                    let light = glow.projector(emitter).map_err(|e| fail(None, "<emitter>", e))?;
                    lights.push(Kept::Projector(light));
                }
                other => lights.push(Kept::Light(other_light(other).map_err(|e| fail(None, "<emitter>", e))?)),
            }
        }
        Ok(Self { lights, environment })
    }

    pub(super) fn all(&self) -> Vec<Light<'_>> {
        let light = |kept| match kept {
            &Kept::Light(light) => light,
            Kept::Picture(light) => Light::Picture(light),
            Kept::Projector(light) => Light::Projector(light),
        };
        self.lights.iter().map(light).chain(self.environment.iter().map(Light::Environment)).collect()
    }
}

/// Lights from which on a tree pays: below, looking at all of them is as quick, and chooses best.
const MANY: usize = 16;

/// Texels along each side of a shadow map: 0.8° wide where a lamp shines in all directions, finer in narrow cones.
const SHADOW_TEXELS: u16 = 256;

/// What is known of a world's lights beforehand: a tree where they are many, maps of the shadows of those that shine from a point where they are few.
#[derive(Debug, Default)]
pub struct LightAids {
    tree: Option<LightTree<'static>>,
    shadows: Vec<Option<ShadowMap<'static>>>,
}

impl LightAids {
    /// A tree alone, for methods that follow no shafts of light along eye rays.
    #[must_use]
    pub fn new(lights: &[Light<'_>]) -> Self {
        let tree = if lights.len() <= MANY { None } else { LightTree::new(lights, Vec::new()).ok() };
        Self { tree, shadows: Vec::new() }
    }

    /// With maps of shadows among the surfaces of `scene`.
    #[must_use]
    pub fn with_shadows(lights: &[Light<'_>], scene: &impl Scene) -> Self {
        let shadows = lights.iter().map(|light| ShadowMap::new(light, scene, SHADOW_TEXELS, Vec::new()));
        let are_few = lights.len() <= ShadowMap::MOST_LIGHTS;
        Self { shadows: if are_few { shadows.collect() } else { Vec::new() }, ..Self::new(lights) }
    }

    /// The lights, with all that.
    #[must_use]
    pub fn view<'a>(&'a self, lights: &'a [Light<'a>]) -> fogbow::light::Lights<'a> {
        let with_tree = |tree| fogbow::light::Lights::with_tree(lights, tree);
        let all = self.tree.as_ref().map_or_else(|| lights.into(), with_tree);
        all.with_shadows(&self.shadows)
    }
}

fn area_light<'a>(
    shape: &Shape,
    radiance: Spectrum,
    meshes: &mut impl Iterator<Item = &'a mut MeshTable>,
) -> Result<Light<'a>, LightError> {
    match &shape.geometry {
        Geometry::Rectangle(to_world) => {
            let corner = to_vec3(to_world.point([-1.0, -1.0, 0.0]));
            let (u, v) = (to_vec3(to_world.column(0)) * 2.0, to_vec3(to_world.column(1)) * 2.0);
            // The image of +z shines, also of a mirror image.
            let is_swapped = (to_world.determinant() < 0.0) != shape.is_flipped;
            let (u, v) = if is_swapped { (v, u) } else { (u, v) };
            QuadLight::new(corner, u, v, radiance).map(Light::Quad)
        }
        Geometry::Sphere { centre, radius, .. } => {
            SphereLight::new(to_vec3(*centre), *radius as f32, radiance).map(Light::Sphere)
        }
        Geometry::Cube(_) | Geometry::Mesh(_) => {
            let table = meshes.next().ok_or(LightError::Size)?;
            MeshLight::new(&table.triangles, &mut table.areas, radiance).map(Light::Mesh)
        }
        // The reader makes them of triangles.
        Geometry::Disk(_) | Geometry::Cylinder(_) => Err(LightError::Geometry),
    }
}

fn other_light<'a>(emitter: &Emitter) -> Result<Light<'a>, LightError> {
    match emitter {
        Emitter::Point { position, intensity } => PointLight::new(to_vec3(*position), *intensity).map(Light::Point),
        Emitter::Spot { position, axis, beam, cutoff, intensity } => {
            let [beam, cutoff] = [beam, cutoff].map(|a| a.to_radians() as f32);
            SpotLight::new(to_vec3(*position), to_vec3(*axis), beam, cutoff, *intensity).map(Light::Spot)
        }
        Emitter::Directional { direction, irradiance } => Sun::new(-to_vec3(*direction), *irradiance).map(Light::Sun),
        Emitter::Constant { radiance } => Ok(Light::Constant(*radiance)),
        Emitter::Environment { .. } | Emitter::Projector { .. } => Err(LightError::Size),
    }
}
