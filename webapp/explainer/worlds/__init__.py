"""Key-door worlds: read from ASCII maps, stepped as a Gymnasium environment, tabulated as a finite MDP."""
