"""A study platform for explanations that a learned agent gives of its own behaviour."""
