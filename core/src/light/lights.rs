//! The lights of a world, and choices among them.

use core::ops::Deref;

use glam::Vec3;

use super::cut::{Cut, MOST, REPRESENTATIVES};
use super::question::{FromPoint, Question};
use super::tree::{DEPTH, KINDS, Kind, LightNode, LightTree, NONE};
use super::{Light, sky};
use crate::host::Rng;
use crate::math::Bounds;
use crate::sampling::discrete::{self, Choice};
use crate::sampling::uniform;
use crate::spectrum::Spectrum;

/// All lights of a world: a slice, and where there are many a [`LightTree`] over it.
///
/// Few lights are a world's lights by `(&lights).into()`.
///
/// ```
/// # use fogbow::{light::{Light, LightTree, Lights, PointLight}, math::Vec3, spectrum::Spectrum};
/// let lamps = [Light::Point(PointLight::new(Vec3::Z, Spectrum::ONE)?)];
/// let few = Lights::from(&lamps);
/// assert_eq!(few.len(), 1);   // what a slice can
/// assert!(!few.has_tree());
/// # Ok::<(), fogbow::light::LightError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Lights<'a> {
    all: &'a [Light<'a>],
    /// Empty without a tree.
    nodes: &'a [LightNode],
    roots: [u32; KINDS],
}

impl<'a> Deref for Lights<'a> {
    type Target = [Light<'a>];
    #[inline]
    fn deref(&self) -> &[Light<'a>] {
        self.all
    }
}

impl<'a> From<&'a [Light<'a>]> for Lights<'a> {
    #[inline]
    fn from(all: &'a [Light<'a>]) -> Self {
        Self { all, nodes: &[], roots: [NONE; KINDS] }
    }
}

impl<'a, const N: usize> From<&'a [Light<'a>; N]> for Lights<'a> {
    #[inline]
    fn from(all: &'a [Light<'a>; N]) -> Self {
        Self::from(&all[..])
    }
}

#[cfg(feature = "alloc")]
impl<'a> From<&'a alloc::vec::Vec<Light<'a>>> for Lights<'a> {
    #[inline]
    fn from(all: &'a alloc::vec::Vec<Light<'a>>) -> Self {
        Self::from(&all[..])
    }
}

impl<'a> Lights<'a> {
    /// Lights with the tree that was built over them. One over another number of lights is left aside.
    ///
    /// ```
    /// # use fogbow::{light::{Light, LightNode, LightTree, Lights, PointLight}, math::Vec3, spectrum::Spectrum};
    /// let lamps = [Light::Point(PointLight::new(Vec3::Z, Spectrum::ONE)?); 2];
    /// let mut memory = [LightNode::EMPTY; 6];
    /// let tree = LightTree::new(&lamps, &mut memory[..]).unwrap();
    /// assert!(Lights::with_tree(&lamps, &tree).has_tree());
    /// assert!(!Lights::with_tree(&lamps[..1], &tree).has_tree());
    /// # Ok::<(), fogbow::light::LightError>(())
    /// ```
    #[must_use]
    pub fn with_tree(all: &'a [Light<'a>], tree: &'a LightTree<'_>) -> Self {
        let (nodes, roots) = tree.nodes();
        if nodes.len() == 2 * all.len() { Self { all, nodes, roots } } else { Self::from(all) }
    }

    /// Whether choices go by a tree.
    ///
    /// ```
    /// # use fogbow::light::{Light, Lights};
    /// assert!(!Lights::from(&[]).has_tree());
    /// ```
    #[inline]
    #[must_use]
    pub fn has_tree(&self) -> bool {
        !self.nodes.is_empty()
    }

    /// Chooses one of the lights by what it sends to `point`, about in proportion to [`Light::importance`]; `u` in [0, 1). Its index and
    /// probability; `None` where nothing was found that shines there.
    ///
    /// ```
    /// # use fogbow::{light::{Light, Lights, PointLight}, math::Vec3, spectrum::Spectrum};
    /// let lamps = [1.0, 3.0].map(|w| Light::Point(PointLight::new(Vec3::Z, Spectrum::splat(w)).unwrap()));
    /// assert_eq!(Lights::from(&lamps).choose(Vec3::ZERO, 0.5), Some((1, 0.75)));
    /// ```
    #[must_use]
    pub fn choose(&self, point: Vec3, u: f32) -> Option<(usize, f32)> {
        self.pick(&FromPoint::all(point), u).map(|choice| (choice.index, choice.probability))
    }

