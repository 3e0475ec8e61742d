//! Stability (placeholder until the next commit).
