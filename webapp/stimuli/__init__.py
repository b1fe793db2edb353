"""From explanations to what stands on a page: built offline by `build`, read by the web worker through `catalogue`."""
