"""Faults on purpose: power cuts, killed processes, full disks, everybody at once, each with a control."""
