//! A tree of boxes around lights.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::Light;
use crate::math::float::{self, PI};
use crate::math::{Bounds, Frame};
use crate::storage::{Full, List};

/// No node.
pub(super) const NONE: u32 = u32::MAX;

/// Levels at most: lights are halved by number, so 2³² of them have 32.
pub(super) const DEPTH: usize = 33;

/// Lights that are asked for together; each kind has a tree of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Without extent: the near field is all of space.
    Lamp,
    /// With a near field in which the light of samples has no bound, or hardly one.
    Body,
    /// Sampled by the solid angle they are seen under.
    Panel,
    /// At infinity, from some directions.
    Sun,
    /// [`Light::is_sky`].
    Sky,
}

/// How many kinds there are.
pub(super) const KINDS: usize = 5;

impl Kind {
    pub(super) const ALL: [Self; KINDS] = [Self::Lamp, Self::Body, Self::Panel, Self::Sun, Self::Sky];

    pub(super) fn of(light: &Light<'_>) -> Self {
        match light {
            Light::Point(_) | Light::Phong(_) | Light::Spot(_) | Light::Projector(_) => Self::Lamp,
            Light::Sphere(_) | Light::Mesh(_) | Light::Picture(_) => Self::Body,
            Light::Quad(_) => Self::Panel,
            Light::Sun(_) | Light::Constant(_) | Light::Environment(_) => {
                if light.is_sky() {
                    Self::Sky
                } else {
                    Self::Sun
                }
            }
        }
    }
}

/// A box around lights of one kind, with bounds on where they shine: see [`LightTree`].
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct LightNode {
    /// Middle of the box (m).
    pub(super) centre: Vec3,
    /// Squared radius (m²) of the ball around it.
    pub(super) radius2: f32,
    /// Sum of the greatest radiant intensities (W/sr), or at infinity of irradiances (W·m⁻²), mean of the channels.
    pub(super) strength: f32,
    /// Radiant power (W, mean of the channels); at infinity over the mean cross section of the world, as if that were a cube (W·m⁻²).
    pub(super) power: f32,
    /// Around it (unit) light leaves, …
    pub(super) axis: Vec3,
    /// … within this angle (rad); [`UNEVEN`] where all but the leaf itself has to be asked.
    pub(super) spread: f32,
    /// Greatest radius (m) of a near field; infinite for lamps.
    pub(super) reach: f32,
    /// The node above, or [`NONE`].
    pub(super) parent: u32,
    /// The first of two nodes below, side by side; [`LEAF`] and the light's index for a leaf.
    pub(super) below: u32,
    /// The leaf of the light whose index is that of this node; of no meaning beyond the number of lights.
    pub(super) leaf: u32,
}

/// Of a leaf: the middle and strength do not tell all that a choice needs to know.
const UNEVEN: f32 = 4.0;

/// Marks leaves.
const LEAF: u32 = 1 << 31;

impl LightNode {
    pub(super) fn leaf(&self) -> Option<usize> {
        (self.below & LEAF != 0).then_some((self.below & !LEAF) as usize)
    }

    /// The two nodes below an inner one.
    pub(super) fn children(&self) -> [u32; 2] {
        [self.below, self.below + 1]
    }

    /// Distance (m) of its middle.
    pub(crate) fn away(&self, point: Vec3) -> f32 {
        self.centre.distance(point)
    }

    /// Whether a leaf shines evenly in all directions from its middle.
    pub(super) fn is_even(&self) -> bool {
        self.spread == PI
    }

    /// Squared distance (m²) from `point` to the ball around the box.
    pub(super) fn distance2(&self, point: Vec3) -> f32 {
        let gap = (self.away(point) - float::sqrt(self.radius2)).max(0.0);
        gap * gap
    }

    /// Whether light may leave towards a point at `offset` (m) from the centre.
    pub(super) fn shines_to(&self, offset: Vec3, distance2: f32) -> bool {
        if self.spread >= PI || distance2 <= self.radius2 {
            return true;
        }
        let inverse = 1.0 / float::sqrt(distance2);
        let seen = float::asin(float::sqrt(self.radius2) * inverse);
        float::acos(self.axis.dot(offset) * inverse) <= self.spread + seen
    }

