//! Which method a render takes where none is asked for: radiance caching where it can, else path tracing.

use fogbow::path;

use super::radiance_cache::check_depth;
use super::{Failure, Method, RenderArguments};
use crate::world::World;

/// The method of a render.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Choice {
    pub(crate) method: Method,
    /// Why it is not radiance caching, where nobody asked for another.
    pub(crate) instead: Option<String>,
}

impl Choice {
    /// What was asked for, or what suits.
    ///
    /// # Errors
    /// A method that was asked for and cannot be had: by its name, or by files of caches.
    pub(super) fn of(arguments: &RenderArguments, paths: &path::Settings, world: &World<'_>) -> Result<Self, Failure> {
        if let Some(method) = arguments.method {
            if method == Method::RadianceCache {
                check_depth(paths)?;
            }
            return Ok(Self { method, instead: None });
        }
        let Some(reason) = obstacle(paths, world) else {
            return Ok(Self { method: Method::RadianceCache, instead: None });
        };
        Ok(Self { method: Method::Path, instead: Some(reason) })
    }

    /// What a user who named no method is told.
    pub(super) fn line(&self) -> String {
        match &self.instead {
            None => "by radiance caching; --method takes others".to_owned(),
            Some(reason) => format!("by path tracing and not by radiance caching: {reason}"),
        }
    }
}

/// Why radiance caching is not for this render; `None` if it is.
fn obstacle(paths: &path::Settings, world: &World<'_>) -> Option<String> {
    match paths.max_scatterings {
        limit @ (0 | 1) => Some(format!("nothing is left to cache of paths of depth {}", limit + 1)),
        u32::MAX if !world.has_cacheable() => Some("nothing scatters light but mirrors and glass".to_owned()),
        u32::MAX => None,
        limit => Some(format!("caches hold light of paths of any depth, not of at most {}", u64::from(limit) + 1)),
    }
}
