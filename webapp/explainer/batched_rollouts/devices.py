"""Where rollouts run, and the stream of their draws there."""

import torch


def chosen_device(name: str | None = None) -> torch.device:
    """Return a device that is there.

    Args:
        name: As torch calls it, such as `cpu`, `cuda` or `mps`; the accelerator, if there is one, when left out.

    Raises:
        ValueError: There is no such device.
    """
    if name is None:
        found = torch.accelerator.current_accelerator(check_available=True)
        return torch.device("cpu") if found is None else found
    try:
        device = torch.device(name)
        torch.zeros(1, device=device).cpu()
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        raise ValueError(f"there is no device {name!r} here; use cpu, or leave the choice open") from error
    return device


def seeded(seed: int, device: torch.device | None = None) -> torch.Generator:
    """Return a stream of draws on a device, the CPU when left out. Equal seeds give equal draws on equal devices."""
    return torch.Generator(device=device or torch.device("cpu")).manual_seed(seed)
