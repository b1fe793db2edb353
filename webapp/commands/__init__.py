"""The verbs of `xar` that explain and compare, one module each."""
