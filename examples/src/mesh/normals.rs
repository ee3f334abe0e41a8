//! Normals at vertices.

use fogbow::math::Vec3;

use super::Mesh;

impl Mesh {
    /// Gives every vertex without a normal the mean of those of the triangles around it, weighted by their angles there (Thürmer
    /// and Wüthrich 1998, "Computing Vertex Normals from Polygonal Facets"). Triangles that share a point share its normal,
    /// whatever their texture coordinates.
    pub fn smooth(&mut self) {
        let is_missing = |normal: &Vec3| !(normal.length_squared() > 0.0 && normal.is_finite());
        if !self.normals.is_empty() && !self.normals.iter().any(is_missing) {
            return;
        }
        let point = |vertex: u32| self.points.get(vertex as usize).copied().unwrap_or(vertex) as usize;
        let count = (0..self.vertices.len() as u32).map(point).max().map_or(0, |most| most + 1);
        let mut sums = vec![[0.0_f64; 3]; count];
        for triangle in &self.triangles {
            let corners = self.corners(*triangle);
            let Some(normal) = (corners[1] - corners[0]).cross(corners[2] - corners[0]).try_normalize() else {
                continue;
            };
            for (k, vertex) in triangle.iter().enumerate() {
                let edge = |to: usize| (corners[(k + to) % 3] - corners[k]).normalize_or_zero();
                let angle = edge(1).angle_between(edge(2));
                let Some(sum) = sums.get_mut(point(*vertex)).filter(|_| angle.is_finite()) else { continue };
                for (slot, along) in sum.iter_mut().zip((normal * angle).to_array()) {
                    *slot += f64::from(along);
                }
            }
        }
        let mean = |vertex: u32| {
            let sum = sums.get(point(vertex)).copied().unwrap_or_default();
            // Where nothing is around, or all cancels, triangles show their own.
            Vec3::from_array(sum.map(|c| c as f32)).normalize_or_zero()
        };
        let known = core::mem::take(&mut self.normals);
        let numbers = 0..self.vertices.len() as u32;
        self.normals = numbers
            .map(|vertex| match known.get(vertex as usize) {
                Some(normal) if !is_missing(normal) => *normal,
                _ => mean(vertex),
            })
            .collect();
    }

    /// Orders the corners of triangles so that they face the side that normals at their corners point to: that is the side that
    /// reflects and shines.
    pub fn face_normals(&mut self) {
        if self.normals.is_empty() {
            return;
        }
        for index in 0..self.triangles.len() {
            let Some(triangle) = self.triangles.get(index).copied() else { continue };
            let [a, b, c] = self.corners(triangle);
            let side: Vec3 = triangle.iter().filter_map(|i| self.normals.get(*i as usize)).sum();
            if (b - a).cross(c - a).dot(side) < 0.0
                && let Some(slot) = self.triangles.get_mut(index)
            {
                *slot = [triangle[0], triangle[2], triangle[1]];
            }
        }
    }
}
