"""Hold the planned analysis to its promises, over 200 studies without effects and 200 planted ones, and time it.

python -m tests.benchmarks.rehearsal

The interval of the family-wise error must hold .05, that of the coverage .95, and all of it takes at most 90 seconds on
one core.
"""

import sys
import time

from tests.unit.power.designs import study_and_plan
from webapp.rehearsal.calibration import calibrate
from webapp.rehearsal.planting import planted_effects

NUM_PEOPLE = 60
NUM_STUDIES = 200
PROMISED_S = 90.0


def main() -> int:
    """Print the shares with their intervals, and return 0 if every promise is kept."""
    study, plan = study_and_plan("sakai2021")
    begun = time.perf_counter()
    found = calibrate(study, plan, planted_effects((), study, plan), NUM_PEOPLE, NUM_STUDIES, seed=2021)
    seconds = time.perf_counter() - begun
    for promise in found.promises:
        counts = f"{promise.share:.3f} ({promise.low:.3f} to {promise.high:.3f}) of {promise.total}"
        print(f"  {promise.name:45} {counts:38} {promise.word}")
    in_time = seconds <= PROMISED_S
    print(f"  {seconds:.1f} s, promised at most {PROMISED_S:.0f}: {'kept' if in_time else 'BROKEN'}")
    is_kept = all(promise.word in {"kept", "nothing promised"} for promise in found.promises)
    return 0 if is_kept and in_time else 1


if __name__ == "__main__":
    sys.exit(main())