    fn of(index: usize, light: &Light<'_>) -> Self {
        // Rounding must not hide what is lit.
        const SLACK: f32 = 2e-3;
        // √(2/3) m: a cross section of 1 m², in the mean over directions.
        const SIDE: f32 = 0.816_496_6;
        let unit = Bounds { min: Vec3::ZERO, max: Vec3::splat(SIDE) };
        let bounds = light.bounds();
        let (axis, spread) = match light {
            Light::Phong(light) => (light.axis, 0.5 * PI + SLACK),
            Light::Spot(light) => (light.axis, light.cutoff() + SLACK),
            Light::Projector(light) => (light.axis(), light.spread() + SLACK),
            Light::Quad(light) => (light.normal(), 0.5 * PI + SLACK),
            Light::Picture(light) => (light.normal(), 0.5 * PI + SLACK),
            Light::Mesh(_) => (Vec3::Z, UNEVEN),
            _ => (Vec3::Z, PI),
        };
        let field = light.near_field();
        let strength = if field.is_some() { light.intensity() } else { light.importance(Vec3::ZERO) };
        Self {
            centre: bounds.centre(),
            radius2: 0.25 * bounds.size().length_squared(),
            strength: strength.min(1e30),
            power: light.power(&unit).mean().min(1e30),
            axis,
            spread: if spread == UNEVEN { spread } else { spread.min(PI) },
            reach: field.map_or(0.0, |field| field.radius().unwrap_or(f32::INFINITY)),
            parent: NONE,
            below: LEAF | index as u32,
            leaf: NONE,
        }
    }

    /// The node above two, whose lights lie within `bounds`.
    fn above(a: &Self, b: &Self, bounds: &Bounds) -> Self {
        let (axis, spread) = cone([(a.axis, a.spread), (b.axis, b.spread)]);
        Self {
            centre: bounds.centre(),
            radius2: 0.25 * bounds.size().length_squared(),
            strength: (a.strength + b.strength).min(f32::MAX),
            power: (a.power + b.power).min(f32::MAX),
            axis,
            spread,
            reach: a.reach.max(b.reach),
            ..Self::EMPTY
        }
    }
}

/// The narrowest cone (axis, half angle) around two.
fn cone([a, b]: [(Vec3, f32); 2]) -> (Vec3, f32) {
    let (wide, narrow) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    let between = float::acos(wide.0.dot(narrow.0));
    if between + narrow.1 <= wide.1 {
        return wide;
    }
    let half = 0.5 * (wide.1 + narrow.1 + between) + 1e-4;
    let across = narrow.0 - wide.0 * wide.0.dot(narrow.0);
    if half >= PI {
        return (wide.0, PI);
    }
    let (sin, cos) = float::sin_cos(half - wide.1);
    // Opposite axes: any plane holds both.
    let across = across.try_normalize().unwrap_or_else(|| Frame::around(wide.0).to_world(Vec3::X));
    ((wide.0 * cos + across * sin).normalize(), half)
}

/// Lights in a tree of boxes, so that one of many is chosen by what it sends to a place in a time that grows like the logarithm of their
/// number (Conty Estevez and Kulla 2018).
///
/// Built once for all lights of a world, in lent memory of three nodes per light, one of them for the work, or in a `Vec`; given to [`Lights`](super::Lights) together
/// with them. Few lights, some sixteen, need no tree.
///
/// ```
/// # use fogbow::{light::{Light, LightNode, Lights, LightTree, PointLight}, math::Vec3, spectrum::Spectrum};
/// // A row of lamps, every metre one.
/// let lamp = |i: usize| Light::Point(PointLight::new(Vec3::X * i as f32, Spectrum::ONE).unwrap());
/// let lamps: [Light; 100] = core::array::from_fn(lamp);
/// let mut memory = [LightNode::EMPTY; 300];
/// let tree = LightTree::new(&lamps, &mut memory[..])?;
/// let lights = Lights::with_tree(&lamps, &tree);
/// // Beside the seventh it is that which is chosen.
/// let (index, probability) = lights.choose(Vec3::new(7.0, 0.1, 0.0), 0.5).unwrap();
/// assert!(index == 7 && probability > 0.8);
/// assert!((lights.probability(Vec3::new(7.0, 0.1, 0.0), index) / probability - 1.0).abs() < 1e-5);
/// # Ok::<(), fogbow::storage::Full>(())
/// ```
#[doc(alias("light BVH", "many lights", "light hierarchy"))]
#[derive(Debug)]
pub struct LightTree<'s> {
    nodes: List<'s, LightNode>,
    roots: [u32; KINDS],
}

