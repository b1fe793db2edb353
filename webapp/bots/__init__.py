"""Participants that are programs: they take part over HTTP as people do, so that a study can be tried before launch."""
