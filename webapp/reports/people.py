"""How many people there are, how many are analysed, and why the others are not, for sentences and for the methods."""

from collections import Counter
from dataclasses import dataclass

from webapp.reports.formatting import counted, listed
from webapp.reports.study_data import StudyData


@dataclass(frozen=True, slots=True)
class Headcount:
    """Who is analysed.

    Attributes:
        analysed: People whose rows are analysed.
        ratings: Their ratings.
        everybody: All who agreed to take part, None if the data set does not say.
        reasons: Why the others are not analysed, with how many, the most frequent first.
    """

    analysed: int
    ratings: int
    everybody: int | None
    reasons: tuple[tuple[str, int], ...]

    def sentence(self) -> str:
        """Return who is analysed, as a sentence."""
        told = f"{counted(self.analysed, 'participant')} with {counted(self.ratings, 'rating')}"
        verb = "is" if self.analysed == 1 else "are"
        if self.everybody is None:
            return f"{told} {verb} analysed; the data set does not say who else there was."
        if not self.reasons:
            return f"{told} {verb} analysed, which is everybody who agreed to take part."
        reasons = listed([f"{reason} ({count})" for reason, count in self.reasons])
        left_out = self.everybody - self.analysed
        of_all = f"of {self.everybody:,} who agreed to take part"
        return f"{told} {verb} analysed, {of_all}; {left_out:,} {'is' if left_out == 1 else 'are'} not: {reasons}."


def headcount(data: StudyData) -> Headcount:
    """Count who is analysed and who is not."""
    ratings, analysed = len(data.ratings), len(data.participants)
    if data.everybody is None:
        return Headcount(analysed, ratings, None, ())
    counts = Counter(str(reason) for reason in data.everybody["reason"].dropna())
    reasons = tuple(sorted(counts.items(), key=lambda each: (-each[1], each[0])))
    return Headcount(analysed, ratings, len(data.everybody), reasons)
