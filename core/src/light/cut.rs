//! A cut through the tree of lights: nodes that hold every light once, small where what they send matters.

use super::lights::{Floor, Lights};
use super::question::{Guess, Question};
use super::tree::{Kind, NONE};
use crate::sampling::discrete::Choice;
use crate::sampling::uniform::ONE_MINUS_EPSILON;

/// Nodes of a cut at most.
pub(super) const MOST: usize = 64;

/// Nodes of the cut by which one light is chosen. More: probabilities follow what lights send more closely, at the cost of looking at twice as
/// many nodes; fewer: nodes around a place stay closed, and lights in them that are near it are chosen too seldom.
pub(super) const CHOICE: usize = 16;

/// The same for segments of walks with gradients, of which a record has hundreds: their noise is that of the walks.
pub(super) const WALKS: usize = 8;

/// Nodes of the cut of which every one sends a light: for sums over all lights. More: less noise of a record, for as many more shadow rays.
pub(super) const REPRESENTATIVES: usize = 64;

/// A node is opened where what is not known of it is more than this part of all that is sent. Larger: smaller cuts, whose choices are
/// noisier; smaller: nodes are opened that do not matter.
const DOUBT: f32 = 0.1;

/// Lights that are somewhere, suns, and skies.
const GROUPS: usize = 3;

fn group(kind: Kind) -> u8 {
    match kind {
        Kind::Sun => 1,
        Kind::Sky => 2,
        _ => 0,
    }
}

/// Nodes with what they send, about.
pub(crate) struct Cut {
    entries: heapless::Vec<(u32, f32), MOST>,
    total: f32,
}

impl Cut {
    /// From the roots down, what is least known first, until nothing is in doubt or there are `limit` nodes.
    pub(super) fn of(lights: &Lights<'_>, question: &dyn Question, limit: usize) -> Self {
        let mut cut = Self { entries: heapless::Vec::new(), total: 0.0 };
        let mut doubts = heapless::Vec::<f32, MOST>::new();
        let mut groups = heapless::Vec::<u8, MOST>::new();
        for (kind, root) in lights.roots().filter(|(kind, _)| question.asks(*kind)) {
            let guess = guess(lights, question, root);
            if guess.weight > 0.0 {
                cut.total += guess.weight;
                // There is room for `limit` nodes.
                let _ = (cut.entries.push((root, guess.weight)), doubts.push(guess.doubt), groups.push(group(kind)));
            }
        }
        while cut.entries.len() < limit.min(MOST) {
            let (mut worst, mut most) = (0, 0.0);
            for (i, doubt) in doubts.iter().enumerate() {
                if *doubt > most {
                    (worst, most) = (i, *doubt);
                }
            }
            // What was taken away may leave less than nothing of the total.
            if most <= DOUBT * cut.total.max(0.0) {
                break;
            }
            let (index, weight) = cut.entries.swap_remove(worst);
            doubts.swap_remove(worst);
            let group = groups.swap_remove(worst);
            cut.total -= weight;
            for child in lights.node(index).children() {
                let guess = guess(lights, question, child);
                if guess.weight > 0.0 {
                    cut.total += guess.weight;
                    let _ = (cut.entries.push((child, guess.weight)), doubts.push(guess.doubt), groups.push(group));
                }
            }
        }
        cut.raise(&groups);
        // Anew, so that rounding does not add up.
        cut.total = cut.entries.iter().map(|(_, weight)| weight).sum();
        cut
    }

    /// What is sent from where light may not arrive counts no less than [`Floor`] says.
    fn raise(&mut self, groups: &[u8]) {
        let first = groups.first().copied();
        if groups.iter().all(|group| Some(*group) == first) {
            return;
        }
        let mut sent = [0.0; GROUPS];
        for ((_, weight), group) in self.entries.iter().zip(groups) {
            sent[usize::from(*group)] += weight;
        }
        let floor = Floor::of(&mut sent.into_iter());
        for ((_, weight), group) in self.entries.iter_mut().zip(groups) {
            let of_group = sent[usize::from(*group)];
            *weight *= floor.raised(of_group) / of_group;
        }
    }

    pub(super) fn entries(&self) -> &[(u32, f32)] {
        &self.entries
    }

    pub(super) fn pick(&self, lights: &Lights<'_>, question: &dyn Question, u: f32) -> Option<Choice> {
        let mut left = u * self.total;
        let mut found = None;
        for &(node, weight) in &self.entries {
            found = Some((node, weight, (left / weight).min(ONE_MINUS_EPSILON)));
            if left < weight {
                break;
            }
            left -= weight;
        }
        let (node, weight, mut remainder) = found?;
        let (index, share) = self.descend(lights, question, (node, weight), &mut remainder)?;
        Some(Choice { index, probability: share * (weight / self.total), remainder })
    }

    /// One light of an entry, and the probability with which it is taken of that. `None` where it turns out that nothing shines.
    pub(super) fn descend(
        &self,
        lights: &Lights<'_>,
        question: &dyn Question,
        (mut index, _): (u32, f32),
        u: &mut f32,
    ) -> Option<(usize, f32)> {
        let mut share = 1.0;
        loop {
            let node = lights.node(index);
            if let Some(light) = node.leaf() {
                return Some((light, share));
            }
            let children = node.children();
            let [left, right] = children.map(|child| guess(lights, question, child).weight);
            let of_left = left / (left + right);
            // Written so that NaN, of no light at all, fails.
            if !(left + right > 0.0) {
                return None;
            }
            let (child, part, rest) = if *u < of_left {
                (children[0], of_left, *u / of_left)
            } else {
                (children[1], 1.0 - of_left, (*u - of_left) / (1.0 - of_left))
            };
            if part <= 0.0 {
                return None;
            }
            *u = rest.clamp(0.0, ONE_MINUS_EPSILON);
            (index, share) = (child, share * part);
        }
    }

    /// The probability with which [`Cut::pick`] takes a light.
    pub(super) fn share(&self, lights: &Lights<'_>, question: &dyn Question, light: usize) -> f32 {
        if light >= lights.slice().len() {
            return 0.0;
        }
        let (mut index, mut share) = (lights.node(light as u32).leaf, 1.0);
        while index != NONE {
            if let Some((_, weight)) = self.entries.iter().find(|(entry, _)| *entry == index) {
                return share * (weight / self.total);
            }
            let above = lights.node(index).parent;
            if above == NONE {
                break;
            }
            let children = lights.node(above).children();
            let [left, right] = children.map(|child| guess(lights, question, child).weight);
            if !(left + right > 0.0) {
                return 0.0;
            }
            let of_left = left / (left + right);
            share *= if children[0] == index { of_left } else { 1.0 - of_left };
            index = above;
        }
        0.0
    }
}

#[inline]
fn guess(lights: &Lights<'_>, question: &dyn Question, index: u32) -> Guess {
    let node = lights.node(index);
    match node.leaf() {
        Some(light) => Guess { weight: question.leaf(node, &lights.slice()[light]), doubt: 0.0 },
        None => question.node(node),
    }
}
