"""The core: worlds, learning, importance, subgoals, key points, explanations and their pictures.

It may not import Flask, SQLAlchemy, or any other package of this project. Only `learning` and `batched_rollouts`
import torch; only `worlds.environment` imports minigrid.
"""
