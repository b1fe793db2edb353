"""The analysis of a data set as a report: read, choose, analyse, write. Statistics are `webapp.analysis`'s."""
