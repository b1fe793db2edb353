"""Learning from experience: a DQN and a recurrent world model per map, all maps trained in one stacked run."""

from webapp.explainer.learning.agent import AgentNetworks, TrainedAgent
from webapp.explainer.learning.fresh_agents import FreshAgent, Outcome, learn
from webapp.explainer.learning.fresh_settings import FreshSettings
from webapp.explainer.learning.saving import load, save
from webapp.explainer.learning.settings import TrainingSettings
from webapp.explainer.learning.stop_test import Verdict, judge
from webapp.explainer.learning.training import Progress, TrainingFailed, train

__all__ = [
    "AgentNetworks",
    "FreshAgent",
    "FreshSettings",
    "Outcome",
    "Progress",
    "TrainedAgent",
    "TrainingFailed",
    "TrainingSettings",
    "Verdict",
    "judge",
    "learn",
    "load",
    "save",
    "train",
]
