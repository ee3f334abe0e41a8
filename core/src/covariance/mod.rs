//! Layer 7: covariances of light fields in participating media.
