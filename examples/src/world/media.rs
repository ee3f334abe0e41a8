//! Media and where they are.

use fogbow::host::Medium;
use fogbow::medium::Homogeneous;

use crate::error::SceneError;
use crate::scene_file::{Matter, SceneFile};

/// Tables a medium borrows.
#[derive(Debug, Default)]
pub(super) struct MediumTable;

impl MediumTable {
    pub(super) fn bytes(&self) -> usize {
        0
    }
}

pub(super) fn tables(_: &SceneFile) -> Vec<MediumTable> {
    Vec::new()
}

/// The media of a scene.
#[derive(Debug)]
pub struct Media<'a> {
    homogeneous: Vec<Homogeneous>,
    marker: core::marker::PhantomData<&'a ()>,
}

impl<'a> Media<'a> {
    pub(super) fn new(scene: &'a SceneFile, _: &'a mut [MediumTable]) -> Result<Self, SceneError> {
        let mut homogeneous = Vec::new();
        for medium in &scene.media {
            let fail = |reason: String| SceneError {
                file: scene.file.clone(),
                line: None,
                element: format!("<medium id=\"{}\">", medium.id),
                attribute: None,
                reason,
            };
            match &medium.matter {
                Matter::Homogeneous { absorption, scattering, phase } => homogeneous
                    .push(Homogeneous::new(*absorption, *scattering, *phase).map_err(|e| fail(e.to_string()))?),
                Matter::Grid { .. } => return Err(fail("grids are not supported yet".to_owned())),
            }
        }
        Ok(Self { homogeneous, marker: core::marker::PhantomData })
    }

    /// One by one.
    pub fn iter(&self) -> impl Iterator<Item = &dyn Medium> {
        self.homogeneous.iter().map(|m| m as &dyn Medium)
    }
}