    /// The probability with which [`Lights::choose`] takes the light `index`, in logarithmic time. All together they make 1, or less where
    /// panels or cones of light may find nobody.
    ///
    /// ```
    /// # use fogbow::{light::{Light, Lights, PointLight}, math::Vec3, spectrum::Spectrum};
    /// let lamps = [1.0, 3.0].map(|w| Light::Point(PointLight::new(Vec3::Z, Spectrum::splat(w)).unwrap()));
    /// assert_eq!(Lights::from(&lamps).probability(Vec3::ZERO, 0), 0.25);
    /// ```
    #[must_use]
    pub fn probability(&self, point: Vec3, index: usize) -> f32 {
        self.share(&FromPoint::all(point), index)
    }

    /// Chooses one light by a question.
    #[inline]
    pub(crate) fn pick(&self, question: &impl Question, u: f32) -> Option<Choice> {
        self.survey(question).pick(u)
    }

    /// All that is needed to choose among lights several times.
    #[inline]
    pub(crate) fn survey<'q, Q: Question>(&self, question: &'q Q) -> Survey<'q, 'a, Q> {
        let cut = self.has_tree().then(|| Cut::of(self, question, question.limit()));
        Survey { lights: *self, question, cut }
    }

    /// The probability with which the light `index` is chosen by a question.
    pub(crate) fn share(&self, question: &impl Question, index: usize) -> f32 {
        if self.has_tree() {
            return Cut::of(self, question, question.limit()).share(self, question, index);
        }
        let own = self.all.get(index).map_or(0.0, |light| question.light(light));
        let total: f32 = self.all.iter().map(|light| question.light(light)).sum();
        if total > 0.0 { own / total } else { 0.0 }
    }

    /// Calls `visit(light, share)` for lights that stand for all: every one without a tree, else a bounded number, each with the probability
    /// with which it was chosen.
    pub(crate) fn representatives<R: Rng + ?Sized>(
        &self,
        question: &impl Question,
        rng: &mut R,
        mut visit: impl FnMut(&'a Light<'a>, f32, &mut R),
    ) {
        if self.has_tree() {
            let cut = Cut::of(self, question, REPRESENTATIVES);
            for entry in cut.entries() {
                if let Some((index, share)) = cut.descend(self, question, *entry, &mut uniform(rng)) {
                    visit(&self.all[index], share, rng);
                }
            }
            return;
        }
        for light in self.all.iter().filter(|light| question.light(light) > 0.0) {
            visit(light, 1.0, rng);
        }
    }

    /// The lights that matter each by itself: all without a tree, else those that stand alone in a cut.
    pub(crate) fn strong(&self, question: &impl Question) -> Strong {
        if !self.has_tree() {
            return Strong { indices: None, others: 0.0 };
        }
        let mut strong = Strong { indices: Some(heapless::Vec::new()), others: 0.0 };
        for (node, weight) in Cut::of(self, question, question.limit()).entries() {
            match (self.node(*node).leaf(), &mut strong.indices) {
                // As many as nodes of a cut: they fit.
                (Some(light), Some(indices)) => drop(indices.push(light as u32)),
                _ => strong.others += weight,
            }
        }
        strong
    }

    /// The lights but a sky: those with a tree as they are, others in runs.
    pub(crate) fn but_sky(self) -> impl Iterator<Item = Self> {
        let runs = if self.has_tree() { &[] } else { self.all };
        let runs = runs.chunk_by(|a, b| a.is_sky() == b.is_sky());
        let runs = runs.filter(|run| run.first().is_some_and(|light| !light.is_sky())).map(Self::from);
        let mut others = self;
        others.roots[Kind::Sky as usize] = NONE;
        runs.chain(self.has_tree().then_some(others))
    }

    /// Chooses a light in proportion to its [power](Light::power).
    pub(crate) fn emitting(&self, bounds: &Bounds, u: f32) -> Option<Choice> {
        if !self.has_tree() {
            let lights = self.all.iter().map(|light| (light.power(bounds).mean(), ()));
            return discrete::choose(lights, u).map(|((), choice)| choice);
        }
        let disc = crate::math::float::PI * 0.25 * bounds.size().length_squared();
        let of_kind = |kind: &Kind| if matches!(kind, Kind::Sun | Kind::Sky) { disc } else { 1.0 };
        let weighted = Kind::ALL.iter().zip(self.roots).filter(|(_, root)| *root != NONE);
        let weighted = weighted.map(|(kind, root)| (self.node(root).power * of_kind(kind), root));
        let (mut node, Choice { mut probability, mut remainder, .. }) = discrete::choose(weighted, u)?;
        loop {
            let children = match self.node(node).leaf() {
                Some(index) => return Some(Choice { index, probability, remainder }),
                None => self.node(node).children(),
            };
            let (child, choice) = discrete::choose(children.map(|child| (self.node(child).power, child)), remainder)?;
            (node, remainder, probability) = (child, choice.remainder, probability * choice.probability);
        }
    }

    /// Squared distance (m²) from `point` to the centre of the nearest light of finite size; infinite without one.
    pub(crate) fn nearest2(&self, point: Vec3) -> f32 {
        let away = |light: &Light<'_>| light.near_field().map(|field| field.centre().distance_squared(point));
        if !self.has_tree() {
            return self.all.iter().filter_map(away).fold(f32::INFINITY, f32::min);
        }
        let mut nearest = f32::INFINITY;
        let mut stack = heapless::Vec::<(u32, f32), { 2 * DEPTH }>::new();
        for root in self.roots[..Kind::Sun as usize].iter().filter(|root| **root != NONE) {
            let _ = stack.push((*root, self.node(*root).distance2(point)));
            while let Some((index, least)) = stack.pop() {
                if least >= nearest {
                    continue;
                }
                let node = self.node(index);
                if let Some(light) = node.leaf() {
                    nearest = nearest.min(away(&self.all[light]).unwrap_or(f32::INFINITY));
                    continue;
                }
                let mut children = node.children().map(|child| (child, self.node(child).distance2(point)));
                if children[0].1 < children[1].1 {
                    children.swap(0, 1);
                }
                // As deep as the tree, twice: it always fits.
                let _ = stack.extend_from_slice(&children);
            }
        }
        nearest
    }

    /// The lights at infinity, with their indices.
    pub(crate) fn distant(&self) -> impl Iterator<Item = (usize, &'a Light<'a>)> + '_ {
        let linear = if self.has_tree() { 0..0 } else { 0..self.all.len() };
        let mut next = self.roots.map(|root| if self.has_tree() { root } else { NONE });
        next[..Kind::Sun as usize].fill(NONE);
        let of_tree = next.into_iter().filter(|root| *root != NONE).flat_map(|root| self.leaves(root));
        linear.filter(|i| self.all[*i].near_field().is_none()).chain(of_tree).map(|i| (i, &self.all[i]))
    }

    /// Indices of the lights below a node, from left to right.
    fn leaves(&self, root: u32) -> impl Iterator<Item = usize> + '_ {
        let down = |mut node: u32| {
            while self.node(node).leaf().is_none() {
                node = self.node(node).below;
            }
            node
        };
        let after = move |mut node: u32| loop {
            if node == root {
                return None;
            }
            let above = self.node(node).parent;
            let [left, right] = self.node(above).children();
            if node == left {
                return Some(down(right));
            }
            node = above;
        };
        core::iter::successors(Some(down(root)), move |leaf| after(*leaf)).filter_map(|leaf| self.node(leaf).leaf())
    }

    /// Radiance of all lights together that are a sky: [`sky`].
    #[inline]
    pub(crate) fn sky(&self, to_light: Vec3) -> Spectrum {
        if !self.has_tree() {
            return sky(self.all, to_light);
        }
        let root = self.roots[Kind::Sky as usize];
        if root == NONE {
            return Spectrum::ZERO;
        }
        self.leaves(root).map(|i| self.all[i].background(to_light)).sum()
    }

    pub(super) fn node(&self, index: u32) -> &'a LightNode {
        &self.nodes[index as usize]
    }

    pub(super) fn roots(&self) -> impl Iterator<Item = (Kind, u32)> {
        Kind::ALL.into_iter().zip(self.roots).filter(|(_, root)| *root != NONE)
    }

    pub(super) fn slice(&self) -> &'a [Light<'a>] {
        self.all
    }
}

