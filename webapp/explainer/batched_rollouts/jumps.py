"""Where a deterministic policy stands after any number of steps, for many walkers at once."""

import numpy as np
import torch
from numpy.typing import NDArray


class PolicyJumps:
    """A policy without chance, and where it leads after 1, 2, 4, 8 ... steps.

    A state passes through another on its way to a goal exactly if it stands there after as many steps as it is further
    away. A state of a path to a goal lies on no loop, so who never arrives never comes through it either.
    """

    def __init__(self, successor: torch.Tensor, distance: NDArray[np.int64]) -> None:
        """Double the steps until they span the longest way.

        Args:
            successor: `[S]` int32, where the policy leads in one step.
            distance: `[S]`, in how many steps it reaches a goal; -1 where it never does.
        """
        self._distance = torch.from_numpy(distance).to(torch.int32).to(successor.device)
        self._jumps = [successor]
        for _ in range(1, int(distance.max()).bit_length()):
            self._jumps.append(self._jumps[-1].index_select(0, self._jumps[-1]))

    def arrive(self, states: torch.Tensor) -> torch.Tensor:
        """Return `[N]`: True where the policy reaches a goal from a state, `[N]` int32."""
        return self._distance.index_select(0, states) >= 0

    def meet(self, states: torch.Tensor, featured: torch.Tensor) -> torch.Tensor:
        """Return `[N]`: True where the policy, after at least one step from a state, comes to another, both `[N]`."""
        far = self._distance.index_select(0, states)
        steps = far - self._distance.index_select(0, featured)
        here = states
        for power, jump in enumerate(self._jumps):
            here = torch.where((steps >> power) & 1 == 1, jump.index_select(0, here), here)
        return (here == featured) & (steps > 0) & (far >= 0)
