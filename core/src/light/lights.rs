//! The lights of a world, and choices among them.

use core::ops::Deref;

use glam::Vec3;

use super::cut::{Cut, MOST, REPRESENTATIVES};
use super::question::{FromPoint, Question};
use super::tree::{DEPTH, KINDS, Kind, LightNode, LightTree, NONE};
use super::{Light, ShadowMap, sky};
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
    /// Empty, or one for each light.
    shadows: &'a [Option<ShadowMap<'a>>],
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
        Self { all, nodes: &[], roots: [NONE; KINDS], shadows: &[] }
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
        if nodes.len() == 2 * all.len() { Self { nodes, roots, ..Self::from(all) } } else { Self::from(all) }
    }

    /// The same lights with what is known of their shadows: a map for each that has one, in their order. Eye rays then look for light where there is some.
    /// Maps of another number of lights are left aside.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::{Light, Lights, PointLight, ShadowMap}, math::Vec3, spectrum::Spectrum};
    /// let lamps = [Light::Point(PointLight::new(Vec3::Z, Spectrum::ONE)?)];
    /// let mut memory = [0.0; 64];
    /// let maps = [ShadowMap::new(&lamps[0], &Empty, 8, &mut memory[..])];
    /// assert!(Lights::from(&lamps).with_shadows(&maps).shadow_map(0).is_some());
    /// # Ok::<(), fogbow::light::LightError>(())
    /// ```
    #[must_use]
    pub fn with_shadows(self, maps: &'a [Option<ShadowMap<'a>>]) -> Self {
        if maps.len() == self.all.len() { Self { shadows: maps, ..self } } else { self }
    }

    /// What is known of the shadows of the light `index`.
    ///
    /// ```
    /// # use fogbow::light::{Light, Lights};
    /// assert!(Lights::from(&[]).shadow_map(0).is_none());
    /// ```
    #[inline]
    #[must_use]
    pub fn shadow_map(&self, index: usize) -> Option<&'a ShadowMap<'a>> {
        self.shadows.get(index)?.as_ref()
    }

    /// The slice, for as long as it lives.
    pub(crate) fn all(&self) -> &'a [Light<'a>] {
        self.all
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

    /// Chooses one of the lights by what it sends to `point`, about in proportion to [`Light::importance`]; `u` in [0, 1). As that may not arrive, each that shines there has an equal
    /// part of a quarter besides; where there is a [`LightTree`], suns together, skies together and all others have. Its index and
    /// probability; `None` where nothing was found that shines there.
    ///
    /// ```
    /// # use fogbow::{light::{Light, Lights, PointLight}, math::Vec3, spectrum::Spectrum};
    /// let lamps = [1.0, 3.0].map(|w| Light::Point(PointLight::new(Vec3::Z, Spectrum::splat(w)).unwrap()));
    /// assert_eq!(Lights::from(&lamps).choose(Vec3::ZERO, 0.5), Some((1, 0.75 * 0.75 + 0.125)));
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
    /// assert_eq!(Lights::from(&lamps).probability(Vec3::ZERO, 0), 0.75 * 0.25 + 0.125);
    /// ```
    #[must_use]
    pub fn probability(&self, point: Vec3, index: usize) -> f32 {
        self.share(&FromPoint::all(point), index)
    }

    /// Chooses one light by a question.
    pub(crate) fn pick(&self, question: &dyn Question, u: f32) -> Option<Choice> {
        self.survey(question).pick(u)
    }

    /// All that is needed to choose among lights several times.
    pub(crate) fn survey<'q>(&self, question: &'q dyn Question) -> Survey<'q, 'a> {
        if self.has_tree() {
            let cut = Some(Cut::of(self, question, question.limit()));
            return Survey { lights: *self, question, cut, few: heapless::Vec::new(), floor: Floor::NONE };
        }
        // More than fit are asked again for every choice.
        let few = self.all.iter().take(FEW).map(|light| question.light(light)).collect();
        let mut survey = Survey { lights: *self, question, cut: None, few, floor: Floor::NONE };
        survey.floor = Floor::of(&mut (0..self.all.len()).map(|index| survey.weight(index)));
        survey
    }

    /// The probability with which the light `index` is chosen by a question.
    pub(crate) fn share(&self, question: &dyn Question, index: usize) -> f32 {
        let survey = self.survey(question);
        match &survey.cut {
            Some(cut) => cut.share(self, question, index),
            None if index < self.all.len() => survey.floor.raised(survey.weight(index)),
            None => 0.0,
        }
    }

    /// Calls `visit(light, share)` for lights that stand for all: every one without a tree, else a bounded number, each with the probability
    /// with which it was chosen.
    pub(crate) fn representatives<R: Rng + ?Sized>(
        &self,
        question: &dyn Question,
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
    pub(crate) fn strong(&self, question: &dyn Question) -> Strong {
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

    /// Chooses a light in proportion to its [power](Light::power); in a tree, that of suns as if the bounds were a cube.
    pub(crate) fn emitting(&self, bounds: &Bounds, u: f32) -> Option<Choice> {
        if !self.has_tree() {
            let lights = self.all.iter().map(|light| (light.power(bounds).mean(), ()));
            return discrete::choose(lights, u).map(|((), choice)| choice);
        }
        // As the bounds are seen from a direction, in the mean.
        let seen = 0.5 * super::emission::faces(bounds.size()).element_sum();
        let of_kind = |kind: &Kind| if matches!(kind, Kind::Sun | Kind::Sky) { seen } else { 1.0 };
        let roots = Kind::ALL.iter().zip(self.roots).filter(|(_, root)| *root != NONE);
        let mut nodes: heapless::Vec<(f32, u32), KINDS> =
            roots.map(|(kind, root)| (self.node(root).power * of_kind(kind), root)).collect();
        let (mut probability, mut remainder) = (1.0, u);
        loop {
            let (node, choice) = discrete::choose(nodes.iter().copied(), remainder)?;
            (remainder, probability) = (choice.remainder, probability * choice.probability);
            if let Some(index) = self.node(node).leaf() {
                return Some(Choice { index, probability, remainder });
            }
            nodes = self.node(node).children().into_iter().map(|child| (self.node(child).power, child)).collect();
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

    /// Whether rays may meet any of them.
    pub(crate) fn have_surfaces(&self) -> bool {
        if self.has_tree() {
            return [Kind::Body, Kind::Panel].iter().any(|kind| self.roots[*kind as usize] != NONE);
        }
        self.all.iter().any(|light| matches!(Kind::of(light), Kind::Body | Kind::Panel))
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

/// What a question knows of lights is what they send, not what arrives: of a sun above a roof nothing does, and all light in the room comes from a lamp that sends a
/// thousandth of that. So each of them, or of suns, skies and the others together where there is a tree, has a part of this in equal shares. Larger: choices in vain where all arrives; smaller: bright dots.
pub(super) const UNSEEN: f32 = 0.25;

/// By which probabilities have a least one.
pub(super) struct Floor {
    total: f32,
    least: f32,
}

impl Floor {
    const NONE: Self = Self { total: 0.0, least: 0.0 };

    /// Of such weights.
    pub(super) fn of(weights: &mut dyn Iterator<Item = f32>) -> Self {
        let (mut total, mut count) = (0.0, 0.0);
        for weight in weights {
            if weight > 0.0 {
                (total, count) = (total + weight, count + 1.0);
            }
        }
        Self { total, least: if count > 0.0 { UNSEEN / count } else { 0.0 } }
    }

    /// The probability of one of them.
    pub(super) fn raised(&self, weight: f32) -> f32 {
        if weight > 0.0 && self.total > 0.0 { (1.0 - UNSEEN) * (weight / self.total) + self.least } else { 0.0 }
    }
}

/// Without a tree, so many are asked once for all choices.
const FEW: usize = 8;

/// Lights as a question sees them, for any number of choices.
pub(crate) struct Survey<'q, 'a> {
    lights: Lights<'a>,
    question: &'q dyn Question,
    cut: Option<Cut>,
    /// What the first of them send, without a tree.
    few: heapless::Vec<f32, FEW>,
    floor: Floor,
}

impl Survey<'_, '_> {
    pub(crate) fn pick(&self, u: f32) -> Option<Choice> {
        if let Some(cut) = &self.cut {
            return cut.pick(&self.lights, self.question, u);
        }
        let weights = (0..self.lights.len()).map(|index| (self.floor.raised(self.weight(index)), ()));
        discrete::choose(weights, u).map(|((), choice)| choice)
    }

    fn weight(&self, index: usize) -> f32 {
        self.few.get(index).copied().unwrap_or_else(|| self.question.light(&self.lights[index]))
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use alloc::vec::Vec;
    use core::cell::Cell;

    use super::*;
    use crate::light::question::{Except, FromRay, Guess};
    use crate::light::{PointLight, QuadLight, SphereLight, SpotLight, Sun, scattered};
    use crate::math::Ray;
    use crate::phase::{Lobe, Phase, deflection};
    use crate::sampling::{Generator, uniform2, warp};

    fn at(rng: &mut Generator) -> Vec3 {
        Vec3::new(uniform(rng), uniform(rng), uniform(rng)) * 2.0
    }

    fn lamps(count: usize) -> Vec<Light<'static>> {
        let rng = &mut Generator::new(3);
        let lamp = |_| Light::Point(PointLight::new(at(rng), Spectrum::splat(0.5 + uniform(rng))).unwrap());
        (0..count).map(lamp).collect()
    }

    /// Lights of every kind, all that may be left out in some place.
    fn mixed(count: usize) -> Vec<Light<'static>> {
        let rng = &mut Generator::new(5);
        let mut light = |i: usize| {
            let (place, towards) = (at(rng), warp::uniform_sphere(uniform2(rng)));
            let (size, bright) = (0.02 + 0.05 * uniform(rng), Spectrum::splat(0.5 + uniform(rng)));
            match i % 6 {
                0 => Light::Point(PointLight::new(place, bright).unwrap()),
                1 => Light::Spot(SpotLight::new(place, towards, 0.2, 0.7, bright).unwrap()),
                2 => {
                    let across = towards.any_orthonormal_vector() * size;
                    Light::Quad(QuadLight::new(place, across, across.cross(towards), bright * 100.0).unwrap())
                }
                3 | 4 => Light::Sphere(SphereLight::new(place, 0.2 * size, bright * 1000.0).unwrap()),
                _ => Light::Sun(Sun::new(towards, bright * 0.1).unwrap()),
            }
        };
        (0..count).map(&mut light).chain([Light::Constant(Spectrum::splat(0.01))]).collect()
    }

    /// A sun that may not come through a roof, above a lamp that sends a thousandth of its light: by itself, and among many.
    #[test]
    fn lights_that_send_little_are_chosen_where_others_may_not_arrive() {
        let sun = Light::Sun(Sun::new(Vec3::Z, Spectrum::splat(1000.0)).unwrap());
        for count in [1, 30] {
            let mut lights = lamps(count);
            lights.push(sun);
            let point = Vec3::splat(1.0);
            let tree = (count > 1).then(|| LightTree::new(&lights, Vec::new()).unwrap());
            let all = tree.as_ref().map_or(Lights::from(&lights), |tree| Lights::with_tree(&lights, tree));
            let shares: Vec<f32> = (0..=count).map(|index| all.probability(point, index)).collect();
            let of_lamps: f32 = shares[..count].iter().sum();
            assert!(of_lamps > 0.5 * UNSEEN && of_lamps < 0.5 * UNSEEN + 0.1, "{count}: {of_lamps}");
            assert!((of_lamps + shares[count] - 1.0).abs() < 1e-5, "{count}: {shares:?}");
            // What is chosen is what is told.
            const CHOICES: usize = 4000;
            let chosen = (0..CHOICES).filter_map(|i| all.choose(point, (i as f32 + 0.5) / CHOICES as f32));
            let of_sun = chosen.inspect(|(index, share)| assert!((share / shares[*index] - 1.0).abs() < 1e-3));
            let of_sun = of_sun.filter(|(index, _)| *index == count).count() as f32 / CHOICES as f32;
            assert!((of_sun - shares[count]).abs() < 0.01, "{count}: {of_sun} instead of {}", shares[count]);
        }
    }

    fn questions(rng: &mut Generator) -> ([FromPoint; 3], [FromRay; 2]) {
        let point = at(rng);
        let of = |except, sky| FromPoint { point, except, sky, dark: false };
        let ray = Ray::new(point, warp::uniform_sphere(uniform2(rng)));
        let part = FromRay { ray, near: 0.1, far: 1.0, steep: false, until: None };
        let all = [of(Except::Nothing, true), of(Except::Near, true), of(Except::Steep, false)];
        (all, [part, FromRay { far: f32::INFINITY, steep: true, until: Some((1e4, 1.0)), ..part }])
    }

    /// Chooses many times: every light as often as is said of it, with the probability that is said; and those that take part are reached.
    fn check_choices(lights: &Lights<'_>, question: &dyn Question, is_whole: bool) {
        let survey = lights.survey(question);
        let count = 4000;
        let mut found = alloc::vec![0_u32; lights.len()];
        for i in 0..count {
            let u = (i as f32 + 0.5) / count as f32;
            let Some(choice) = survey.pick(u) else { continue };
            found[choice.index] += 1;
            let said = lights.share(question, choice.index);
            assert!((choice.probability / said - 1.0).abs() < 1e-3, "{} {said}", choice.probability);
            assert!((0.0..1.0).contains(&choice.remainder));
        }
        let shares: Vec<f32> = (0..lights.len()).map(|i| lights.share(question, i)).collect();
        let sum: f64 = shares.iter().map(|share| f64::from(*share)).sum();
        assert!(sum < 1.0 + 1e-4 && (!is_whole || sum > 1.0 - 1e-4), "{sum}");
        // Lattice points: each light owns a few intervals.
        for (i, (found, share)) in found.iter().zip(&shares).enumerate() {
            assert!((*found as f32 - share * count as f32).abs() < 4.0, "{i}: {found}, {share}");
            assert!(*share > 0.0 || question.light(&lights[i]) == 0.0, "{i} is never chosen");
        }
    }

    #[test]
    fn lights_are_chosen_as_often_as_is_said_and_probabilities_make_one() {
        for (of_all, is_whole) in [(lamps(300), true), (mixed(300), false), (mixed(5), false), (lamps(1), true)] {
            let tree = LightTree::new(&of_all, Vec::new()).unwrap();
            let lights = Lights::with_tree(&of_all, &tree);
            let rng = &mut Generator::new(4);
            for _ in 0..6 {
                let (points, rays) = questions(rng);
                check_choices(&lights, &points[0], is_whole);
                points[1..].iter().for_each(|question| check_choices(&lights, question, false));
                rays.iter().for_each(|question| check_choices(&lights, question, is_whole));
                for g in [0.6, -0.9] {
                    let phase = Phase::from(Lobe::HenyeyGreenstein { g });
                    let to_eye = warp::uniform_sphere(uniform2(rng));
                    check_choices(&lights, &scattered(points[0], to_eye, &phase), is_whole);
                    check_choices(&lights, &scattered(points[2], to_eye, &phase), false);
                }
            }
        }
    }

    /// What an estimate of light that is scattered has as its mean square, over its squared mean, where a question chooses the lamp.
    fn spread_of_scattered(lights: &Lights<'_>, question: &dyn Question, (to_eye, phase): (Vec3, &Phase)) -> f64 {
        let point = at(&mut Generator::new(8));
        let sent = |(i, light): (usize, &Light<'_>)| {
            let to_light = (light.near_field().unwrap().centre() - point).normalize();
            let light = light.importance(point) * phase.value(deflection(to_light, to_eye)).mean();
            let share = lights.share(question, i);
            [f64::from(light), f64::from(light * light / share)]
        };
        let [sum, squares] = lights.iter().enumerate().map(sent).fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        squares / (sum * sum)
    }

    #[test]
    fn lamps_are_chosen_by_what_is_scattered_to_the_eye() {
        let all = lamps(100);
        let tree = LightTree::new(&all, Vec::new()).unwrap();
        let (lights, point) = (Lights::with_tree(&all, &tree), at(&mut Generator::new(8)));
        let mut worst = [0.0_f64; 2];
        for i in 0..8 {
            let phase = Phase::from(Lobe::HenyeyGreenstein { g: 0.6 });
            let to_eye = warp::uniform_sphere(uniform2(&mut Generator::new(i)));
            let to = FromPoint::all(point);
            let by_distance = spread_of_scattered(&lights, &to, (to_eye, &phase));
            let by_lobe = spread_of_scattered(&lights, &scattered(to, to_eye, &phase), (to_eye, &phase));
            worst = [worst[0].max(by_distance), worst[1].max(by_lobe)];
            assert!(by_lobe < by_distance && by_lobe < 1.6, "{by_lobe} {by_distance}");
        }
        assert!(worst[0] > 2.0 * worst[1], "{worst:?}");
    }

    /// What an estimate by one choice has as its mean square, over its squared mean: 1 where probabilities follow the lights.
    fn spread(lights: &Lights<'_>, question: &dyn Question) -> f64 {
        let (mut squares, mut total) = (0.0, 0.0);
        for (i, light) in lights.iter().enumerate() {
            let sent = f64::from(question.light(light));
            total += sent;
            if sent > 0.0 {
                squares += sent * sent / f64::from(lights.share(question, i));
            }
        }
        squares / (total * total)
    }

    #[test]
    fn choices_by_the_tree_are_nearly_as_good_as_by_all_lights() {
        for count in [24, 300, 3000] {
            let all = lamps(count);
            let tree = LightTree::new(&all, Vec::new()).unwrap();
            let lights = Lights::with_tree(&all, &tree);
            let rng = &mut Generator::new(4);
            let (mut of_points, mut of_rays, places) = (0.0, 0.0, 16);
            for _ in 0..places {
                let (points, rays) = questions(rng);
                of_points += spread(&lights, &points[0]) / f64::from(places);
                of_rays += spread(&lights, &rays[0]) / f64::from(places);
            }
            assert!(of_points < 1.3 && of_rays < 1.7, "{count}: {of_points}, {of_rays}");
        }
    }

    #[test]
    fn lamps_beside_a_ray_are_found_however_wide_the_nodes_they_are_in() {
        // A street of lamps whose near fields are smaller than what is between them, and bright points that send something everywhere.
        let lamp = |i: u16| {
            let at = Vec3::new([-3.6, 3.6][usize::from(i % 2)], 6.0, -2.5 * f32::from(i));
            Light::Sphere(SphereLight::new(at, 0.16, Spectrum::splat(75.0)).unwrap())
        };
        let point = |x| Light::Point(PointLight::new(Vec3::new(x, 1.0, -9.0), Spectrum::splat(40.0)).unwrap());
        let all: Vec<_> = (0..200).map(lamp).chain([-2.0, 2.0].map(point)).collect();
        let tree = LightTree::new(&all, Vec::new()).unwrap();
        let (lights, rng) = (Lights::with_tree(&all, &tree), &mut Generator::new(6));
        let mut worst = 0.0_f32;
        for i in 0..200 {
            // Past a lamp, by half a metre at most, and on for a metre.
            let (eye, lamp) = (Vec3::new(0.0, 2.7, 3.0), all[i].near_field().unwrap().centre());
            let across = warp::uniform_sphere(uniform2(rng)).cross(lamp - eye).normalize();
            let ray = Ray::between(eye, lamp + (0.16 + 0.34 * uniform(rng)) * across);
            let centres = all[..200].iter().map(|light| light.near_field().unwrap().centre());
            if centres.into_iter().any(|centre| ray.direction.cross(centre - eye).length() < 0.16 - 1e-3) {
                continue; // It ends at a lamp before.
            }
            let question = FromRay { ray, near: 0.0, far: ray.length + 1.0, steep: true, until: None };
            let sent: Vec<f32> = all.iter().map(|light| question.light(light)).collect();
            let total: f32 = sent.iter().sum();
            for (i, sent) in sent.iter().enumerate().filter(|(_, sent)| **sent > 0.0) {
                worst = worst.max(sent / total / lights.share(&question, i));
            }
        }
        assert!(worst < 100.0, "a sample may be {worst} times as bright as all light");
    }

    /// Counts the nodes and lights that are looked at.
    struct Counting<'a, Q>(&'a Q, &'a Cell<u32>);

    impl<Q: Question> Question for Counting<'_, Q> {
        fn asks(&self, kind: Kind) -> bool {
            self.0.asks(kind)
        }
        fn light(&self, light: &Light<'_>) -> f32 {
            self.1.set(self.1.get() + 1);
            self.0.light(light)
        }
        fn node(&self, node: &LightNode) -> Guess {
            self.1.set(self.1.get() + 1);
            self.0.node(node)
        }
        fn limit(&self) -> usize {
            self.0.limit()
        }
    }

    #[test]
    fn a_choice_and_its_probability_look_at_few_nodes() {
        let mut most = Vec::new();
        for count in [100, 1000, 10_000] {
            let all = lamps(count);
            let tree = LightTree::new(&all, Vec::new()).unwrap();
            let lights = Lights::with_tree(&all, &tree);
            let rng = &mut Generator::new(7);
            let mut looked = 0;
            for _ in 0..50 {
                let (points, rays) = questions(rng);
                for index in [0, count / 2] {
                    let seen = Cell::new(0);
                    let _ = lights.pick(&Counting(&points[0], &seen), uniform(rng));
                    looked = looked.max(seen.replace(0));
                    let _ = lights.pick(&Counting(&rays[0], &seen), uniform(rng));
                    looked = looked.max(seen.replace(0));
                    let _ = lights.share(&Counting(&points[0], &seen), index);
                    looked = looked.max(seen.replace(0));
                }
            }
            most.push(looked);
        }
        // A cut, and two nodes of every level: of ten times as many lights there are four levels more.
        assert!(most[0] > 0 && most[2] <= most[1] + 10 && most[1] <= most[0] + 10 && most[2] < 80, "{most:?}");
    }

    #[test]
    fn sums_over_representatives_agree_with_sums_over_all_lights() {
        let all = mixed(600);
        let tree = LightTree::new(&all, Vec::new()).unwrap();
        let (lights, rng) = (Lights::with_tree(&all, &tree), &mut Generator::new(9));
        for _ in 0..4 {
            let question = FromPoint::all(at(rng));
            let exact: f64 = all.iter().map(|light| f64::from(question.light(light))).sum();
            let (mut sum, mut squares, runs, mut visits) = (0.0, 0.0, 2000, 0);
            for _ in 0..runs {
                let mut one = 0.0;
                lights.representatives(&question, rng, |light, share, _| {
                    one += f64::from(question.light(light) / share);
                    visits += 1;
                });
                sum += one;
                squares += one * one;
            }
            let n = f64::from(runs);
            let (mean, error) = (sum / n, libm::sqrt((squares / n - (sum / n) * (sum / n)).max(0.0) / n));
            assert!((mean - exact).abs() < 4.0 * error + 1e-4 * exact, "{mean} {exact} {error}");
            assert!(visits <= 64 * runs);
        }
    }

    #[test]
    fn the_tree_finds_what_a_look_at_all_lights_finds() {
        let all = mixed(200);
        let tree = LightTree::new(&all, Vec::new()).unwrap();
        let (few, many, rng) = (Lights::from(&all), Lights::with_tree(&all, &tree), &mut Generator::new(2));
        assert!(many.has_tree() && !few.has_tree());
        for _ in 0..100 {
            let point = at(rng);
            assert_eq!(many.nearest2(point), few.nearest2(point));
            assert_eq!(many.sky(Vec3::Z), few.sky(Vec3::Z));
        }
        let sorted = |lights: &Lights<'_>| {
            let mut found: Vec<usize> = lights.distant().map(|(i, _)| i).collect();
            found.sort_unstable();
            found
        };
        assert_eq!(sorted(&many), sorted(&few));
        assert!(many.but_sky().all(|lights| lights.sky(Vec3::Z) == Spectrum::ZERO));
        // By power, whatever is chosen has the probability it has among all.
        let bounds = Bounds { min: Vec3::ZERO, max: Vec3::splat(2.0) };
        let total: f32 = all.iter().map(|light| light.power(&bounds).mean()).sum();
        for i in 0..100 {
            let choice = many.emitting(&bounds, (i as f32 + 0.5) / 100.0).unwrap();
            let expected = all[choice.index].power(&bounds).mean() / total;
            assert!((choice.probability / expected - 1.0).abs() < 1e-4, "{choice:?} {expected}");
        }
    }

    #[test]
    fn memory_that_is_too_small_is_told() {
        let all = lamps(4);
        let mut memory = [LightNode::EMPTY; 11];
        assert!(LightTree::new(&all, &mut memory[..]).is_err());
        assert!(!LightTree::new(&[], Vec::new()).is_ok_and(|tree| Lights::with_tree(&[], &tree).has_tree()));
    }
}
