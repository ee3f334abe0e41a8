//! Layer 7: photon beams.