/// Lights that matter each by itself: see [`Lights::strong`].
pub(crate) struct Strong {
    /// `None` for all.
    indices: Option<heapless::Vec<u32, MOST>>,
    /// The weight of all others together, about.
    pub(crate) others: f32,
}

impl Strong {
    pub(crate) fn lights<'l, 'a>(&'l self, lights: &'l Lights<'a>) -> impl Iterator<Item = &'l Light<'a>> {
        let all = if self.indices.is_none() { &lights[..] } else { &[] };
        all.iter().chain(self.indices.iter().flatten().map(|i| &lights[*i as usize]))
    }
}

/// Lights as a question sees them, for any number of choices.
pub(crate) struct Survey<'q, 'a, Q> {
    lights: Lights<'a>,
    question: &'q Q,
    cut: Option<Cut>,
}

impl<Q: Question> Survey<'_, '_, Q> {
    pub(crate) fn pick(&self, u: f32) -> Option<Choice> {
        match &self.cut {
            Some(cut) => cut.pick(&self.lights, self.question, u),
            None => {
                let lights = self.lights.iter().map(|light| (self.question.light(light), ()));
                discrete::choose(lights, u).map(|((), choice)| choice)
            }
        }
    }
}
#[cfg(test)]
mod tuning {
    extern crate std;
    use super::*;
    use crate::light::{FromRay, PointLight};
    use crate::math::Ray;
    use crate::sampling::{Generator, uniform, uniform2, warp};
    use alloc::vec::Vec;

