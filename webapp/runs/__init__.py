"""What every run of an experiment, an analysis or a power study leaves: a folder that says where it comes from."""
