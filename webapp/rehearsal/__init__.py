"""A dry run of a whole study with planted effects: bots, export, analysis, and whether the report tells the truth."""