    #[test]
    fn print_factors() {
        for n in [24, 100, 1000, 10000] {
            let rng = &mut Generator::new(3);
            let mut at = |s: f32| Vec3::new(uniform(rng), uniform(rng), uniform(rng)) * s;
            let lamps: Vec<Light<'_>> = (0..n)
                .map(|_| Light::Point(PointLight::new(at(2.0), Spectrum::splat(at(1.0).x + 0.5)).unwrap()))
                .collect();
            let tree = LightTree::new(&lamps, Vec::new()).unwrap();
            let lights = Lights::with_tree(&lamps, &tree);
            let (mut of_point, mut of_ray, mut sums, mut worst) = (0.0, 0.0, [0.0; 2], [0.0_f64; 2]);
            let rng = &mut Generator::new(4);
            let count = 20;
            for _ in 0..count {
                let p = Vec3::new(uniform(rng), uniform(rng), uniform(rng)) * 2.0;
                let q = FromPoint::all(p);
                let ray = Ray::new(p, warp::uniform_sphere(uniform2(rng)));
                let r = FromRay { ray, near: 0.0, far: 1.0, steep: false, until: None };
                let point = factor(&lights, &q, &mut sums[0]);
                let along = factor(&lights, &r, &mut sums[1]);
                of_point += point / f64::from(count);
                of_ray += along / f64::from(count);
                worst = [worst[0].max(point), worst[1].max(along)];
            }
            std::println!(
                "{n}: point {of_point:.3} (worst {:.2}) ray {of_ray:.3} (worst {:.2}); sums {:?}",
                worst[0],
                worst[1],
                sums.map(|s| s / f64::from(count))
            );
        }
    }

    fn factor(lights: &Lights<'_>, q: &impl Question, sum: &mut f64) -> f64 {
        let (mut squares, mut total) = (0.0, 0.0);
        let cut = Cut::of(lights, q, q.limit());
        for i in 0..lights.len() {
            let p = f64::from(cut.share(lights, q, i));
            let f = f64::from(q.light(&lights[i]));
            *sum += p;
            if f > 0.0 {
                squares += f * f / p;
            }
            total += f;
        }
        squares / (total * total)
    }
}
