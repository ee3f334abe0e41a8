//! placeholder
use crate::storage::{Full, List};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Node(u32);
#[derive(Debug)]
pub struct Index<'s> {
    spheres: List<'s, [f32; 4]>,
    nodes: List<'s, Node>,
}
impl<'s> Index<'s> {
    pub fn new(nodes: impl Into<List<'s, Node>>, spheres: impl Into<List<'s, [f32; 4]>>) -> Self {
        Self { spheres: spheres.into(), nodes: nodes.into() }
    }
    pub fn rebuild(&mut self, count: u32, sphere: impl Fn(u32) -> (Vec3, f32)) -> Result<(), Full> {
        self.spheres.clear();
        for i in 0..count {
            let (p, r) = sphere(i);
            self.spheres.push([p.x, p.y, p.z, r])?;
        }
        Ok(())
    }
    pub fn len(&self) -> u32 {
        self.spheres.as_slice().len() as u32
    }
    #[inline]
    pub fn visit(&self, point: Vec3, mut visit: impl FnMut(u32, f32)) {
        for (i, s) in self.spheres.as_slice().iter().enumerate() {
            let d = Vec3::new(s[0], s[1], s[2]).distance_squared(point);
            if d < s[3] * s[3] {
                visit(i as u32, crate::math::float::sqrt(d) / s[3]);
            }
        }
    }
    pub fn bytes(&self) -> usize {
        self.spheres.as_slice().len() * 16 + self.nodes.as_slice().len()
    }
}