impl LightNode {
    /// A node of no light, to fill lent memory with.
    pub const EMPTY: Self = Self {
        centre: Vec3::ZERO,
        radius2: 0.0,
        strength: 0.0,
        power: 0.0,
        axis: Vec3::Z,
        spread: PI,
        reach: 0.0,
        parent: NONE,
        below: NONE,
        leaf: NONE,
    };
}

impl<'s> LightTree<'s> {
    /// Over `lights`, in `memory` of three nodes for every light.
    ///
    /// # Errors
    /// [`Full`] where lent memory is too small.
    pub fn new(lights: &[Light<'_>], memory: impl Into<List<'s, LightNode>>) -> Result<Self, Full> {
        let mut nodes = memory.into();
        nodes.clear();
        let count = lights.len();
        if u32::try_from(count).map_or(true, |count| count >= LEAF / 2) {
            return Err(Full);
        }
        for _ in 0..3 * count {
            nodes.push(LightNode::EMPTY)?;
        }
        let (nodes_of_tree, items) = nodes.as_mut_slice().split_at_mut(2 * count);
        let mut builder = Builder { lights, nodes: nodes_of_tree, used: 0 };
        let mut roots = [NONE; KINDS];
        for (root, wanted) in roots.iter_mut().zip(Kind::ALL) {
            let own = lights.iter().enumerate().filter(|(_, light)| Kind::of(light) == wanted);
            let found = items.iter_mut().zip(own).map(|(item, (i, light))| *item = LightNode::of(i, light)).count();
            if found > 0 {
                *root = builder.used as u32;
                builder.used += 1;
                builder.divide(&mut items[..found], *root, NONE);
            }
        }
        nodes.truncate(2 * count);
        Ok(Self { nodes, roots })
    }

    pub(super) fn nodes(&self) -> (&[LightNode], [u32; KINDS]) {
        (self.nodes.as_slice(), self.roots)
    }
}

/// Writes nodes, children side by side and soon after what is above them.
struct Builder<'n, 'l> {
    lights: &'n [Light<'l>],
    nodes: &'n mut [LightNode],
    used: usize,
}

impl Builder<'_, '_> {
    /// The node `at` over leaves; returns a box around their lights.
    fn divide(&mut self, items: &mut [LightNode], at: u32, parent: u32) -> Bounds {
        if let [leaf] = items {
            let light = leaf.leaf().unwrap_or_default();
            // What another node says of leaves stays.
            self.nodes[at as usize] = LightNode { parent, leaf: self.nodes[at as usize].leaf, ..*leaf };
            self.nodes[light].leaf = at;
            return self.lights[light].bounds();
        }
        let size = Bounds::of(items.iter().map(|node| node.centre)).size();
        let axis = if size.x >= size.max_element() {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let half = items.len() / 2;
        // Of equals the order is that of lights: the same tree on every machine. Finding the half alone would do, but takes 2 kB of WebAssembly more than sorting.
        let key = |node: &LightNode| (node.centre[axis], node.below);
        items.sort_unstable_by(|a, b| key(a).0.total_cmp(&key(b).0).then(key(a).1.cmp(&key(b).1)));
        let (left, right) = items.split_at_mut(half);
        let below = self.used;
        self.used += 2;
        let bounds = self.divide(left, below as u32, at);
        let bounds = bounds.union(self.divide(right, below as u32 + 1, at));
        let above = LightNode::above(&self.nodes[below], &self.nodes[below + 1], &bounds);
        let leaf = self.nodes[at as usize].leaf;
        self.nodes[at as usize] = LightNode { parent, below: below as u32, leaf, ..above };
        bounds
    }
}
