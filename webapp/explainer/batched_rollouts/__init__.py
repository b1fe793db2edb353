"""Algorithm 1's rollouts, many walkers at once in torch: on a table, or through a recurrent world model.

Sakai et al. 2021, section 4.2.1 and Algorithm 1. Only this package and `learning` import torch.
"""

from webapp.explainer.batched_rollouts.devices import chosen_device, seeded
from webapp.explainer.batched_rollouts.recurrent import RecurrentRollouts, RecurrentWorldModel
from webapp.explainer.batched_rollouts.table import TableRollouts

__all__ = ["RecurrentRollouts", "RecurrentWorldModel", "TableRollouts", "chosen_device", "seeded"]
