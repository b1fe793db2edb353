"""The parts of the report, one module each: data in, blocks out."""
