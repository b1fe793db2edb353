"""What was measured, where, and docs/evidence.md, which follows from it."""
