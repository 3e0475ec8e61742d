//! What is written down: files in a guarded folder, and `--json`.
